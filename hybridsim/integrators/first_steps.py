"""Start a multistep method with steps of high order if its own first steps are too inaccurate for a guard."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hybridsim.engine.run.stepping import Flow, Step, Stepper, Watch
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.runge_kutta.dop853 import Dop853

# A guard that grows with this order or later is late, such as a gap that opens with zero rate and acceleration. The
# first step of order one has a quadratic error, which hides later growth.
_LATE = 3
# In tolerances of the states: errors of the first steps of a multistep method are tens of tolerances.
_CLEAR = 100.0
# Largest number of first steps; in a stiff mode explicit steps may be too short, and the method then takes over.
_MAX_FIRST_STEPS = 100


def with_first_steps(
    flow: Flow,
    x0: np.ndarray,
    bound: float,
    tolerances: Tolerances,
    watch: Watch,
    make: Callable[[float, np.ndarray], Stepper],
    keeps_low: bool = True,
) -> Stepper:
    """Start a multistep method; take first steps of high order if its errors could exceed the value of a guard.

    A guard is hidden if it grows late, or if it is low: if states jump when it is zero, and it is thrown up and falls
    back while the states change by less than atol/rtol, as in the last of infinitely many bounces. All of this time
    the absolute tolerance exceeds the relative one, so the errors may be as large as the guard. keeps_low: whether
    low guards count.
    """
    jumps = keeps_low & _jumps(flow.system)[watch.guards]
    guards = watch.guards[(watch.sides[watch.guards] > 0) & (jumps | (watch.orders[watch.guards] >= _LATE))]
    if len(guards) == 0:
        return make(0.0, x0)
    orders, rows = watch.orders[guards], np.arange(len(guards))
    terms = flow.system.series(0.0, x0, flow.p, flow.z, np.zeros(flow.n), 0.0).guards[guards]
    peaks, durations = throws(terms, math.copysign(1.0, bound))
    lows = changes(flow, guards, 0.0, x0, tolerances.atol / tolerances.rtol)[1]
    is_low = keeps_low & _jumps(flow.system)[guards] & (peaks < lows)
    hidden = is_low | (orders >= _LATE)
    if not hidden.any():
        return make(0.0, x0)
    errors = changes(flow, guards, 0.0, x0, tolerances.atol + tolerances.rtol * np.abs(x0))[1]
    with np.errstate(all="ignore"):
        clear = (_CLEAR * errors / np.abs(terms[rows, orders])) ** (1.0 / np.maximum(orders, 1))
    steps = np.where(is_low, durations, clear)[hidden]
    first = 2.0 * float(max(steps[np.isfinite(steps) & (steps > 0.0)], default=np.inf))
    floors = np.where(is_low, lows, 0.0)[hidden]
    return FirstSteps(flow, x0, bound, tolerances, watch, guards[hidden], floors, first, make)


def _jumps(system: System) -> np.ndarray:
    """Return, for each guard, whether an impact or a reset makes states jump at its zero."""
    resets = [key[1] for key in system.resets if key[0] == "choice"]
    return system.is_unilateral[system.owner] | np.isin(system.owner, resets)


def throws(terms: np.ndarray, direction: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the maxima of guards and the times at which they return to zero, both from three Taylor terms.

    A guard that is not pulled back has the height inf.
    """
    value, rate, pull = terms[:, 0], direction * terms[:, 1], -terms[:, 2]
    with np.errstate(all="ignore"):  # value + rate t - pull t**2
        peaks = value + np.maximum(rate, 0.0) ** 2 / (4.0 * pull)
        times = (rate + np.sqrt(rate**2 + 4.0 * pull * value)) / (2.0 * pull)
    return np.where((pull > 0.0) & (times > 0.0), peaks, np.inf), times


def changes(
    flow: Flow, guards: np.ndarray, s: float, x: np.ndarray, sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the values of guards, and bounds of their changes if each state changes by its entry in `sizes`."""
    values = flow.guards(np.full(flow.n + 1, s), np.vstack([x, x + np.diag(sizes)]))[:, guards]
    return values[0], np.abs(values[1:] - values[0]).sum(axis=0)


class FirstSteps:
    """Take steps of DOP853 until each guard that starts at zero exceeds its error, then steps of a multistep method.

    A multistep method begins at order one with errors of the size of its tolerance. A gap that opens with the cube of
    time would seem to close again, and of bounces that accumulate the last ones would be lost.

    Parameters
    ----------
    hidden : numbers of the hidden guards.
    floors : values that they must exceed as well; 0 for a guard that only grows late.
    first : length of the first step.
    """

    def __init__(
        self,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        watch: Watch,
        hidden: np.ndarray,
        floors: np.ndarray,
        first: float,
        make: Callable[[float, np.ndarray], Stepper],
    ) -> None:
        self.flow, self.bound, self.tolerances, self.make = flow, bound, tolerances, make
        self.hidden, self.floors = hidden, floors
        first = min(first, abs(bound), tolerances.max_step)
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
        """Take a step again, with the same method, but only as far as the local time s."""
        if self.is_over and step is self.last:
            self.stepper, self.is_over = self.early, False
        return self.stepper.restep(step, s)

    def _is_clear(self, s: float, x: np.ndarray) -> bool:
        """Return whether all guards that errors could hide have become larger than their errors."""
        sizes = self.tolerances.atol + self.tolerances.rtol * np.abs(x)
        values, errors = changes(self.flow, self.hidden, s, x, sizes)
        return bool((values > np.maximum(_CLEAR * errors, self.floors)).all())
