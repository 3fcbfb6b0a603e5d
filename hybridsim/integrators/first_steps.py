"""Take the first steps of a multistep method by a method of high order if its errors would hide a guard."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hybridsim.engine.run.stepping import Flow, Step, Stepper, Watch
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.runge_kutta.dop853 import Dop853

# A guard that grows with this order or later is late, such as a gap that opens with zero rate and acceleration. The
# first step of order one has a quadratic error, which hides later growth.
_LATE = 3
# In tolerances of the states: errors of the first steps of a multistep method are tens of tolerances.
_CLEAR = 100.0
# In the same unit. A guard that rises less and returns is short, such as the gap of a small bounce. Errors of tens of
# tolerances at its end would change its duration by more than about a part in 1e5, and all later ones with it.
_SHORT = 1e6
# Largest number of first steps; in a stiff mode explicit steps may be too short, and the method then takes over.
_MAX_FIRST_STEPS = 100


def with_first_steps(
    flow: Flow,
    x0: np.ndarray,
    bound: float,
    tolerances: Tolerances,
    watch: Watch,
    make: Callable[[float, np.ndarray], Stepper],
) -> Stepper:
    """Start a multistep method; if its errors would hide a guard, the first steps are of high order."""
    rising = np.array(
        [int(g) for g in watch.guards if watch.sides[g] > 0 and watch.orders[g] >= 1], dtype=int
    )
    if len(rising) == 0:
        return make(0.0, x0)
    series = flow.system.series(0.0, x0, flow.p, flow.z, np.zeros(flow.n), 0.0).guards[rising]
    orders = watch.orders[rising]
    sizes = guard_errors(flow, tolerances, rising, 0.0, x0)[1]
    is_short = peaks(series, orders) < _SHORT * sizes
    late = is_short | (orders >= _LATE)
    if not late.any():
        return make(0.0, x0)
    clear = np.where(is_short, _SHORT, _CLEAR)[late]
    first = min(_first(series[late], orders[late], clear * sizes[late]), abs(bound), tolerances.max_step)
    return FirstSteps(flow, x0, bound, tolerances, watch, rising[late], clear, first, make)


def peaks(series: np.ndarray, orders: np.ndarray) -> np.ndarray:
    """Return how high guards rise by their first two terms before they return to zero; inf if they do not."""
    rows = np.arange(len(orders))
    leading, next_ = series[rows, orders], series[rows, np.minimum(orders + 1, series.shape[1] - 1)]
    turns = (leading * next_ < 0.0) & np.isfinite(leading * next_) & (orders + 1 < series.shape[1])
    at = np.full(len(orders), np.inf)  # g = c t**k (1 - r t) is largest at t = k/((k + 1) r)
    at[turns] = -orders[turns] / (orders[turns] + 1) * leading[turns] / next_[turns]
    return np.where(turns, np.abs(leading) * at**orders / (orders + 1), np.inf)


def guard_errors(
    flow: Flow, tolerances: Tolerances, guards: np.ndarray, s: float, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of guards, and their changes by tolerated errors of the states."""
    sizes = tolerances.atol + tolerances.rtol * np.abs(x)
    states = np.vstack([x, x + np.diag(sizes)])
    values = flow.guards(np.full(len(states), s), states)[:, guards]
    return values[0], np.abs(values[1:] - values[0]).sum(axis=0)


def _first(series: np.ndarray, orders: np.ndarray, sizes: np.ndarray) -> float:
    """Return a first step length at which the leading terms of late guards exceed their errors."""
    leading = np.abs(series[np.arange(len(orders)), orders])
    known = (leading > 0.0) & np.isfinite(leading)
    steps = (sizes[known] / leading[known]) ** (1.0 / orders[known])
    return 2.0 * float(max(steps, default=np.inf))


class FirstSteps:
    """Take steps of DOP853 until each late guard exceeds its error, then steps of the multistep method.

    A multistep method begins at order one with errors of the size of its tolerance. A gap that opens with the
    cube of time would seem to close again, and of bounces that accumulate the last ones would be lost.
    """

    def __init__(
        self,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        watch: Watch,
        late: np.ndarray,
        clear: np.ndarray,
        first: float,
        make: Callable[[float, np.ndarray], Stepper],
    ) -> None:
        self.flow, self.bound, self.tolerances, self.late, self.clear, self.make = (
            flow,
            bound,
            tolerances,
            late,
            clear,
            make,
        )
        self.stepper: Stepper = Dop853().start(flow, x0, bound, tolerances, first, watch)
        self.count, self.is_over = 0, False

    def step(self) -> Step:
        """Return the next step, by DOP853 or by the multistep method."""
        step = self.stepper.step()
        if not self.is_over:
            self.count += 1
            if step.s1 != self.bound and (self.count >= _MAX_FIRST_STEPS or self._is_clear(step.s1, step.x1)):
                self.stepper, self.is_over, self.early = self.make(step.s1, step.x1), True, self.stepper
                self.last = step
        return step

    def restep(self, step: Step, s: float) -> Step:
        """Repeat a step up to s with the method that took it."""
        if self.is_over and step is self.last:
            self.stepper, self.is_over = self.early, False
        return self.stepper.restep(step, s)

    def _is_clear(self, s: float, x: np.ndarray) -> bool:
        """Return whether the late guards exceed their errors."""
        values, errors = guard_errors(self.flow, self.tolerances, self.late, s, x)
        return bool((values > self.clear * errors).all())
