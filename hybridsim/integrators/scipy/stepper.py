"""This module advances SciPy's solvers step by step; the engine locates events on the dense output."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.record.segments import Dense
from hybridsim.engine.run.stepping import Flow, Step
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.tolerances import Tolerances

_SHARE_OF_A_TURN = 0.1  # longest first step, in radians of the fastest forcing
_RETRIES, _SHORTER = 25, 0.25  # retries, and step factor, if a solver gives up on a trial with NaN
_SMALLEST = 1e-12  # shortest useful first step, as a share of the segment


def dense_of(interpolant: Any) -> Dense:
    """Return an interpolant of SciPy as dense output, with times as rows."""
    return lambda s: interpolant(s).T


class SolverStepper:
    """Advances an instance of `scipy.integrate.OdeSolver` through one segment."""

    def __init__(
        self,
        solver_class: Any,
        implicit: bool,
        flow: Flow,
        x0: np.ndarray,
        bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        origin: float = 0.0,
    ) -> None:
        self.solver_class, self.implicit = solver_class, implicit
        self.flow, self.tolerances = flow, tolerances
        self.bound, self.reached, self.last_step, self.met_no_number = bound, (origin, x0), first_step, False
        self.solver = self._solver(origin, x0, bound, first_step)

    def _solver(self, s0: float, x0: np.ndarray, bound: float, first_step: float | None) -> Any:
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            solver = self._made(s0, x0, bound, first_step)
        if not np.isfinite(getattr(solver, "h_abs", 0.0)):
            # SciPy's guess of a first step gave a NaN, and SciPy would halve the guess indefinitely
            solver.h_abs = 1e-9 * abs(bound - s0)
        return solver

    def _made(self, s0: float, x0: np.ndarray, bound: float, first_step: float | None) -> Any:
        return self.solver_class(
            self._rhs,
            s0,
            x0.copy(),  # LSODA overwrites its argument
            bound,
            first_step=first_step,
            max_step=self.tolerances.max_step,
            rtol=self.tolerances.rtol,
            atol=self.tolerances.atol,
            **({"jac": self._jacobian} if self.implicit else {}),
        )

    def _rhs(self, s: float, x: np.ndarray) -> np.ndarray:
        self.flow.counters.rhs_evaluations += 1
        rate = self.flow.rhs(s, x)
        self.met_no_number = self.met_no_number or not np.isfinite(rate).all()
        return rate

    def _jacobian(self, s: float, x: np.ndarray) -> np.ndarray:
        """Return the Jacobian, or zeros if the Jacobian is not finite, so that SciPy tries a shorter step."""
        jacobian = self.flow.jacobian(s, x)
        return jacobian if np.isfinite(jacobian).all() else np.zeros_like(jacobian)

    def step(self) -> Step:
        """Return one accepted step."""
        for _ in range(_RETRIES):
            try:
                return self._advance(self.solver)
            except StepFailure:
                if not self.met_no_number:
                    raise
            # LSODA gives up if a trial is NaN; restarted with a shorter step it gets closer
            shorter = _SHORTER * abs(self.last_step or self.bound)
            s0, x0 = self.reached
            self.solver = self._solver(s0, x0, self.bound, min(shorter, abs(self.bound - s0)))
            self.last_step, self.met_no_number = shorter, False
            self.flow.counters.rejected += 1
        return self._advance(self.solver)

    def restep(self, step: Step, s: float) -> Step:
        """Repeat a step to exactly the local time `s`, or return a shorter step if the solver takes a shorter one."""
        solver = self._solver(step.s0, step.x0, s, abs(s - step.s0))
        part = self._advance(solver)
        if solver.status != "running":
            return Step(step.s0, s, step.x0, part.x1, part.dense)
        length = abs(part.s1 - part.s0)
        self.solver = self._solver(part.s1, part.x1, self.bound, min(length, abs(self.bound - part.s1)))
        self.reached, self.last_step = (part.s1, part.x1), length
        return part

    def _advance(self, solver: Any) -> Step:
        before = solver.nfev
        s0, x0 = solver.t, solver.y
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            message = solver.step()  # a trial with NaN is rejected and needs no warning
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            raise StepFailure(f"{solver.__class__.__name__}: {message or 'the state is not a finite number'}")
        if solver is self.solver:
            self.reached, self.last_step = (float(solver.t), solver.y), float(solver.t - s0)
        stages = getattr(solver, "n_stages", 0)
        if stages:
            self.flow.counters.rejected += max((solver.nfev - before) // stages - 1, 0)
        return Step(float(s0), float(solver.t), x0, solver.y, dense_of(solver.dense_output()))


def series_step(flow: Flow, x0: np.ndarray, bound: float, tolerances: Tolerances) -> float:
    """Return a first step over which the higher Taylor terms of the states are below the tolerance."""
    series = flow.system.series(0.0, x0, flow.p, flow.z, np.zeros(flow.n), 0.0).states
    scale = tolerances.atol + tolerances.rtol * np.abs(x0)
    step = min(abs(bound), _SHARE_OF_A_TURN / max(map(abs, flow.system.rates), default=1e-300))
    for k in (2, 3):
        moving = (series[:, k] != 0.0) & np.isfinite(series[:, k]) & (scale > 0.0)
        if moving.any():
            step = min(step, float(np.min((scale[moving] / np.abs(series[moving, k])) ** (1.0 / k))))
    return max(step, _SMALLEST * abs(bound))
