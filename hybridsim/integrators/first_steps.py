"""The first steps of a multistep method from a guard that grows late: by a method of high order, then handed over."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hybridsim.engine.run.stepping import Flow, Step, Stepper, Watch
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.runge_kutta.dop853 import Dop853

# The order of growth from which a guard is late: a gap that opens with its rate and acceleration zero. The first step
# of order one has an error of its square, which hides whatever grows later than that.
_LATE = 3
# In tolerances of the states: errors over the first steps of a multistep method are some tens of these.
_CLEAR = 100.0
_MOST = (
    100  # first steps; explicit ones in a stiff mode may be short, and the guard is left to the method then
)


def with_first_steps(
    flow: Flow,
    x0: np.ndarray,
    bound: float,
    tolerances: Tolerances,
    watch: Watch,
    make: Callable[[float, np.ndarray], Stepper],
) -> Stepper:
    """A multistep method, which `make` begins at a local time and state: after first steps if a guard grows late."""
    late = [int(g) for g in watch.guards if watch.sides[g] > 0 and watch.orders[g] >= _LATE]
    return FirstSteps(flow, x0, bound, tolerances, watch, late, make) if late else make(0.0, x0)


class FirstSteps:
    """Steps of DOP853 until the guards that begin at zero are clear of the errors of the states; then the method's own.

    A multistep method begins at order one, and its errors are those of its tolerance, while a gap that opens grows with
    the cube of time: what has opened would seem to close again.
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
        """The next step of the one or the other."""
        step = self.stepper.step()
        if not self.is_over:
            self.count += 1
            if step.s1 != self.bound and (self.count >= _MOST or self._is_clear(step.s1, step.x1)):
                self.stepper, self.is_over, self.early = self.make(step.s1, step.x1), True, self.stepper
                self.last = step
        return step

    def restep(self, step: Step, s: float) -> Step:
        """By the method that took the step."""
        if self.is_over and step is self.last:
            self.stepper, self.is_over = self.early, False
        return self.stepper.restep(step, s)

    def _first(self, x0: np.ndarray, watch: Watch) -> float:
        """The step after which the leading terms of the late guards are clear; the method shortens it if it must."""
        series = self.flow.system.series(0.0, x0, self.flow.p, self.flow.z, np.zeros(self.flow.n), 0.0)
        orders = watch.orders[self.late]
        leading = np.abs(series.guards[self.late, orders])
        sizes = _CLEAR * self._errors(0.0, x0)[1]
        known = (leading > 0.0) & np.isfinite(leading)
        steps = (sizes[known] / leading[known]) ** (1.0 / orders[known])
        return 2.0 * float(max(steps, default=np.inf))

    def _errors(self, s: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The late guards, and what errors of the states within their tolerances make of them."""
        sizes = self.tolerances.atol + self.tolerances.rtol * np.abs(x)
        states = np.vstack([x, x + np.diag(sizes)])
        values = self.flow.guards(np.full(len(states), s), states)[:, self.late]
        return values[0], np.abs(values[1:] - values[0]).sum(axis=0)

    def _is_clear(self, s: float, x: np.ndarray) -> bool:
        """Whether the late guards are beyond what errors of the states may make of them."""
        values, errors = self._errors(s, x)
        return bool((values > _CLEAR * errors).all())
