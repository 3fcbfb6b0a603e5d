"""This module runs CVODE of SUNDIALS through scikit-sundae; the engine locates events."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import ClassVar

import numpy as np

from hybridsim.engine.record.hermite import hermite, on_first_use
from hybridsim.engine.record.segments import Dense
from hybridsim.engine.run.stepping import Flow, Step, Stepper, Watch
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.contract import RESTARTED, Integrator
from hybridsim.integrators.first_steps import with_first_steps
from hybridsim.integrators.past_steps import MAX_PAST_POINTS, converges, through

# More steps than one output should need; CVODE's default of 500 would end long smooth segments.
_MAX_STEPS = 10_000_000
_SMALLEST = 2e-14  # smallest rtol that CVODE accepts


@cache
def _leave_stdout_alone() -> None:
    """Make SUNDIALS write its warnings to stderr, unless the user has chosen another output.

    Otherwise they go to C's standard output, among the caller's data. SUNDIALS reads these variables when a
    solver is created. Redirecting the file descriptor around its calls would also redirect the output of
    other threads.
    """
    for level in ("WARNING", "INFO", "DEBUG"):
        os.environ.setdefault(f"SUNLOGGER_{level}_FILENAME", "stderr")


class CvodeStepper:
    """Advances CVODE through one segment.

    CVODE's step control depends only on the states. While a mode holds them, a step would grow over many
    periods of a forcing that only the guards contain. Therefore the sine of every angle that grows in time is
    integrated, too. The error control then resolves the forcing in every mode.
    """

    def __init__(
        self,
        method: str,
        flow: Flow,
        bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        s: float,
        x: np.ndarray,
    ) -> None:
        from sksundae.cvode import CVODE

        _leave_stdout_alone()
        self.flow, self.bound = flow, bound
        at = flow.system.layout.phases_at
        self.rates = np.asarray(flow.system.rates)
        self.phases = flow.p[at : at + len(self.rates)]
        # CVODE uses a root-mean-square norm, in which one of n errors may be sqrt(n) times the tolerance
        share = 1.0 / np.sqrt(flow.n + len(self.rates))
        rtol = max(share * tolerances.rtol, min(tolerances.rtol, _SMALLEST))
        atol = share * np.concatenate([tolerances.atol, np.full(len(self.rates), tolerances.rtol)])
        # a restart has order 1 and cannot reuse the step size from before an event, only one that a user sets
        first = first_step if first_step == tolerances.first_step else None
        self.solver = CVODE(
            self._rhs(),
            jacfn=self._jacobian() if method == "BDF" else None,
            method=method,
            rtol=rtol,
            atol=atol,
            first_step=first or 0.0,
            max_step=0.0 if np.isinf(tolerances.max_step) else tolerances.max_step,
            max_num_steps=_MAX_STEPS,
        )
        self.s, self.x = s, x
        angles = np.sin(self.phases + self.rates * s)
        self.solver.init_step(s, np.concatenate([x, angles]))
        self.past_times, self.past_states = [s], [x]
        # the series at the end of the last step with computed dense output
        self.last_series = math.nan, np.zeros((0, 0))

    def _rhs(self) -> Callable[[float, np.ndarray, np.ndarray], None]:
        flow, n, rates, phases = self.flow, self.flow.n, self.rates, self.phases

        def rhs(s: float, x: np.ndarray, dx: np.ndarray) -> None:
            flow.counters.rhs_evaluations += 1
            dx[:n] = flow.rhs(s, np.ascontiguousarray(x[:n]))
            dx[n:] = rates * np.cos(phases + rates * s)

        return rhs

    def _jacobian(self) -> Callable[[float, np.ndarray, np.ndarray, np.ndarray], None]:
        """Return a function that computes the Jacobian; CVODE's own finite differences would miss narrow corners."""
        flow, n = self.flow, self.flow.n

        def jacobian(s: float, x: np.ndarray, dx: np.ndarray, out: np.ndarray) -> None:
            found = flow.jacobian(s, np.ascontiguousarray(x[:n]))
            out[:, :] = 0.0
            if np.isfinite(found).all():
                out[:n, :n] = found

        return jacobian

    def _dense(self, s0: float, s1: float, x0: np.ndarray, x1: np.ndarray) -> Dense:
        """Return dense output that is computed on first use."""
        self.past_times = [*self.past_times, s1][-MAX_PAST_POINTS:]
        self.past_states = [*self.past_states, x1][-MAX_PAST_POINTS:]
        times, states = np.array(self.past_times), np.array(self.past_states)

        def make() -> Dense:
            left = self._series(s0, x0) if self.last_series[0] != s0 else self.last_series[1]
            right = self._series(s1, x1)
            self.last_series = s1, right
            smooth = converges(left, s1 - s0, x1) and converges(right, s0 - s1, x0)
            return hermite(s0, s1, left, right) if smooth else through(times, states)

        return on_first_use(make)

    def _series(self, s: float, x: np.ndarray) -> np.ndarray:
        zero = np.zeros(self.flow.n)
        return self.flow.system.series(s, x, self.flow.p, self.flow.z, zero, 0.0).states

    def step(self) -> Step:
        """Return one internal step of CVODE, shortened at the bound of the segment."""
        result = self.solver.step(self.bound, method="onestep", tstop=self.bound)
        if not result.success:
            raise StepFailure(f"CVODE: {result.message}")
        s0, x0 = self.s, self.x
        s1, x1 = float(result.t), np.array(result.y[: self.flow.n], dtype=float)
        if s1 == s0:
            raise StepFailure("CVODE: no progress")
        self.s, self.x = s1, x1
        return Step(s0, s1, x0, x1, self._dense(s0, s1, x0, x1))

    def restep(self, step: Step, s: float) -> Step:
        """Raise NotImplementedError; events are located on the dense output, which is as accurate as the method."""
        raise NotImplementedError("the events of CVODE are located on the dense output")


class _Cvode(Integrator):
    """The common base class of both CVODE integrators."""

    formulas: ClassVar[str]
    dense_is_accurate: ClassVar[bool] = True

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
        make = partial(CvodeStepper, self.formulas, flow, s_bound, tolerances, first_step)
        return with_first_steps(flow, x0, s_bound, tolerances, watch, make)


@dataclass(frozen=True)
class CvodeBDF(_Cvode):
    """CVODE's backward differentiation formulas of orders 1 to 5, for stiff modes.

    When to choose it: stiff modes, such as regularised laws and laws with fast internal states. It restarts
    at order 1 after each event. Events are located on its dense output, the two-point Hermite polynomial of
    degree 7.
    """

    name: ClassVar[str] = "cvode-bdf"
    title: ClassVar[str] = "SUNDIALS CVODE, BDF"
    order: ClassVar[str] = "1 to 5"
    reference: ClassVar[str] = "Hindmarsh et al. 2005, doi:10.1145/1089014.1089020"
    when: ClassVar[str] = "stiff modes"
    lacks: ClassVar[dict[str, str]] = RESTARTED
    formulas: ClassVar[str] = "BDF"


@dataclass(frozen=True)
class CvodeAdams(_Cvode):
    """CVODE's Adams-Moulton formulas of orders 1 to 12, for modes that are not stiff.

    When to choose it: long smooth segments between events at tight tolerances. Events are handled as by
    `cvode-bdf`.
    """

    name: ClassVar[str] = "cvode-adams"
    title: ClassVar[str] = "SUNDIALS CVODE, Adams"
    order: ClassVar[str] = "1 to 12"
    reference: ClassVar[str] = "Hindmarsh et al. 2005, doi:10.1145/1089014.1089020"
    when: ClassVar[str] = "long smooth motions, not stiff"
    lacks: ClassVar[dict[str, str]] = {
        **RESTARTED,
        "stiff": "with stiff rates its iteration converges only with very short steps: use cvode-bdf",
    }
    formulas: ClassVar[str] = "Adams"
