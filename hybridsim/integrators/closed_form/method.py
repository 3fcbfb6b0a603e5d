"""Linear modes in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.engine.linear.modes import refuse_nonlinear
from hybridsim.engine.run.compiled_loop import compile_leaps
from hybridsim.engine.run.stepping import Flow, Stepper, Watch
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.closed_form.compiled_loop import ExactLeaper
from hybridsim.integrators.contract import NEEDS_TAPE, Integrator
from hybridsim.integrators.taylor.method import TaylorStepper

_TIGHTEST = 1e-15  # what a series in doubles is asked for


@dataclass(frozen=True)
class Exact(Integrator):
    """Each linear mode in closed form, x(t) = Re(T exp(B t) c), its guards' zeros isolated with a bound.

    For modes that are linear in the states with constant, polynomial, exponential or sinusoidal forcing, and guards
    that are linear in states and forcing: whether a model is of this kind is read off its declaration, and one that is
    not is refused with what is in the way. B is block diagonal (see `hybridsim.engine.linear.modal`), so that
    defective, oscillatory and stiff modes are taken alike. A guard that is one undamped wave has its zeros in closed
    form. Each other is followed by lower bounds made of its Taylor polynomial and the largest remainder, so that no
    zero is jumped over, and its zeros are good to rounding. There is no step and no truncation: rtol and atol do not
    enter. A segment that holds something unusual (a monitor, an input, a question of rounding, time running backward)
    is taken by its Taylor series, which converges everywhere, to rounding of the states' nominal sizes: there atol
    enters.

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
    leaps: ClassVar[bool] = True

    def prepare(self, system: System) -> None:
        """The compiled mode loop; a model that is not piecewise linear is refused here."""
        refuse_nonlinear(system)
        compile_leaps(system, ExactLeaper)

    def leaper(self, system: System, tolerances: Tolerances, longest: float) -> ExactLeaper | None:
        """The compiled mode loop, which knows no steps: where these are bounded there is none."""
        return ExactLeaper(system, tolerances, longest) if math.isinf(tolerances.max_step) else None

    def start(
        self,
        flow: Flow,
        x0: np.ndarray,
        s_bound: float,
        tolerances: Tolerances,
        first_step: float | None,
        watch: Watch,
    ) -> Stepper:
        """Begin a smooth segment that holds something unusual."""
        tight = Tolerances(_TIGHTEST, 1e-3 * tolerances.atol, tolerances.max_step)
        return TaylorStepper(flow, x0, s_bound, tight, first_step)
