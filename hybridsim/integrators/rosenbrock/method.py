"""This module defines Rosenbrock methods by a tableau, for stiff modes and with the exact Jacobian."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hybridsim.engine.run.stepping import Flow
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.one_step import OneStepStepper, Point, Trial
from hybridsim.integrators.rosenbrock.step import Linearisation, RosenbrockTableau, rosenbrock_attempt, solve

_DEFECT = 100.0  # largest defect in the middle of a step, in tolerances, as for Runge-Kutta methods


@dataclass(frozen=True)
class StageDense:
    """Dense output from the stages of one Rosenbrock step, as a polynomial in theta on [0, 1].

    K (order - 1, n) are the combinations of stages. The values at both ends are exact.
    """

    s0: float
    s1: float
    x0: np.ndarray
    x1: np.ndarray
    K: np.ndarray

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,)."""
        return self._at((np.asarray(s, dtype=float) - self.s0) / (self.s1 - self.s0))

    def _at(self, theta: np.ndarray) -> np.ndarray:
        """Return the states (k, n) at given fractions of the step (k,)."""
        theta = theta[:, None]
        inner = np.zeros((len(theta), len(self.x0)))
        for row in self.K[::-1]:
            inner = inner * theta + row
        # starting from x0, so that states at rest stay exactly constant
        out = self.x0 + theta * ((self.x1 - self.x0) + (1.0 - theta) * inner)
        out[theta[:, 0] == 1.0] = self.x1
        return out

    def middle(self) -> np.ndarray:
        """Return the state (n,) in the middle of the step."""
        return self._at(np.array([0.5]))[0]

    def middle_slope(self) -> np.ndarray:
        """Return the rate of change (n,) of the dense output in the middle of the step."""
        orders = np.arange(len(self.K))
        inner = (orders * 0.5 ** (orders - 1.0)) @ self.K
        return ((self.x1 - self.x0) + 0.25 * inner) / (self.s1 - self.s0)


class RosenbrockStepper(OneStepStepper):
    """Advances a Rosenbrock method through one segment; event times are refined by repeating the step."""

    def __init__(
        self,
        tableau: RosenbrockTableau,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        first_step: float | None,
    ) -> None:
        self.tableau, n, self._address = tableau, flow.n, flow.system.address("flow")
        self._linearisation = Linearisation(flow.system, flow.p, flow.z)
        self._scratch = (np.empty((n, n)), np.empty(n, dtype=np.int64), np.empty(n))
        super().__init__(flow, x0, bound, tolerances, first_step, tableau.order, tableau.error_order)

    def _point(self, s: float, x: np.ndarray) -> RosenbrockPoint:
        return RosenbrockPoint(self.flow, s, x, self._linearisation)

    def attempt(self, start: Point, h: float) -> Trial:
        assert isinstance(start, RosenbrockPoint)
        flow, tableau, out = self.flow, self.tableau, np.empty(self.flow.n)
        stages = np.empty((len(tableau.nodes), flow.n))
        flow.counters.rhs_evaluations += len(tableau.nodes)
        error = rosenbrock_attempt(
            self._address, tableau.arrays, start.s, h, start.x, *start.linear, flow.p, flow.z, self.control,
            *self._scratch, stages, out,
        )  # fmt: skip
        return Trial(out, error, stages)

    def holds(self, start: Point, end: Point, trial: Trial) -> bool:
        """Return whether the dense output satisfies the differential equation in the middle of the step.

        The defect is weighted like an error of the step, h (1 - gamma h J)^-1 (f(x) - x'). The weight is
        small for a stiff component that the flow damps immediately.
        """
        flow, tableau = self.flow, self.tableau
        dense = self.dense(start, end, trial)
        x = dense.middle()
        flow.counters.rhs_evaluations += 1
        missed = flow.rhs(0.5 * (start.s + end.s), x) - dense.middle_slope()
        matrix, pivots, _ = self._scratch
        solve(matrix, pivots, missed)
        rtol, atol = self.control
        size = np.maximum(np.abs(x), np.abs(start.x))
        return not (np.abs(missed) > tableau.gamma * _DEFECT * (atol + rtol * size)).any()

    def dense(self, start: Point, end: Point, trial: Trial) -> StageDense:
        return StageDense(start.s, end.s, start.x, end.x, self.tableau.dense @ trial.dense_data)


class RosenbrockPoint(Point):
    """A point with the linearisation of the flow: Jacobian (n, n) and time derivative (n,)."""

    def __init__(self, flow: Flow, s: float, x: np.ndarray, linearisation: Linearisation) -> None:
        super().__init__(flow, s, x)
        self._linearisation = linearisation

    @cached_property
    def linear(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the linearisation of the flow, computed on first use."""
        self.flow.counters.rhs_evaluations += self.flow.n + 1
        return self._linearisation.at(self.s, self.x)
