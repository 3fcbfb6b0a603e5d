"""Take the first steps of a multistep method by a method of high order if a guard grows late."""

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
    """Start a multistep method; if a guard grows late, the first steps are of high order."""
    late = [int(g) for g in watch.guards if watch.sides[g] > 0 and watch.orders[g] >= _LATE]
    return FirstSteps(flow, x0, bound, tolerances, watch, late, make) if late else make(0.0, x0)


class FirstSteps:
    """Take steps of DOP853 until each late guard exceeds its error, then steps of the multistep method.

    A multistep method begins at order one with errors of the size of its tolerance, while a gap that opens
    grows with the cube of time. Without these steps a gap that has opened would seem to close again.
    """

    def __init__(
        self,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        watch: Watch,
        late: list[int],
        make: Callable[[float, np.ndarray], Stepper],
    ) -> None:
        self.flow, self.bound, self.tolerances, self.late, self.make = flow, bound, tolerances, late, make
        first = min(self._first(x0, watch), abs(bound), tolerances.max_step)
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

    def _first(self, x0: np.ndarray, watch: Watch) -> float:
        """Return a first step length at which the leading terms of late guards exceed their errors."""
        series = self.flow.system.series(0.0, x0, self.flow.p, self.flow.z, np.zeros(self.flow.n), 0.0)
        orders = watch.orders[self.late]
        leading = np.abs(series.guards[self.late, orders])
        sizes = _CLEAR * self._errors(0.0, x0)[1]
        known = (leading > 0.0) & np.isfinite(leading)
        steps = (sizes[known] / leading[known]) ** (1.0 / orders[known])
        return 2.0 * float(max(steps, default=np.inf))

    def _errors(self, s: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the values of late guards, and their changes by tolerated errors of the states."""
        sizes = self.tolerances.atol + self.tolerances.rtol * np.abs(x)
        states = np.vstack([x, x + np.diag(sizes)])
        values = self.flow.guards(np.full(len(states), s), states)[:, self.late]
        return values[0], np.abs(values[1:] - values[0]).sum(axis=0)

    def _is_clear(self, s: float, x: np.ndarray) -> bool:
        """Return whether the late guards exceed their errors."""
        values, errors = self._errors(s, x)
        return bool((values > _CLEAR * errors).all())
