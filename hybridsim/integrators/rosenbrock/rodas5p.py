"""This module defines Steinebach's Rosenbrock method Rodas5P, for stiff modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.engine.run.stepping import Flow, Stepper, Watch
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.contract import NEEDS_TAPE, Integrator
from hybridsim.integrators.rosenbrock.method import RosenbrockStepper
from hybridsim.integrators.rosenbrock.rodas5p_coefficients import GAMMA, NODES, STAGES, A, C, D, H, M
from hybridsim.integrators.rosenbrock.step import RosenbrockTableau

TABLEAU = RosenbrockTableau(
    gamma=GAMMA, a=A, c=C, m=M, e=np.eye(STAGES)[-1], nodes=NODES, d=D, dense=H, order=5, error_order=5
)


@dataclass(frozen=True)
class Rodas5P(Integrator):
    """Steinebach's Rosenbrock method of order 5(4), L-stable, with its stages in one compiled kernel.

    A step solves eight linear systems with one matrix, without iteration and history. After an event it
    restarts with full order, while a multistep method begins at order one. The Jacobian and the derivative
    with respect to time are exact, from the model's expressions. The dense output has order 4; a step that
    contains an event is repeated up to it.

    When to choose it: stiff modes, including regularised friction laws, at tolerances of 1e-3 to 1e-8; below
    that `scipy-radau` or `cvode-bdf` take fewer steps.
    """

    name: ClassVar[str] = "rodas5p"
    title: ClassVar[str] = "compiled Rosenbrock method for stiff modes"
    order: ClassVar[str] = "5(4)"
    reference: ClassVar[str] = "Steinebach 2023, doi:10.1007/s10543-023-00967-x"
    when: ClassVar[str] = "stiff modes; it restarts at full order after an event"
    lacks: ClassVar[dict[str, str]] = {"functions": NEEDS_TAPE}

    @property
    def rounding(self) -> float:
        """Return the rounding error of a step: three times the root sum of squares over its stages."""
        return 2500.0

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
        return RosenbrockStepper(TABLEAU, flow, x0, s_bound, tolerances, first_step)
