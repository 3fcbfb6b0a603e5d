"""This module defines explicit embedded Runge-Kutta methods by a tableau and a name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.engine.record.hermite import hermite, holds_between, middle_weights, on_first_use
from hybridsim.engine.record.segments import Dense
from hybridsim.engine.run.compiled_loop import CompiledLoop, compile_loops
from hybridsim.engine.run.stepping import Flow, Stepper, Watch
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.contract import EXPLICIT, Integrator
from hybridsim.integrators.one_step import OneStepStepper, Point, Trial
from hybridsim.integrators.runge_kutta.compiled_loop import RungeKuttaKernels
from hybridsim.integrators.runge_kutta.step import Tableau, attempt

__all__ = ["RungeKuttaIntegrator", "RungeKuttaStepper", "Tableau"]


class RungeKuttaStepper(OneStepStepper):
    """Advances a Runge-Kutta method through one segment, with dense output of degree 7.

    The dense output is the Hermite polynomial on the Taylor coefficients of the flow at both ends, with an
    error of h**8 x^(8)/(256 8!); event times are refined by repeating the step.
    """

    def __init__(
        self,
        tableau: Tableau,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        first_step: float | None,
    ) -> None:
        self.tableau = tableau
        self._address = flow.system.address("flow")
        self._slopes = np.empty((len(tableau.c), flow.n))
        super().__init__(flow, x0, bound, tolerances, first_step, tableau.order, tableau.error_order)

    def attempt(self, start: Point, h: float) -> Trial:
        flow, out = self.flow, np.empty(self.flow.n)
        flow.counters.rhs_evaluations += len(self.tableau.c) - 1
        error = attempt(
            self._address,
            self.tableau.packed,
            start.s,
            h,
            start.x,
            start.dx,
            flow.p,
            flow.z,
            self.control,
            self._slopes,
            out,
        )
        return Trial(out, error)

    def holds(self, start: Point, end: Point, trial: Trial) -> bool:
        flow, (x, dx) = self.flow, np.empty((2, self.flow.n))
        if not flow.system.has_tape:  # its derivatives are differences, too inaccurate for the tolerances
            return True
        flow.counters.rhs_evaluations += 1
        weights, ends = middle_weights(start.series.shape[1]), (start.series, end.series)
        return holds_between(
            self._address, weights, start.s, end.s - start.s, *ends, flow.p, flow.z, self.control, x, dx
        )

    def dense(self, start: Point, end: Point, trial: Trial) -> Dense:
        return on_first_use(lambda: hermite(start.s, end.s, start.series, end.series))


@dataclass(frozen=True)
class RungeKuttaIntegrator(Integrator):
    """The base class of explicit embedded methods; class variables contain tableau and description.

    Segments and ordinary events go through the compiled mode loop if the model permits it. Jumps inside a
    mode and Python functions do not, since the loop follows guards by their series.
    """

    tableau: ClassVar[Tableau]
    lacks: ClassVar[dict[str, str]] = EXPLICIT
    has_compiled_loop: ClassVar[bool] = True

    @property
    def stable_to(self) -> float:
        """Return the stability limit of the tableau on the negative axis."""
        return self.tableau.real_stability

    @property
    def rounding(self) -> float:
        """Return the rounding error of a step, from the rounding of all sums in the stages."""
        return self.tableau.rounding

    @classmethod
    def _kernels(cls, system: System, tolerances: Tolerances, longest: float) -> RungeKuttaKernels:
        return RungeKuttaKernels(system, tolerances, longest, cls.tableau)

    def prepare(self, system: System) -> None:
        """Compile the event loop of the method."""
        if system.has_tape and not system.has_corners:
            compile_loops(system, self._kernels)

    def compiled_loop(self, system: System, tolerances: Tolerances, longest: float) -> CompiledLoop | None:
        """Return the compiled event loop, or None for a model with corners or Python functions."""
        has_compiled_loop = system.has_tape and not system.has_corners
        return CompiledLoop(self._kernels(system, tolerances, longest)) if has_compiled_loop else None

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin to integrate the motion up to the next event."""
        return RungeKuttaStepper(self.tableau, flow, x0, s_bound, tolerances, first_step)
