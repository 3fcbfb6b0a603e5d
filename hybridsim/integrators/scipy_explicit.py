"""SciPy's explicit Runge-Kutta solvers, stepped one step at a time; events are located on their dense output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from hybridsim.engine.stepping import Dense, Flow, Step, StepFailure, Stepper, Tolerances, Watch
from hybridsim.engine.trajectory import Pieces
from hybridsim.integrators.base import Integrator


def _dense(interpolant: Any) -> Dense:
    return lambda s: interpolant(s).T


class SolverStepper:
    """Steps an instance of `scipy.integrate.OdeSolver` through one segment."""

    def __init__(
        self,
        solver_class: Any,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        first_step: float | None,
    ) -> None:
        self.solver_class, self.flow, self.tolerances = solver_class, flow, tolerances
        self.solver = self._solver(0.0, x0, bound, first_step)

    def _solver(self, s0: float, x0: np.ndarray, bound: float, first_step: float | None) -> Any:
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            solver = self._made(s0, x0, bound, first_step)
        if not np.isfinite(solver.h_abs):
            # SciPy's guess of a first step met a value that is no number; it would halve that guess for ever
            solver.h_abs = 1e-9 * abs(bound - s0)
        return solver

    def _made(self, s0: float, x0: np.ndarray, bound: float, first_step: float | None) -> Any:
        return self.solver_class(
            self._rhs,
            s0,
            x0,
            bound,
            first_step=first_step,
            max_step=self.tolerances.max_step,
            rtol=self.tolerances.rtol,
            atol=self.tolerances.atol,
        )

    def _rhs(self, s: float, x: np.ndarray) -> np.ndarray:
        self.flow.counters.rhs_evaluations += 1
        return self.flow.rhs(s, x)

    def step(self) -> Step:
        """One accepted step."""
        return self._advance(self.solver)

    def restep(self, step: Step, s: float) -> Step:
        """From the start of a step to s in one step of exactly that length (more only if it is rejected)."""
        solver = self._solver(step.s0, step.x0, s, abs(s - step.s0))
        parts = [self._advance(solver)]
        while solver.status == "running":
            parts.append(self._advance(solver))
        dense = parts[0].dense
        if len(parts) > 1:
            knots = np.array([step.s0, *(part.s1 for part in parts)])
            dense = Pieces(knots, tuple(part.dense for part in parts))
        return Step(step.s0, s, step.x0, parts[-1].x1, dense)

    def _advance(self, solver: Any) -> Step:
        before = solver.nfev
        s0, x0 = solver.t, solver.y
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            message = solver.step()  # a trial that is no number is rejected, not worth a warning
        if solver.status == "failed":
            raise StepFailure(f"{solver.__class__.__name__}: {message}")
        stages = getattr(solver, "n_stages", 0)
        if stages:
            self.flow.counters.rejected += max((solver.nfev - before) // stages - 1, 0)
        return Step(float(s0), float(solver.t), x0, solver.y, _dense(solver.dense_output()))


@dataclass(frozen=True)
class ScipyRK45(Integrator):
    """Dormand and Prince's pair of order 5(4), SciPy's default, on our event location.

    When to choose it: loose tolerances (1e-3 to 1e-6) and few states; else `scipy-dop853` is cheaper.
    """

    name: ClassVar[str] = "scipy-rk45"
    title: ClassVar[str] = "SciPy RK45 with events located on its dense output"
    order: ClassVar[str] = "5(4)"
    reference: ClassVar[str] = "Dormand and Prince 1980, doi:10.1016/0771-050X(80)90013-3"
    when: ClassVar[str] = "loose tolerances, smooth non-stiff modes"
    lacks: ClassVar[dict[str, str]] = {"stiff": "explicit: its step is bound by the fastest rate"}

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin a smooth segment."""
        from scipy.integrate import RK45

        return SolverStepper(RK45, flow, x0, s_bound, tolerances, first_step)


@dataclass(frozen=True)
class ScipyDOP853(Integrator):
    """Dormand and Prince's method of order 8(5,3) with interpolant of order 7, on our event location.

    When to choose it: tight tolerances (1e-6 to 1e-13) and smooth non-stiff modes.
    """

    name: ClassVar[str] = "scipy-dop853"
    title: ClassVar[str] = "SciPy DOP853 with events located on its dense output"
    order: ClassVar[str] = "8(5,3)"
    reference: ClassVar[str] = "Hairer, Norsett and Wanner 1993, doi:10.1007/978-3-540-78862-1, section II.10"
    when: ClassVar[str] = "tight tolerances, smooth non-stiff modes"
    lacks: ClassVar[dict[str, str]] = {"stiff": "explicit: its step is bound by the fastest rate"}

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin a smooth segment."""
        from scipy.integrate import DOP853

        return SolverStepper(DOP853, flow, x0, s_bound, tolerances, first_step)
