"""This module defines the published fixed-step methods: RK4 with bisection, and RK4 with a sign function."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.integrators.fixed_step.method import FixedStepMethod
from hybridsim.integrators.fixed_step.rk4_march import FixedStep, Rk4March
from hybridsim.integrators.fixed_step.step_code import SIGN, ZONE

_PAPER = "He et al. 2026, doi:10.3390/sym18010057"
_FIXED = {
    "adaptive": "its step is fixed (options step and steps_per_period)",
    "multiple-roots": "it compares signs at both ends of a step, and misses two changes within a step",
    "stiff": "it is explicit and has a fixed step",
    "backward": "it runs forward in time only: its rule near zero velocity does not determine the past",
    "sliding": "its rule near zero velocity applies to friction only, not to switching surfaces",
    "impacts": "its rule applies to friction forces, not to impulses",
    "functions": "it is a method for contacts, which need rates that are declared as expressions",
}


@dataclass(frozen=True)
class Rk4Dichotomy(FixedStepMethod):
    """The published method: classic RK4 with bisection of steps in which a velocity changes its sign.

    The friction force follows Eq. 4 of the paper: outside the zero-velocity interval it is the slip force;
    inside it the force that holds the body, up to its limit. Bisection ends when |v| <= eps_v or after 16
    halvings, and the run continues from there. Details that the paper leaves open are options; the defaults
    are its literal reading.

    Parameters
    ----------
    steps_per_period : number of steps in one period of the forcing, h0 in the paper (1200 there).
    period : the period T, if it is not the forcing's period.
    step : step size, instead of T/h0.
    eps_v : half width of the zero-velocity interval (8e-4 m/s), in the unit of the relative velocity.
    max_bisections : largest number of halvings (16).
    stick_velocity : "kept" follows Eq. 4, so that a sticking body creeps at up to eps_v; "zero" sets its
        velocity to zero.
    release : "step": release at the next step; "located": release located by bisection.
    friction : "step": the force is chosen at the start of a step; "stage": at every stage.
    after_event : "full-step" from the located time on; "rest-of-step" first, back to the grid.

    When to choose it: to compare with the published figures. The accuracy of its event times is eps_v, for
    any step. Source: He, Pan, Zhang, Mei, Zhang, Symmetry 18 (2026) 57, doi:10.3390/sym18010057.
    """

    name: ClassVar[str] = "rk4-dichotomy"
    title: ClassVar[str] = "the published RK4 with bisection to the zero-velocity interval"
    order: ClassVar[str] = "4 between events, 1 in eps_v at them"
    reference: ClassVar[str] = _PAPER
    when: ClassVar[str] = "to compare with the published figures"
    lacks: ClassVar[dict[str, str]] = {
        **_FIXED,
        "exact-stick": "with stick_velocity='kept' a sticking body creeps at up to eps_v",
    }

    eps_v: float = 8e-4
    max_bisections: int = 16
    stick_velocity: Literal["kept", "zero"] = "kept"
    release: Literal["step", "located"] = "step"
    friction: Literal["step", "stage"] = "step"
    after_event: Literal["full-step", "rest-of-step"] = "full-step"

    def __post_init__(self) -> None:
        if not (math.isfinite(self.eps_v) and self.eps_v > 0.0):
            raise UsageError(f"{self.name}: `eps_v` cannot be {self.eps_v!r}", remedy="use a positive number")
        if not (isinstance(self.max_bisections, int) and self.max_bisections >= 1):
            raise UsageError(
                f"{self.name}: `max_bisections` cannot be {self.max_bisections!r}",
                remedy="use a positive whole number",
            )

    def march(self, system: System, task: Task, step: float) -> Rk4March:
        """Return the kernels of the method for one run."""
        settings = FixedStep(
            step,
            ZONE,
            self.friction == "stage",
            self.stick_velocity == "zero",
            self.release == "located",
            self.after_event == "rest-of-step",
            self.eps_v,
            self.max_bisections,
        )
        return Rk4March(system, settings)


@dataclass(frozen=True)
class Rk4Sign(FixedStepMethod):
    """Classic RK4 with the force mu N sgn(v) and without stick, for comparison with the published method.

    Parameters
    ----------
    steps_per_period : number of steps in one period of the forcing, h0 in the paper (1200 there).
    period : the period T, if it is not the forcing's period.
    step : step size, instead of T/h0.
    friction : "stage": the sign is evaluated at every stage; "step": at the start of each step.

    When to choose it: only to show the cost of chattering through a stick. Its modes show the chattering.
    Source: He, Pan, Zhang, Mei, Zhang, Symmetry 18 (2026) 57, doi:10.3390/sym18010057, Eq. 2.
    """

    name: ClassVar[str] = "rk4-sign"
    title: ClassVar[str] = "RK4 with the sign of the velocity and no stick"
    order: ClassVar[str] = "4 between events, 1 through them"
    reference: ClassVar[str] = _PAPER
    when: ClassVar[str] = "to show the effect of not modelling stick"
    lacks: ClassVar[dict[str, str]] = {
        **_FIXED,
        "exact-stick": "it does not model stick: the velocity chatters around zero",
    }

    friction: Literal["step", "stage"] = "stage"

    def march(self, system: System, task: Task, step: float) -> Rk4March:
        """Return the kernels of the method for one run."""
        settings = FixedStep(step, SIGN, self.friction == "stage", False, False, False, 0.0, 16)
        return Rk4March(system, settings)
