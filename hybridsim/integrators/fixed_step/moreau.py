"""Moreau-Jean time stepping: no event is located, the forces of a step solve the laws at its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hybridsim.engine.events.jumps.impact import restitution_in_words
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.system.system import System
from hybridsim.errors import UsageError
from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.fixed_step.moreau_impacts import UNILATERAL
from hybridsim.integrators.fixed_step.moreau_kernels import moreau_step, moreau_steps, room_for
from hybridsim.integrators.fixed_step.moreau_loads import refuse_loads_of_friction
from hybridsim.integrators.fixed_step.run import FixedStepRun, surface_table
from hybridsim.integrators.fixed_step.step_length import fixed_step_length, refuse_longer
from hybridsim.model.parts.impact import ROUNDING

_HALVINGS = 16  # of a step in which a declared guard or monitor crosses zero


@dataclass(frozen=True)
class Moreau(Integrator):
    """Moreau-Jean time stepping: a fixed step, implicit in the forces of contacts, that knows no events.

        X = x + h (theta a(t + h, X) + (1 - theta) a(t, x)) + h sum_k B_k f_k,   f_k in the law of contact k at v_k(X)

    a are the rates without the forces f, which enter linearly. Each force is what stops its contact over the step, as
    far as the limit of stick goes, else that of slip at the new velocity; together they are found by projected
    Gauss-Seidel sweeps, inside Newton's iteration for X. A step may hold any number of stops, slips and reversals: none
    is missed, each is late by up to a step. A contact that sticks has its velocity exactly zero.

    Of a gap g with the rate u and the restitution e (`hybridsim.Impact`) the force p is an impulse over the step,

        0 <= p,   u(X) >= e max(-u(x), 0),   one of the two with equality,   where g is closed or g + u h/2 <= 0 at x

    and friction that it loads has limits that grow with it. A gap is `closed`, it and its rate exactly zero, where it
    is pushed and does not rebound; bounces end there once one is over within a step. Until then a gap may be negative
    by up to a step's way, and bounces, which leave the mode as it is, are no events.

    Parameters
    ----------
    steps_per_period : steps in one period of the forcing (1200).
    period : that period T, if not the forcing's own.
    step : the step itself, instead of T/steps_per_period.
    theta : 1/2 keeps the energy of a free vibration, 1 damps it.
    tolerance : of the forces and of the new state, relative; steps that do not get there are counted in a warning.
    iterations : of Newton's method in a step at most.

    When to choose it: many contacts, accumulations of events, and as a route to the answer that shares no decision with
    those that locate events. Error of first order in the step: in the states, and where velocities jump in their mean
    over time (L1). General automata, resets and monitors as in other fixed-step methods. Friction and rebound together
    may gain energy by Newton's law (Kane's paradox), which methods that locate impacts reduce and this one does not.
    Source: M. Jean, Comput. Methods Appl. Mech. Engrg. 177 (1999) 235, doi:10.1016/S0045-7825(98)00383-1; V. Acary and
    B. Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, doi:10.1007/978-3-540-75392-6.
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

    steps_per_period: float = 1200.0
    period: float | None = None
    step: float | None = None
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
                raise UsageError(f"{self.name}: {option} is {value!r}", remedy=remedy)

    def run(self, system: System, task: Task, progress: Callable[[float], None] | None = None) -> Trajectory:
        """Run a task with fixed steps."""
        step = fixed_step_length(system, self.step, self.period, self.steps_per_period, self.name)
        refuse_longer(step, task.tolerances.max_step, self.name)
        refuse_loads_of_friction(system.model, self.name)
        march = MoreauMarch(system, step, (self.theta, self.tolerance, self.iterations), task.x0.copy())
        return FixedStepRun(system, task, march, progress).run()


class MoreauMarch:
    """The kernels of one run; see `hybridsim.integrators.fixed_step.run.March`."""

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
        last = ("stepped", "restitutions") if has_impacts else ("flow", "flow")  # these are not called
        names = ("flow", "guards", "quantities", "surfaces", "project", "monitors", *last)
        self._functions = tuple(system.address(n) for n in names)
        evaluated = np.zeros((len(table), system.n))
        for k in np.flatnonzero(self._table[:, UNILATERAL]):
            c = int(table[k, 0])
            evaluated[k, [*system.pins.get(c, ()), *system.projected.get(c, ())]] = 1
        nominal = np.array([s.nominal or 0.0 for s in system.model.states])
        sizes = np.where(nominal > 0.0, nominal, np.where(x0 != 0.0, np.abs(x0), 1.0))
        self._room = room_for(
            system.n, len(table), len(system.automata), len(system.quantities), system.guard_count,
            len(system.monitor_names), sizes, evaluated,
        )  # fmt: skip

    def run(
        self,
        watched: np.ndarray,
        bound: float,
        p: np.ndarray,
        start: tuple[np.ndarray, np.ndarray],
        fresh: np.ndarray,
        rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    ) -> tuple[int, int]:
        """Steps up to the bound, or to what needs the caller."""
        x, z = start
        count, why = moreau_steps(
            self._functions, self._settings, self.step, self._table, watched, bound, p, x.copy(), z.copy(), fresh,
            *rows, self._room, np.empty(len(x)), self.counts,
        )  # fmt: skip
        return count, why

    def trial(self, s: float, tau: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """The state after one step of length tau."""
        out = np.empty(len(x))
        moreau_step(
            self._functions, self._settings, self._table, s, tau, x, p, z.copy(), out, self._room, self.counts
        )
        return out

    def refused(self) -> str:
        """The gap of a step whose restitution is beyond [0, 1], with its value."""
        room, system = self._room, self.system
        for k in np.flatnonzero(room.active):
            e = float(room.restitution[k])
            if not -ROUNDING <= e <= 1.0 + ROUNDING:
                name = system.automata[self._table[k, 0]].name
                return restitution_in_words(name, e, float(room.approach[system.n + k]))
        return ""

    def warnings(self) -> list[str]:
        """Steps whose forces or states did not settle."""
        failed = int(self.counts[2])
        if not failed:
            return []
        _, tolerance, iterations, _ = self._settings
        return [
            f"{failed} steps did not converge to {tolerance:g} in {iterations} iterations: use a smaller step"
        ]
