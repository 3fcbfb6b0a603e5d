"""Resolve an event: repeat transitions, resets and joint decisions until every mode is admissible just after it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from hybridsim.engine.events.choice.cancelled_guards import cancelled_by_surfaces
from hybridsim.engine.events.choice.candidates import all_verdicts, verdicts_on
from hybridsim.engine.events.choice.guards_of_one_target import guards_taken_together
from hybridsim.engine.events.choice.releases import Releases
from hybridsim.engine.events.choice.surface_intersection import (
    can_hold,
    is_one_motion,
    keeps_nothing,
    message_on_cascade,
    on_its_side,
    refused,
    rivals,
)
from hybridsim.engine.events.choice.uniqueness import other_outcomes, with_cause
from hybridsim.engine.events.choice.verdict import (
    LEAVES,
    NONE,
    NONUNIQUE,
    UNDECIDED,
    choose,
    decree_orders,
    guard_verdict,
    joint_candidates,
    side_after,
)
from hybridsim.engine.events.corner_sides import sides_along, take_corners
from hybridsim.engine.events.corner_start import cross, past_zero, vanishing_surfaces
from hybridsim.engine.events.diagnosis import rates_without_value
from hybridsim.engine.events.fatal_guards import message_of_leaving, message_of_located
from hybridsim.engine.events.first_modes import as_read_by_conditions, certainly_leaving
from hybridsim.engine.events.jumps.impact import strike
from hybridsim.engine.events.jumps.resets import combine_resets
from hybridsim.engine.events.outcome import Change, Outcome, Situation
from hybridsim.engine.events.rest_at_stops import together, with_tied
from hybridsim.engine.series.bounded import ORDER, UNIT
from hybridsim.engine.series.short_series import Series
from hybridsim.engine.system.system import System

# A legitimate cascade changes each component a few times. A model that needs more than this many rounds for each of
# its modes is in an endless cycle.
_ROUNDS_PER_MODE = 8
_SEVERAL_MOTIONS = "several motions are admissible"
_MAX_CANDIDATES = 3**8  # a cluster of more components needs a complementarity solver, not enumeration


class EventResolution:
    """The resolution of one event."""

    is_thorough = False  # whether to judge all candidates, even if the choice does not need them

    def __init__(
        self,
        system: System,
        at: Situation,
        before: np.ndarray,
        forward: bool,
        scope: Iterable[int] | None = None,
        inputs: np.ndarray | None = None,
    ) -> None:
        self.system = system
        # run-time vector before the event, read by the first conditions and resets
        self.inputs = inputs
        # components decided here; a method with its own rules for surfaces leaves those out
        self.scope = set(range(len(system.automata))) if scope is None else set(scope)
        self.at = at
        self.forward = forward
        self.fired = np.zeros(system.guard_count, dtype=np.bool_)
        self.on_surface = np.zeros(len(system.automata), dtype=np.bool_)
        self.changes: list[Change] = []
        self.warnings: list[str] = []
        self.jumped = False  # whether a reset or an unknown made the flow jump
        self.rounds = 0
        self.most_rounds = _ROUNDS_PER_MODE * (1 + sum(len(a.modes) for a in system.automata))
        self.is_kinked = False  # whether a corner changed its side: the flow is continuous, its slope is not
        # position of each guard in the order in which they reached zero
        self.rank: dict[int, int] = {}
        self.releases = Releases(system, before)
        self.sides = np.ones(system.guard_count, dtype=np.int64)
        self.orders = np.zeros(system.guard_count, dtype=np.int64)
        # Taylor series by modes, and the arrays at which they were computed; those are replaced, never modified
        self.series: dict[bytes, Series] = {}
        self.behind: tuple[object, ...] = (None,) * 4

    # -- the rounds -----------------------------------------------------------------------------------------

    def run(self, fired: Iterable[int] | Mapping[int, int], resets: Iterable[tuple[object, ...]]) -> Outcome:
        """Resolve the event with these guards located at zero, in order of time, and these resets that are due."""
        located = {int(g) for g in fired}
        lost = message_of_located(self.system, self.at.z, located)
        self.rank = dict(fired) if isinstance(fired, Mapping) else {int(g): k for k, g in enumerate(fired)}
        self.fired[list(located)] = True
        self.releases.locate(located)
        surfaces = self._surface_components()
        open_ = self._past_corners({c for c, _, _ in self._fired_guards()})
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
            verdicts = self._guard_verdicts()
            leaving = {c for c, v in verdicts.items() if v == LEAVES}
            for c, v in verdicts.items():
                if v == UNDECIDED:
                    self._note_undecided(c)
            if not leaving:
                return self._done()
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
        """Count a round of transitions or decisions. Return False if the limit at one instant is exceeded."""
        self.rounds += 1
        return self.rounds <= self.most_rounds

    def _cascade(self) -> tuple[str, str]:
        """Return status and message for transitions that repeat without end."""
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
        """Set corners to their sides. Return the other components whose guards still fire after this change.

        A zero that was located by a series past a corner, where the guard turns back, does not fire.
        """
        others = open_.difference(self.system.led)
        if not take_corners(self):
            return others
        decreed = self._decreed(self.at.z, continuous=False)
        staying = set()
        for c in others - self._surface_components():
            if self._guard_verdict(self.at.z, self.at.x, decreed, [c]) != LEAVES:
                staying.add(c)
                self.fired[list(self.system.automata[c].guards[self.at.z[c]])] = False
        return others - staying

    def _first_modes(self, surfaces: set[int]) -> tuple[str, str] | None:
        """Set the sides of corners after a change of state, and leave modes that end at this instant.

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

    def take_sides(self, open_: set[int]) -> None:
        """Set every component with a surface to the mode of its side.

        open_: the components to be decided on their surfaces. A component that a reset moved off its surface is
        removed, and one that came to its surface is added.
        """
        at, system = self.at, self.system
        free = at.p.copy()
        free[system.layout.pin_at] = 0.0  # the states as they are, not projected by a holding mode
        series = system.series(at.s, at.x, free, np.maximum(at.z, 0), at.x_error, at.s_error, at.is_put)
        for k, c in enumerate(system.surface_of):
            automaton, value = system.automata[c], series.surfaces[k, 0]
            if abs(value) <= series.surface_bounds[k, 0]:
                if at.z[c] in (-1, automaton.hold) or self.on_surface[c] or automaton.is_unique:
                    open_.add(c)
                continue
            if value < 0.0 and automaton.is_unilateral:
                open_.add(c)
                continue
            open_.discard(c)
            self.on_surface[c] = False
            side = automaton.above if value > 0.0 else automaton.below
            self.fired[automaton.guards[side][0]] = False  # it was located at its surface before the reset
            if at.z[c] not in (-1, side):
                self.changes.append(Change(c, "reset", int(at.z[c]), side, at.x, at.x))
            at.z[c] = side

    def _surface_components(self) -> set[int]:
        return {c for c, a in enumerate(self.system.automata) if a.has_surface and c in self.scope}

    def _at_surfaces(self, components: set[int]) -> set[int]:
        """Return the components whose surfaces are zero; a guard on the load of a sliding contact does not count."""
        fired = {(c, j) for c, j, _ in self._fired_guards()}
        holds = [self.system.automata[c].hold for c in range(len(self.at.z))]
        return {
            c for c in components if self.at.z[c] == holds[c] or (c, 0) in fired
        }  # guard 0 of a mode is that of the surface

    def _fired_guards(self) -> list[tuple[int, int, int]]:
        """Return (component, index in its mode, guard number) of the located guards."""
        table = self.system.guards_of(self.at.z)
        return [
            (c, j, int(g))
            for c, row in enumerate(table)
            for j, g in enumerate(row)
            if g >= 0 and self.fired[g]
        ]

    def series_of(self, z: np.ndarray, x: np.ndarray | None = None) -> Series:
        """Return the Taylor series along the flow of the modes z, at the present state or at x."""
        at = self.at
        x = at.x if x is None else x
        behind = (at.s, x, at.p, at.x_error)
        if not all(a is b for a, b in zip(behind, self.behind, strict=True)):
            self.behind, self.series = behind, {}
        key = z.tobytes()
        if key not in self.series:
            self.series[key] = self.system.series(at.s, x, at.p, z, at.x_error, at.s_error, at.is_put)
        return self.series[key]

    def _guard_verdict(
        self, z: np.ndarray, x: np.ndarray, decreed: np.ndarray, components: Iterable[int]
    ) -> int:
        """Return the verdict on the guards of some components in the candidate modes z."""
        series = self.series_of(z, x)
        active = np.zeros(self.system.guard_count, dtype=np.bool_)
        table = self.system.guards_of(z)
        for c in components:
            active[table[c][table[c] >= 0]] = True
        sides, orders = np.empty_like(self.sides), np.empty_like(self.orders)
        verdict = guard_verdict(
            series.guards, series.guard_bounds, decreed, active, not self.forward, sides, orders
        )
        self.sides[active], self.orders[active] = sides[active], orders[active]
        return int(verdict)

    def _guard_verdicts(self) -> dict[int, int]:
        decreed = self._decreed(self.at.z, self._continuous(self.at.z, range(len(self.system.automata))))
        return {c: self._guard_verdict(self.at.z, self.at.x, decreed, [c]) for c in sorted(self.scope)}

    def _note_undecided(self, component: int) -> None:
        automaton = self.system.automata[component]
        if automaton.is_corner:
            return  # both sides are equally good
        mode = automaton.modes[self.at.z[component]]
        self.warnings.append(f"undecided at rounding: {automaton.name} keeps mode {mode}")

    # -- transitions by declared choices --------------------------------------------------------------------

    def _transitions(self, components: set[int], resets: list[tuple[object, ...]]) -> tuple[str, str] | None:
        """Take the declared choices of some components and apply resets, all evaluated at the state before."""
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
        """Return the position of a component's first guard in the order in which guards reached zero."""
        numbers = self.system.automata[component].guards[self.at.z[component]]
        return min((self.rank.get(g, len(self.rank)) for g in numbers), default=len(self.rank))

    # -- decisions by admissibility at surfaces -------------------------------------------------------------

    def choose_jointly(self, open_: set[int]) -> tuple[str, str] | None:
        """Decide the clusters that contain an open component: one that fired, leaves, or has no mode yet."""
        for cluster in self.system.clusters:
            if open_ & set(cluster):
                failure = self._choose_cluster(cluster, open_)
                if failure and failure[0] == "inconsistent" and (first := past_zero(self, cluster) - open_):
                    cross(self, first)
                    failure = self._choose_cluster(cluster, open_)
                if (
                    failure
                    and failure[0] == "inconsistent"
                    and (more := vanishing_surfaces(self, cluster) - open_)
                ):
                    failure = self._choose_cluster(cluster, open_ | more)
                if failure:
                    return failure
        return None

    def _choose_cluster(self, cluster: tuple[int, ...], open_: set[int]) -> tuple[str, str] | None:
        at, automata = self.at, self.system.automata
        taking_part = with_tied(
            self.system, [c for c in cluster if c in open_ or at.z[c] == automata[c].hold]
        )
        for c in taking_part:
            self.on_surface[c] = True
        sizes = [len(automata[c].modes) for c in taking_part]
        if math.prod(sizes) > _MAX_CANDIDATES:
            names = ", ".join(automata[c].name for c in taking_part)
            return (
                "inconsistent",
                f"{len(sizes)} coupled components reach their surfaces at once ({names}), too many to solve",
            )
        candidates = together(self.system, taking_part, joint_candidates(sizes))
        at.x = self._pinned(taking_part)
        at.x_error = np.where(self.pinned_states(taking_part), UNIT * np.abs(at.x), at.x_error)
        holds = np.array([automata[c].hold for c in taking_part])
        caused = candidates[with_cause(self, taking_part, candidates)]
        current = self._current(taking_part, holds)
        verdicts, is_whole = verdicts_on(self, taking_part, caused, current, holds, cluster)
        if len(caused) < len(candidates) and (verdicts == LEAVES).all():
            verdicts, is_whole = verdicts_on(self, taking_part, candidates, current, holds, cluster)
        else:
            candidates = caused
        rival = rivals(self, taking_part, candidates, verdicts)
        if len(rival):
            return f"{'' if self.forward else 'backward-'}nonunique", self._say(
                taking_part, rival, _SEVERAL_MOTIONS
            )
        number = int(choose(candidates, verdicts, current, holds))
        if number == NONUNIQUE:
            verdicts = verdicts if is_whole else all_verdicts(self, taking_part, candidates, cluster)
            left = np.flatnonzero(verdicts != LEAVES)
            if not is_one_motion(self, taking_part, candidates[left]):
                return self._several(taking_part, candidates[left])
            number = int(left[on_its_side(self, taking_part, candidates[left])])
        if number == NONE:
            return refused(self, taking_part, self._say(taking_part, candidates, "no motion is admissible"))
        others = other_outcomes(self, taking_part, candidates, number, open_, cluster)
        if len(others):
            return "nonunique", self._say(
                taking_part, np.vstack([candidates[number], others]), _SEVERAL_MOTIONS
            )
        source, x_minus = at.z.copy(), at.x.copy()
        if reason := keeps_nothing(self, taking_part, self.with_modes(taking_part, candidates[number])):
            return "nonunique", self._say(taking_part, candidates[number : number + 1], reason)
        fired = [(c, j) for c, j, _ in self._fired_guards() if source[c] >= 0]
        guards = {c: automata[c].guard_names[source[c]][j] for c, j in fired}
        for c, mode in zip(taking_part, candidates[number], strict=True):
            at.z[c] = mode
            if source[c] != mode:
                for g in automata[c].guards[source[c]] if source[c] >= 0 else ():
                    self.fired[g] = False
                if source[c] >= 0:
                    self.changes.append(
                        Change(c, guards.get(c, ""), int(source[c]), int(mode), x_minus, at.x)
                    )
        return None

    def _current(self, components: list[int], holds: np.ndarray) -> np.ndarray:
        """Return the preferred modes: the present ones, or at a start the holding modes of contacts.

        Static friction therefore holds a contact that is at its limit within rounding.
        """
        modes = self.at.z[components]
        begins = [modes[k] < 0 and not self.system.automata[c].is_unique for k, c in enumerate(components)]
        return np.where(begins, holds, modes)

    def _several(self, components: list[int], candidates: np.ndarray) -> tuple[str, str]:
        """Return status and message if no joint candidate is preferred, or if a rate is not a number."""
        at = self.at
        for modes in candidates:
            lost = rates_without_value(self.system, at.s, at.x, at.p, self.with_modes(components, modes))
            if lost:
                return "step-failure", lost
        return "nonunique", self._say(components, candidates, _SEVERAL_MOTIONS)

    def pinned_states(self, components: list[int]) -> np.ndarray:
        mask = np.zeros(self.system.n, dtype=np.bool_)
        mask[[i for c in components for i in self.system.pins.get(c, ())]] = True
        return mask

    def _pinned(self, components: list[int]) -> np.ndarray:
        """Return x with the surfaces of some components exactly zero."""
        z = np.maximum(self.at.z, 0)
        for c in components:
            z[c] = self.system.automata[c].hold
        return self.system.project(self.at.s, self.at.x, self.at.p, z)

    def with_modes(self, components: list[int], modes: np.ndarray) -> np.ndarray:
        """Return the modes after a change of some modes, with corners on their sides along the motion."""
        z = self.at.z.copy()
        z[components] = modes
        return sides_along(self, np.maximum(z, 0), self.at.x)[0] if self.system.led else np.maximum(z, 0)

    def verdict(self, z: np.ndarray, components: Iterable[int]) -> int:
        """Return whether the guards of some components admit the modes z just after the event."""
        components = list(components)
        decreed = self._decreed(z, self._continuous(z, components))
        found = self._guard_verdict(z, self.at.x, decreed, components)
        return LEAVES if found == UNDECIDED and not can_hold(self, components, z) else found

    def _continuous(self, z: np.ndarray, components: Iterable[int]) -> bool:
        """Return whether every change so far leaves all unknowns unchanged."""
        return not self.jumped and self.releases.leave_unknowns(self.at, z, components)

    def _decreed(self, z: np.ndarray, continuous: bool) -> np.ndarray:
        system = self.system
        modes = zip(system.automata, z, strict=True)
        holding = np.array([a.has_surface and m == a.hold for a, m in modes], dtype=np.bool_)
        released = np.array([self.releases.has(c, z) for c in range(len(z))], dtype=np.bool_)
        decreed = np.zeros(system.guard_count, dtype=np.int64)
        fired = self.fired & (z == self.at.z)[system.owner]
        decree_orders(
            system.guards_of(z),
            holding,
            self.on_surface,
            released,
            continuous,
            fired,
            system.is_unilateral,
            decreed,
        )
        return decreed

    def _say(self, components: list[int], candidates: np.ndarray, what: str) -> str:
        automata = self.system.automata
        rows = [
            ", ".join(
                f"{automata[c].name}: {automata[c].modes[m]}" for c, m in zip(components, row, strict=True)
            )
            for row in candidates
        ]
        state = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.system.names, self.at.x, strict=True))
        return f"{what} at {state}: {'; or '.join(rows)}"

    # -- results --------------------------------------------------------------------------------------------

    def _done(self) -> Outcome:
        at = self.at
        series = self.series_of(np.maximum(at.z, 0), at.x)
        found = [side_after(v, e, 0) for v, e in zip(series.monitors, series.monitor_bounds, strict=True)]
        monitor_sides = np.array([f[0] for f in found], dtype=np.int64)
        monitor_orders = np.array([f[1] for f in found], dtype=np.int64)
        if not self.forward:
            monitor_sides = np.where(monitor_orders % 2 == 1, -monitor_sides, monitor_sides)
        return Outcome(
            at.x,
            at.p,
            at.z,
            self.sides,
            np.where(self.orders > ORDER, 0, self.orders),
            monitor_sides,
            np.where(monitor_orders > ORDER, 0, monitor_orders),
            at.x_error,
            np.where(self.orders > 0, series.guard_bounds[:, 0], 0.0),
            np.where(monitor_orders > 0, series.monitor_bounds[:, 0], 0.0),
            self.changes,
            not self.is_kinked and self._continuous(at.z, range(len(self.system.automata))),
            "",
            "",
            self.warnings,
        )

    def _stop(self, status: str, message: str) -> Outcome:
        at = self.at
        none = np.zeros(len(self.system.monitor_names), dtype=np.int64)
        return Outcome(
            at.x,
            at.p,
            at.z,
            self.sides,
            self.orders,
            none,
            none,
            at.x_error,
            np.zeros(self.system.guard_count),
            np.zeros(len(none)),
            self.changes,
            False,
            status,
            message,
            self.warnings,
        )
