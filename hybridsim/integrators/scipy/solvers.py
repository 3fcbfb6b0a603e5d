"""This module runs SciPy's six initial value solvers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from hybridsim.engine.run.stepping import Flow, Stepper, Watch
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.contract import EXPLICIT, RESTARTED, Integrator
from hybridsim.integrators.first_steps import with_first_steps
from hybridsim.integrators.scipy.native import NativeStepper
from hybridsim.integrators.scipy.stepper import SolverStepper, series_step

# roots of |R(-z)| = 1 for their stability polynomials
_STABLE = {"RK23": 2.513, "RK45": 3.307, "DOP853": 6.394}


@dataclass(frozen=True)
class ScipyIntegrator(Integrator):
    """A solver of `scipy.integrate`.

    Parameters
    ----------
    events : "located": the engine finds all zeros along each step and repeats the step up to the first one.
        "native": each smooth segment is one call of `solve_ivp` with terminal events, as a careful user
        writes it; see `NativeStepper` for its limitations. The engine decides what follows an event in both
        cases.
    """

    events: Literal["located", "native"] = "located"

    solver: ClassVar[str]
    implicit: ClassVar[bool] = False
    is_multistep: ClassVar[bool] = False  # whether it begins at order one
    keeps_low: ClassVar[bool] = True  # whether DOP853 takes its low bounces
    starts_blind: ClassVar[bool] = False  # whether it gives up after a first step that is far too long

    @property
    def stable_to(self) -> float:
        """Return the stability limit of SciPy's explicit solvers."""
        return _STABLE.get(self.solver, 0.0)

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
        import scipy.integrate

        solver = getattr(scipy.integrate, self.solver)
        if self.events == "native":
            return NativeStepper(solver, self.implicit, flow, x0, s_bound, tolerances, first_step, watch)
        if self.starts_blind:
            first_step = min(first_step or np.inf, series_step(flow, x0, s_bound, tolerances))
        make = partial(SolverStepper, solver, self.implicit, flow)
        if not self.is_multistep:
            return make(x0, s_bound, tolerances, first_step)

        def go_on(s: float, x: np.ndarray) -> Stepper:
            first = None if first_step is None else min(first_step, abs(s_bound - s))
            return make(x, s_bound, tolerances, first, s)

        return with_first_steps(flow, x0, s_bound, tolerances, watch, go_on, self.keeps_low)


@dataclass(frozen=True)
class ScipyRK23(ScipyIntegrator):
    """Bogacki and Shampine's pair of order 3(2); its dense output, a cubic, is as accurate as the method.

    When to choose it: only to show the cost of a low order.
    """

    name: ClassVar[str] = "scipy-rk23"
    title: ClassVar[str] = "SciPy RK23"
    order: ClassVar[str] = "3(2)"
    reference: ClassVar[str] = "Bogacki and Shampine 1989, doi:10.1016/0893-9659(89)90079-7"
    when: ClassVar[str] = "very loose tolerances, 1e-3 and above"
    lacks: ClassVar[dict[str, str]] = EXPLICIT
    solver: ClassVar[str] = "RK23"


@dataclass(frozen=True)
class ScipyRK45(ScipyIntegrator):
    """Dormand and Prince's pair of order 5(4), SciPy's default.

    When to choose it: loose tolerances (1e-3 to 1e-6) and few states; otherwise `scipy-dop853` is faster.
    """

    name: ClassVar[str] = "scipy-rk45"
    title: ClassVar[str] = "SciPy RK45"
    order: ClassVar[str] = "5(4)"
    reference: ClassVar[str] = "Dormand and Prince 1980, doi:10.1016/0771-050X(80)90013-3"
    when: ClassVar[str] = "loose tolerances, smooth non-stiff modes"
    lacks: ClassVar[dict[str, str]] = EXPLICIT
    solver: ClassVar[str] = "RK45"


@dataclass(frozen=True)
class ScipyDOP853(ScipyIntegrator):
    """Dormand and Prince's method of order 8(5,3) with interpolant of order 7.

    When to choose it: tight tolerances (1e-6 to 1e-13) and smooth non-stiff modes.
    """

    name: ClassVar[str] = "scipy-dop853"
    title: ClassVar[str] = "SciPy DOP853"
    order: ClassVar[str] = "8(5,3)"
    reference: ClassVar[str] = "Hairer, Norsett and Wanner 1993, doi:10.1007/978-3-540-78862-1, section II.10"
    when: ClassVar[str] = "tight tolerances, smooth non-stiff modes"
    lacks: ClassVar[dict[str, str]] = EXPLICIT
    solver: ClassVar[str] = "DOP853"


@dataclass(frozen=True)
class ScipyRadau(ScipyIntegrator):
    """Implicit Runge-Kutta method of order 5 (Radau IIA), Newton iteration with the model's own Jacobian.

    When to choose it: stiff modes at 1e-4 to 1e-8. Its dense output is a cubic: steps are repeated to event
    times.
    """

    name: ClassVar[str] = "scipy-radau"
    title: ClassVar[str] = "SciPy Radau"
    order: ClassVar[str] = "5"
    reference: ClassVar[str] = "Hairer and Wanner 1996, doi:10.1007/978-3-642-05221-7, section IV.8"
    when: ClassVar[str] = "stiff modes, moderate tolerances"
    solver: ClassVar[str] = "Radau"
    implicit: ClassVar[bool] = True


@dataclass(frozen=True)
class ScipyBDF(ScipyIntegrator):
    """Backward differentiation formulas of orders 1 to 5 in quasi-constant steps, with the model's own Jacobian.

    When to choose it: stiff modes with few events, loose tolerances; it restarts at order 1 after each event.
    """

    name: ClassVar[str] = "scipy-bdf"
    title: ClassVar[str] = "SciPy BDF"
    order: ClassVar[str] = "1 to 5"
    reference: ClassVar[str] = "Shampine and Reichelt 1997, doi:10.1137/S1064827594276424"
    when: ClassVar[str] = "stiff modes, few events, loose tolerances"
    lacks: ClassVar[dict[str, str]] = {
        **RESTARTED,
        "poles": "after a trial step beyond a pole it restarts at order one, with steps too short to change the time",
    }
    dense_is_accurate: ClassVar[bool] = True
    solver: ClassVar[str] = "BDF"
    is_multistep: ClassVar[bool] = True
    implicit: ClassVar[bool] = True


@dataclass(frozen=True)
class ScipyLSODA(ScipyIntegrator):
    """ODEPACK's LSODA, which switches automatically between Adams formulas (not stiff) and BDF (stiff).

    When to choose it: modes that may or may not be stiff. It gives up after a first step that is far too
    long, so hybridsim computes its first step from the Taylor series of the states.
    """

    name: ClassVar[str] = "scipy-lsoda"
    title: ClassVar[str] = "SciPy LSODA"
    order: ClassVar[str] = "1 to 12"
    reference: ClassVar[str] = "Petzold 1983, doi:10.1137/0904010"
    when: ClassVar[str] = "modes that may or may not be stiff"
    lacks: ClassVar[dict[str, str]] = RESTARTED
    dense_is_accurate: ClassVar[bool] = True
    solver: ClassVar[str] = "LSODA"
    is_multistep: ClassVar[bool] = True
    # its errors in high bounces would end all bounces two tolerances too early, where most runs stop and say so
    keeps_low: ClassVar[bool] = False
    implicit: ClassVar[bool] = True
    starts_blind: ClassVar[bool] = True
