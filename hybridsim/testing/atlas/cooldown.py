"""A common workaround: ignore all guards for a short time after each event, so that no guard fires twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.integrate

from hybridsim.engine.run.stepping import Flow, Stepper, Watch
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.scipy.native import NativeStepper
from hybridsim.integrators.scipy.solvers import ScipyRK45


@dataclass(frozen=True)
class CooldownRK45(ScipyRK45):
    """SciPy's RK45, restarted after each event, with all guards ignored for a short time.

    Parameters
    ----------
    cooldown : length of the cooldown, in the unit of t. Guards that become negative in this time are missed.

    When to use it: never; it shows the errors of the usual remedy for events that fire twice.
    Source: terminal events of heyoka have a cooldown (F. Biscani, D. Izzo, MNRAS 504 (2021) 2614,
    doi:10.1093/mnras/stab1032), which heyoka can also choose automatically.
    """

    cooldown: float = 1e-3

    name: ClassVar[str] = "scipy-rk45-cooldown"
    title: ClassVar[str] = "SciPy RK45, which ignores guards for a while after each event"

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
        return _Blind(self.cooldown, flow, x0, s_bound, tolerances, first_step, watch)


class _Blind(NativeStepper):
    def __init__(self, cooldown: float, flow: Flow, x0: np.ndarray, s_bound: float, *rest: Any) -> None:
        self.cooldown = cooldown
        super().__init__(scipy.integrate.RK45, False, flow, x0, s_bound, *rest)

    def _guard(self, number: int) -> Callable[[float, np.ndarray], float]:
        return self._blinded(super()._guard(number))

    def _monitor(self, number: int) -> Callable[[float, np.ndarray], float]:
        return self._blinded(super()._monitor(number))

    def _blinded(self, event: Any) -> Callable[[float, np.ndarray], float]:
        """Return an event function that keeps one sign during the cooldown, so that the guard cannot fire."""
        far = 1.0 if event.direction > 0 else -1.0

        def blinded(s: float, x: np.ndarray) -> float:
            return far if abs(s) < self.cooldown else float(event(s, x))

        blinded.terminal, blinded.direction = event.terminal, event.direction or -1.0  # type: ignore[attr-defined]  # SciPy's
        return blinded
