"""This module defines Moreau-Jean time stepping, which does not locate events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.engine.events.jumps.impact import message_on_restitution
from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.integrators.fixed_step.march import March
from hybridsim.integrators.fixed_step.method import FixedStepMethod
from hybridsim.integrators.fixed_step.moreau_impacts import UNILATERAL
from hybridsim.integrators.fixed_step.moreau_kernels import moreau_step, moreau_steps, scratch_for
from hybridsim.integrators.fixed_step.moreau_loads import refuse_loads_of_friction
from hybridsim.integrators.fixed_step.surface_table import surface_table
from hybridsim.model.parts.impact import ROUNDING

_HALVINGS = 16  # halvings of a step in which a declared guard or monitor crosses zero


@dataclass(frozen=True)
class Moreau(FixedStepMethod):
    """Moreau-Jean time stepping: a fixed step, implicit in the contact forces, without located events.

            X = x + h (theta a(t + h, X) + (1 - theta) a(t, x)) + h sum_k B_k f_k,   f_k in the law of contact
            k at v_k(X)

    a are the rates without the forces f, which enter linearly. Each force stops its contact over the step if
    the limit of stick allows it; otherwise it is the slip force at the new velocity. Projected Gauss-Seidel
    sweeps find all forces together, inside Newton's iteration for X. A step may contain any number of stops,
    slips and reversals. None is missed, and each is late by up to a step. A contact that sticks has a
    velocity of exactly zero.

    For a gap g with the rate u and the restitution e (`hybridsim.Impact`) the force p is an impulse over the
    step,

            0 <= p,   u(X) >= e max(-u(x), 0),   one of the two with equality,   if g is closed or g + u h/2
            <= 0 at x

    and limits of friction that it loads grow with it. A gap is `closed`, with gap and rate exactly zero, if
    it is pushed and does not rebound; bounces end there once one bounce is over within a step. Until then a
    gap may be negative by up to the distance travelled in a step. Bounces leave the mode unchanged and are
    not events.

    Parameters
    ----------
    steps_per_period : number of steps in one period of the forcing (1200).
    period : the period T, if it is not the forcing's period.
    step : step size, instead of T/steps_per_period.
    theta : 1/2 conserves the energy of a free vibration, 1 damps it.
    tolerance : relative tolerance of the forces and of the new state; steps that miss it are counted in a
        warning.
    iterations : largest number of Newton iterations in a step.

    When to choose it: many contacts, accumulations of events, and as an independent check of methods that
    locate events, since it shares no decision with them. The error is of first order in the step: in the
    states, and for velocities that jump in their mean over time (L1). General automata, resets and monitors
    work as in other fixed-step methods. Friction and rebound together may gain energy by Newton's law (Kane's
    paradox). Methods that locate impacts reduce this gain, and this one does not. Source: M. Jean, Comput.
    Methods Appl. Mech. Engrg. 177 (1999) 235, doi:10.1016/S0045-7825(98)00383-1; V. Acary and B. Brogliato,
    Numerical Methods for Nonsmooth Dynamical Systems, 2008, doi:10.1007/978-3-540-75392-6.
    """

    name: ClassVar[str] = "moreau"
    title: ClassVar[str] = (
        "Moreau-Jean time stepping: fixed step, forces by complementarity, events not located"
    )
    order: ClassVar[str] = "1"
    reference: ClassVar[str] = "Jean 1999, doi:10.1016/S0045-7825(98)00383-1"
    when: ClassVar[str] = "many contacts; accumulations; a second opinion"
    lacks: ClassVar[dict[str, str]] = {
        "adaptive": "its step is fixed (options step and steps_per_period)",
        "located": "events are not located: a stop, a reversal or a contact gets the time at which its step begins, "
        "a reversal appears as one step of stick, and a bounce is not recorded",
        "stiff": "with stiff rates its Newton iteration converges only if the step resolves the fastest rate",
        "multiple-roots": "it compares signs at both ends of a step, and misses two changes within a step",
        "backward": "it runs forward in time only: backward, the instant at which stick began is not determined",
        "sliding": "it solves for the forces of contacts, and does not support sliding along a switching surface",
        "functions": "it separates the forces of contacts from the rates, which have to be expressions",
    }

    theta: float = 0.5
    tolerance: float = 1e-12
    iterations: int = 50

    def __post_init__(self) -> None:
        for option, value, good, remedy in (
            ("theta", self.theta, 0.5 <= self.theta <= 1.0, "use a number from 0.5 to 1"),
            (
                "tolerance",
                self.tolerance,
                0.0 < self.tolerance < 1.0,
                "use a number between 0 and 1, such as 1e-12",
            ),
            ("iterations", self.iterations, self.iterations >= 2, "use a whole number of at least 2"),
        ):
            if not good:
                raise UsageError(f"{self.name}: `{option}` cannot be {value!r}", remedy=remedy)

    def march(self, system: System, task: Task, step: float) -> MoreauMarch:
        """Return the kernels of the method for one run."""
        refuse_loads_of_friction(system.model, self.name)
        return MoreauMarch(system, step, (self.theta, self.tolerance, self.iterations), task.x0.copy())


class MoreauMarch(March):
    """The kernels of Moreau-Jean time stepping for one run."""

    halvings, pinned, has_sides_only = _HALVINGS, True, False

    def __init__(
        self, system: System, step: float, settings: tuple[float, float, int], x0: np.ndarray
    ) -> None:
        self.step, self.system = step, system
        self.counts = np.zeros(3, dtype=np.int64)
        table, has_impacts = surface_table(system), bool(system.is_unilateral.any())
        unknowns = {c.name: c.surface.unknown for c in system.model.all_components() if c.surface}
        forces = [system.quantities.index(unknowns[system.automata[c].name]) for c in table[:, 0].tolist()]
        self._settings = (*settings, has_impacts)
        columns = [forces, system.is_unilateral[table[:, 0]]]
        self._table = np.concatenate([table, np.array(columns, dtype=np.int64).T], axis=1)
        last = ("stepped", "restitutions") if has_impacts else ("flow", "flow")  # placeholders, never called
        names = ("flow", "guards", "quantities", "surfaces", "project", "monitors", *last)
        self._functions = tuple(system.address(n) for n in names)
        evaluated = np.zeros((len(table), system.n))
        for k in np.flatnonzero(self._table[:, UNILATERAL]):
            c = int(table[k, 0])
            evaluated[k, [*system.pins.get(c, ()), *system.projected.get(c, ())]] = 1
        nominal = np.array([s.nominal or 0.0 for s in system.model.states])
        sizes = np.where(nominal > 0.0, nominal, np.where(x0 != 0.0, np.abs(x0), 1.0))
        self._scratch = scratch_for(system, len(table), sizes, evaluated)

    def run(
        self,
        guard_numbers: np.ndarray,
        bound: float,
        p: np.ndarray,
        start: tuple[np.ndarray, np.ndarray],
        fresh: np.ndarray,
        rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    ) -> tuple[int, int]:
        """Take steps up to the bound, or until an event needs the Python code."""
        x, z = start
        count, why = moreau_steps(
            self._functions, self._settings, self.step, self._table, guard_numbers, bound, p, x.copy(), z.copy(), fresh,
            *rows, self._scratch, np.empty(len(x)), self.counts,
        )  # fmt: skip
        return count, why

    def trial(self, s: float, tau: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the state after one step of length `tau`."""
        out = np.empty(len(x))
        moreau_step(
            self._functions, self._settings, self._table, s, tau, x, p, z.copy(), out, self._scratch, self.counts
        )  # fmt: skip
        return out

    def refused(self) -> str:
        """Return a message about the gap whose restitution is outside [0, 1]."""
        scratch, system = self._scratch, self.system
        for k in np.flatnonzero(scratch.active):
            e = float(scratch.restitution[k])
            if not -ROUNDING <= e <= 1.0 + ROUNDING:
                name = system.automata[self._table[k, 0]].name
                return message_on_restitution(name, e, float(scratch.approach[system.n + k]))
        return ""

    def warnings(self) -> list[str]:
        """Return a warning that counts the steps whose forces or states did not converge."""
        failed = int(self.counts[2])
        if not failed:
            return []
        _, tolerance, iterations, _ = self._settings
        return [
            f"{failed} steps did not converge to {tolerance:g} in {iterations} iterations: use a smaller step"
        ]
