"""This module defines the integrator `exact`, which computes linear modes in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.engine.linear.modes import refuse_nonlinear, what_is_not_linear
from hybridsim.engine.native.constants import TIGHTEST
from hybridsim.engine.run.compiled_loop import CompiledLoop, compile_loops
from hybridsim.engine.run.stepping import Flow, Stepper, Watch
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.closed_form.compiled_loop import ClosedFormKernels
from hybridsim.integrators.contract import NEEDS_TAPE, Integrator
from hybridsim.integrators.taylor.method import TaylorStepper


def _kernels(system: System, tolerances: Tolerances, longest: float) -> ClosedFormKernels:
    """Return the compiled functions of the method `exact`; tolerances are not used."""
    return ClosedFormKernels(system, longest)


@dataclass(frozen=True)
class Exact(Integrator):
    """Closed-form motion of each linear mode, x(t) = Re(T exp(B t) c), with bounds for zeros of guards.

    It applies to modes that are linear in the states with constant, polynomial, exponential or sinusoidal
    forcing, and to guards that are linear in states and forcing. Monitors may be polynomials of the states.
    The model's declaration decides this, and the error for another model names the obstacle. B is block
    diagonal (see `hybridsim.engine.linear.modal`), so that defective, oscillatory and stiff modes are treated
    alike. A guard that is one undamped wave has its zeros in closed form. Every other guard is followed by
    lower bounds made of its Taylor polynomial and the largest remainder, so that no zero is passed over, and
    its zeros are accurate to rounding. There is no step and no truncation error: rtol and atol are not used.
    A segment with something unusual (a monitor that is not a polynomial of the states, a case decided by
    rounding, time running backward) is computed from its Taylor series, which converges everywhere, to
    rounding of the states' nominal sizes. There atol is used.

    When to choose it: whenever it applies. It is the fastest and the most accurate.
    """

    name: ClassVar[str] = "exact"
    title: ClassVar[str] = "linear modes in closed form"
    order: ClassVar[str] = "exact"
    reference: ClassVar[str] = "Moler and Van Loan 2003, doi:10.1137/S00361445024180 (methods 14 to 18)"
    when: ClassVar[str] = "piecewise linear models: fastest and most accurate"
    lacks: ClassVar[dict[str, str]] = {
        "nonlinear": "a closed form needs modes that are linear in the states",
        "functions": NEEDS_TAPE,
    }
    dense_is_accurate: ClassVar[bool] = True
    has_compiled_loop: ClassVar[bool] = True

    def prepare(self, system: System) -> None:
        """Compile the event loop; raise an error for a model that is not piecewise linear."""
        refuse_nonlinear(system)
        compile_loops(system, _kernels)

    def compiled_loop(self, system: System, tolerances: Tolerances, longest: float) -> CompiledLoop | None:
        """Return the compiled loop, or None if max_step is set, because a closed form has no steps.

        The result is also None if a monitor, which the system has as a corner, is not a polynomial of the states.
        """
        is_possible = math.isinf(tolerances.max_step) and what_is_not_linear(system) is None
        return CompiledLoop(_kernels(system, tolerances, longest)) if is_possible else None

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin to integrate the motion up to the next event, by Taylor series with a tight tolerance."""
        tight = Tolerances(TIGHTEST, 1e-3 * tolerances.atol, tolerances.max_step)
        return TaylorStepper(flow, x0, s_bound, tight, first_step)
