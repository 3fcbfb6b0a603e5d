"""Dormand and Prince's method of order 8 on the compiled engine."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from hybridsim.engine.leaper import compile_leaps
from hybridsim.engine.rk_leaper import RungeKuttaLeaper
from hybridsim.engine.rk_step import Tableau
from hybridsim.engine.stepping import Flow, Stepper, Tolerances, Watch
from hybridsim.engine.system import System
from hybridsim.integrators.base import Integrator
from hybridsim.integrators.dop853_coefficients import E3, E5, A, B, C
from hybridsim.integrators.runge_kutta import RungeKuttaStepper

TABLEAU = Tableau(c=C, a=A, b=B, e=E5, e_low=E3, order=8, error_order=8)
_leaper = partial(RungeKuttaLeaper, tableau=TABLEAU)


@dataclass(frozen=True)
class Dop853(Integrator):
    """Dormand and Prince's method of order 8(5,3), its stages in one compiled kernel, on our event location.

    The same method and step control as `scipy-dop853` at a fraction of the cost of a step; the dense output is the
    two-point Hermite polynomial of degree 7 on Taylor coefficients.

    When to choose it: the default for smooth modes that are not stiff, from 1e-4 to 1e-13.
    """

    name: ClassVar[str] = "dop853"
    title: ClassVar[str] = "compiled DOP853 with events located on its dense output"
    order: ClassVar[str] = "8(5,3)"
    reference: ClassVar[str] = "Hairer, Norsett and Wanner 1993, doi:10.1007/978-3-540-78862-1, section II.10"
    when: ClassVar[str] = "the default: smooth modes, not stiff"
    lacks: ClassVar[dict[str, str]] = {"stiff": "explicit: its step is bound by the fastest rate"}

    leaps: ClassVar[bool] = True

    def prepare(self, system: System) -> None:
        """The compiled mode loop."""
        if not system.has_corners:
            compile_leaps(system, _leaper)

    def leaper(self, system: System, tolerances: Tolerances, longest: float) -> RungeKuttaLeaper | None:
        """The compiled mode loop, for models without corners: it looks at guards through their series."""
        return None if system.has_corners else _leaper(system, tolerances, longest)

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
        return RungeKuttaStepper(TABLEAU, flow, x0, s_bound, tolerances, first_step)
