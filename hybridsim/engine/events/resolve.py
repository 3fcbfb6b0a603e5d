"""Resolve an event: repeat transitions, resets and joint choices until all modes are admissible."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from hybridsim.engine.events.choice.cancelled_guards import cancelled_by_surfaces
from hybridsim.engine.events.choice.cluster_choice import ClusterChoice
from hybridsim.engine.events.choice.guards_of_one_target import guards_taken_together
from hybridsim.engine.events.choice.surface_intersection import message_on_cascade
from hybridsim.engine.events.choice.verdict import LEAVES, UNDECIDED, side_after
from hybridsim.engine.events.corner_sides import message_on_numbers, take_corners
from hybridsim.engine.events.fatal_guards import message_of_leaving, message_of_located
from hybridsim.engine.events.first_modes import as_read_by_conditions, certainly_leaving
from hybridsim.engine.events.jumps.impact import strike
from hybridsim.engine.events.jumps.resets import combine_resets
from hybridsim.engine.events.outcome import Change, Outcome, Situation
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.system.system import System

# A legitimate cascade changes each component a few times. A model that needs more than this many rounds for each of
# its modes is in an endless cycle.
_ROUNDS_PER_MODE = 8


class EventResolution(ClusterChoice):
    """The resolution of one event.

    Parameters
    ----------
    before : the modes (C,) at the event; -1 for a component without a mode yet.
    scope : the components decided here; a method with its own rules for surfaces leaves those out.
    inputs : the run-time vector before the event, read by the first conditions and resets.
    """

    def __init__(
        self,
        system: System,
        at: Situation,
        before: np.ndarray,
        forward: bool,
        scope: Iterable[int] | None = None,
        inputs: np.ndarray | None = None,
    ) -> None:
        super().__init__(system, at, before, forward, scope)
        self.inputs = inputs
        self.rounds = 0
        self.most_rounds = _ROUNDS_PER_MODE * (1 + sum(len(a.modes) for a in system.automata))

    # -- the rounds -----------------------------------------------------------------------------------------

    def run(self, fired: Iterable[int] | Mapping[int, int], resets: Iterable[tuple[object, ...]]) -> Outcome:
        """Resolve the event from the guards located at zero, in the order of their times, and from the due resets."""
        located = {int(g) for g in fired}
        lost = message_of_located(self.system, self.at.z, located)
        self.rank = dict(fired) if isinstance(fired, Mapping) else {int(g): k for k, g in enumerate(fired)}
        self.locate(located)
        surfaces = self._surface_components()
        open_ = self._past_corners({c for c, _, _ in self.fired_guards()})
        at_surfaces, leaving = self._at_surfaces(open_ & surfaces), open_ - surfaces
        if leaving and at_surfaces:
            leaving -= cancelled_by_surfaces(self, leaving, at_surfaces)
        failure = self._transitions(leaving, list(resets)) or self._first_modes(surfaces)
        if failure:
            return self._stop(*failure)
        open_ = at_surfaces
        if surfaces and (self.jumped or (self.at.z < 0).any()):
            self.take_sides(open_)
        while self._begins_round():
            failure = strike(self, open_) or self.choose_jointly(open_)
            if failure:
                return self._stop(*(("inconsistent", lost) if lost else failure))
            take_corners(self)
            verdicts = self.guard_verdicts(sorted(self.scope))
            leaving = {c for c, v in verdicts.items() if v == LEAVES}
            for c, v in verdicts.items():
                if v == UNDECIDED:
                    self._note_undecided(c)
            if not leaving:
                several = message_on_numbers(self) if self.forward else ""
                return self._stop("nonunique", several) if several else self._done()
            fatal = message_of_leaving(self.system, self.at.z, leaving, self.sides)
            if fatal:
                return self._stop("inconsistent", fatal)
            failure = self._transitions(leaving - surfaces - set(self.system.led), [])
            failure = failure or self._first_modes(surfaces)
            if failure:
                return self._stop(*failure)
            open_ = leaving & surfaces
            if surfaces and self.jumped:
                self.take_sides(open_)
        return self._stop(*self._cascade())

    def _begins_round(self) -> bool:
        """Count a round of transitions or choices; return False if one instant has too many rounds."""
        self.rounds += 1
        return self.rounds <= self.most_rounds

    def _cascade(self) -> tuple[str, str]:
        """Return the status and the message for transitions that repeat without end."""
        names = ", ".join(
            f"{a.name}: {a.modes[m]}" for a, m in zip(self.system.automata, self.at.z, strict=True)
        )
        guards = ", ".join(
            sorted({f"{self.system.automata[c.component].name}.{c.guard}" for c in self.changes[-8:]})
        )
        return (
            "cascade",
            f"transitions repeat without time advancing, {self.most_rounds} rounds (modes {names}); "
            f"guards that fire: {guards}{message_on_cascade(self)}",
        )

    def _past_corners(self, open_: set[int]) -> set[int]:
        """Update the active branches of corners such as abs; return the other components whose guards still fire.

        A zero that was located by a series past a corner, where the guard turns back, does not fire.
        """
        others = open_.difference(self.system.led)
        if not take_corners(self):
            return others
        staying = set()
        for c in others - self._surface_components():
            if self.verdict_on_guards(self.at.z, [c], continuous=False) != LEAVES:
                staying.add(c)
                self.fired[list(self.system.automata[c].guards[self.at.z[c]])] = False
        return others - staying

    def _first_modes(self, surfaces: set[int]) -> tuple[str, str] | None:
        """Update corners such as abs after a change of state, then leave the modes that certainly end at this instant.

        Without this, a contact would be decided in a mode of an automaton that lasts for zero time.
        """
        take_corners(self)
        if not surfaces or not (self.jumped or (self.at.z < 0).any()):
            return None
        while leaving := certainly_leaving(self):
            failure = self._transitions(leaving, []) if self._begins_round() else self._cascade()
            if failure:
                return failure
            take_corners(self)
        return None

    def _surface_components(self) -> set[int]:
        return {c for c, a in enumerate(self.system.automata) if a.has_surface and c in self.scope}

    def _at_surfaces(self, components: set[int]) -> set[int]:
        """Return the components whose surfaces are zero."""
        fired = {(c, j) for c, j, _ in self.fired_guards()}
        holds = [self.system.automata[c].hold for c in range(len(self.at.z))]
        return {
            c for c in components if self.at.z[c] == holds[c] or (c, 0) in fired
        }  # guard 0 of a mode is that of the surface

    def _note_undecided(self, component: int) -> None:
        automaton = self.system.automata[component]
        if automaton.is_corner:
            return  # both sides are equally good
        mode = automaton.modes[self.at.z[component]]
        self.warnings.append(f"undecided at rounding: {automaton.name} keeps mode {mode}")

    # -- transitions by declared choices --------------------------------------------------------------------

    def _transitions(self, components: set[int], resets: list[tuple[object, ...]]) -> tuple[str, str] | None:
        """Take the declared transitions of some components. The resets read the state before the transitions."""
        at, system = self.at, self.system
        x_plus, p_plus, z_plus = at.x.copy(), at.p.copy(), at.z.copy()
        x_error = at.x_error.copy()
        taken: list[tuple[int, str, int, int]] = []
        read_from = as_read_by_conditions(system, at, self.jumped)
        if self.inputs is not None:
            read_from, self.inputs = replace(read_from, p=self.inputs), None
        for c in sorted(components, key=lambda c: (self._place(c), c)):
            automaton, mode = system.automata[c], int(at.z[c])
            guards = automaton.guards[mode]
            leaving = [j for j, g in enumerate(guards) if self.fired[g] or self.sides[g] < 0]
            leaving.sort(key=lambda j: (self.rank.get(guards[j], len(self.rank)), j))
            choices, failure = guards_taken_together(self, read_from, c, leaving)
            if failure:
                return failure
            for j, number in choices:
                z_plus[c] = automaton.targets[mode][j][number]
                resets.append(("choice", c, mode, j, number))
                taken.append((c, automaton.guard_names[mode][j], mode, int(z_plus[c])))
            self.fired[list(guards)] = False
            for g in guards:  # modes share guard numbers, and the guards of the next mode were not located
                self.rank.pop(g, None)
        if resets:
            self.fired[system.is_corner[system.owner]] = False
        clash = combine_resets(system, read_from, resets, x_plus, p_plus, x_error)
        if clash:
            return "inconsistent", clash
        at.is_put = at.is_put or not np.array_equal(x_plus, at.x)
        self.changes += [Change(c, n, m, t, at.x, x_plus) for c, n, m, t in taken]
        self.jumped = self.jumped or bool(taken) or bool(resets)
        at.x, at.p, at.z, at.x_error = x_plus, p_plus, z_plus, x_error
        return None

    def _place(self, component: int) -> int:
        """Return the rank of a component by the time at which its first guard became zero."""
        numbers = self.system.automata[component].guards[self.at.z[component]]
        return min((self.rank.get(g, len(self.rank)) for g in numbers), default=len(self.rank))

    # -- results --------------------------------------------------------------------------------------------

    def _done(self) -> Outcome:
        at = self.at
        series = self.series_of(np.maximum(at.z, 0), at.x)
        found = [side_after(v, e, 0) for v, e in zip(series.monitors, series.monitor_bounds, strict=True)]
        monitor_sides = np.array([f[0] for f in found], dtype=np.int64)
        monitor_orders = np.array([f[1] for f in found], dtype=np.int64)
        if not self.forward:
            monitor_sides = np.where(monitor_orders % 2 == 1, -monitor_sides, monitor_sides)
        monitors = monitor_sides, np.where(monitor_orders > ORDER, 0, monitor_orders)
        monitor_floors = np.where(monitor_orders > 0, series.monitor_bounds[:, 0], 0.0)
        continuous = not self.is_kinked and self.is_continuous(at.z, range(len(self.system.automata)))
        return self._outcome(monitors, self.floors, monitor_floors, continuous, "", "")

    def _stop(self, status: str, message: str) -> Outcome:
        none = np.zeros(len(self.system.monitor_names), dtype=np.int64)
        floors = np.zeros(self.system.guard_count)
        return self._outcome((none, none), floors, np.zeros(len(none)), False, status, message)

    def _outcome(
        self,
        monitors: tuple[np.ndarray, np.ndarray],
        floors: np.ndarray,
        monitor_floors: np.ndarray,
        continuous: bool,
        status: str,
        message: str,
    ) -> Outcome:
        """Return the outcome of the event: the present state, with the signs of guards and monitors."""
        at = self.at
        return Outcome(
            at.x, at.p, at.z, self.sides, self.orders, *monitors, at.x_error, floors, monitor_floors,
            self.changes, continuous, status, message, self.warnings,
        )  # fmt: skip
