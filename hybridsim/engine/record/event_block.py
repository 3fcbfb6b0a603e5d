"""This module stores the events of a compiled loop or of fixed steps in arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import Precompiled, kernel
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.system.automaton import RESET
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

AT_KNOWN_TIME = -2  # kind k of a known time is AT_KNOWN_TIME - k in place of a guard


@kernel
def _taking_part(
    fired: Any,
    before: Any,
    after: Any,
    owner: Any,
    may_return: Any,
    due_start: Any,
    due: Any,
    recorded: Any,
    participants: Any,
) -> tuple[int, int, bool]:
    """Write the participants of events; return their number, and the number of components among them.

    A participant is a component that changes its mode or is reset, a monitor, or a schedule that is due.
    may_return (C,): whether an event of the component may leave its mode unchanged. before, after (E, C) or (E, C + M):
    modes of the components, and sides of the monitors if there are any.
    due_start, due: the schedules of each kind of known time. recorded (3 M,): whether each monitor records that it
    leaves its positive side, its negative side, and zero. participants (2, m): receives event and number of each, up to
    its length; monitors follow the components, and schedules follow the monitors.
    """
    count, others, is_plain = 0, 0, True
    components, guards, monitors = may_return.shape[0], owner.shape[0], recorded.shape[0] // 3
    for e in range(fired.shape[0]):
        first = owner[fired[e]] if 0 <= fired[e] < guards and may_return[owner[fired[e]]] else components
        if first < components:  # its reset or impact precedes the changes that follow from it
            if count < participants.shape[1]:
                participants[0, count], participants[1, count] = e, first
            count += 1
        for c in range(components):
            if before[e, c] != after[e, c] and c != first:
                if count < participants.shape[1]:
                    participants[0, count], participants[1, count] = e, c
                count += 1
        for m in range(components, before.shape[1]):
            if before[e, m] != after[e, m] and recorded[3 * (m - components) + before[e, m]]:
                if count < participants.shape[1]:
                    participants[0, count], participants[1, count] = e, m
                count, others = count + 1, others + 1
        if fired[e] <= AT_KNOWN_TIME:
            kind = AT_KNOWN_TIME - fired[e]
            for i in range(due_start[kind], due_start[kind + 1]):
                if count < participants.shape[1]:
                    participants[0, count], participants[1, count] = e, components + monitors + due[i]
                count, others = count + 1, others + 1
        is_plain = is_plain and count == e + 1
    return count, count - others, is_plain


@kernel
def _times_at(instants: Any, participants: Any, first: int, component: int, times: Any) -> int:
    """Write the times of a component's events, starting with a given event, and return how many there are."""
    count = 0
    for i in range(first, participants.shape[1]):
        if participants[1, i] == component:
            e = participants[0, i]
            times[count] = instants[e, 0] + instants[e, 1]
            count += 1
    return count


@kernel
def _states_at(states: Any, participants: Any, first: int, component: int, side: int, out: Any) -> int:
    """Write the states before or after the events of one component, and return how many events there are."""
    count = 0
    for i in range(first, participants.shape[1]):
        if participants[1, i] == component:
            for j in range(out.shape[1]):
                out[count, j] = states[participants[0, i], side, j]
            count += 1
    return count


SCHEDULED, MONITOR = "scheduled", "monitor"  # kinds of the events of schedules and monitors
# directions in which a monitor fires if it leaves its positive side, its negative side, and zero
_DIRECTIONS = (("both", "down"), ("both", "up"), ())
_NO_KINDS = np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)  # of known times, as arrays
_take_part, _times_of_one = Precompiled(_taking_part), Precompiled(_times_at)


class EventBlock(Sequence[Occurrence]):
    """Events in arrays; an event has one entry for every component that changes its mode or is reset.

    A monitor or a schedule has one entry as well.

    Parameters
    ----------
    instants : (E, 2), high and low.
    fired : (E,), number of the guard that fired; -1 for none; AT_KNOWN_TIME - k for kind k of a known time. The guards
        of the corners of monitors follow those of the components.
    before, after : (E, C) or (E, C + M), modes on both sides. Those of monitors are 0 while a monitor is positive, 1
        while it is negative, and 2 while it stays at zero.
    states : (E, 2, n), x- and x+.
    due : the schedules of each kind of known time.
    """

    def __init__(
        self,
        system: System,
        instants: np.ndarray,
        fired: np.ndarray,
        before: np.ndarray,
        after: np.ndarray,
        states: np.ndarray,
        due: Sequence[tuple[int, ...]] = (),
    ) -> None:
        self._system, self._instants, self._fired = system, instants, fired
        self._before, self._after, self._states = before, after, states
        self._first = 0
        self.changes: int  # number of changes of mode
        participants = np.empty((2, len(fired)), dtype=np.int64)
        kinds = _NO_KINDS
        if due:
            kinds = np.cumsum([0, *map(len, due)]), np.array([k for one in due for k in one], dtype=np.int64)
        recorded = [m.direction in ways for m in system.model.monitors for ways in _DIRECTIONS]
        may_return = ~system.has_surface | system.is_unilateral  # a reset or an impact
        arrays = fired, before, after, system.owner, may_return, *kinds, np.array(recorded, dtype=np.bool_)
        self._count, self.changes, self._is_plain = _take_part(*arrays, participants)
        if self._count != len(fired):
            participants = np.empty((2, self._count), dtype=np.int64)
            _take_part(*arrays, participants)
        self._all_participants = participants

    def __len__(self) -> int:
        return self._count - self._first

    @property
    def _participants(self) -> np.ndarray:
        """Return the event and the component of each recorded change, as two rows of numbers."""
        return self._all_participants[:, self._first :]

    @property
    def until(self) -> Instant:
        """Return the instant of the last event."""
        return Instant(*self._instants[self._all_participants[0, -1]].tolist())

    @property
    def times(self) -> np.ndarray:
        """Return the times of the events, rounded to doubles."""
        times = self._instants[:, 0] + self._instants[:, 1]
        return times[self._first :] if self._is_plain else times[self._participants[0]]

    def times_of(self, component: str, kind: str | None) -> np.ndarray:
        """Return the times of the events of a component or schedule."""
        for c, (name, own) in enumerate(self._named):
            if name == component and kind in (None, own):
                times = np.empty(len(self))
                count = _times_of_one(self._instants, self._all_participants, self._first, c, times)
                return times if count == len(times) else times[:count]
        return np.empty(0)

    def states_of(self, component: str, kind: str | None, side: int) -> np.ndarray:
        """Return a new array of states (k, n) at events, before (side 0) or after (side 1) each event."""
        for c, (name, own) in enumerate(self._named):
            if name == component and kind in (None, own):
                states = np.empty((len(self), self._system.n))
                # called directly, because the states of some loops are not contiguous
                count = _states_at(self._states, self._all_participants, self._first, c, side, states)
                return states if count == len(states) else states[:count]
        return np.empty((0, self._system.n))

    def kinds(self) -> Counter[str]:
        """Return the number of events of each kind."""
        found: Counter[str] = Counter()
        for (_, kind), count in zip(self._named, np.bincount(self._participants[1]).tolist()):
            found[kind] += count
        return +found

    @cached_property
    def _named(self) -> list[tuple[str, str]]:
        """Return the names of components, monitors and schedules, each with the kind of its events."""
        model, named = self._system.model, [(part.name, part.kind) for part in self._system.automata]
        named += [(monitor.name, MONITOR) for monitor in model.monitors]
        return named + [(schedule.name, SCHEDULED) for schedule in model.schedules]

    def transitions(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Return instants (k, 2) and states (k, 2, n) of the transitions, starting with a given event."""
        has_corners = len(self._system.declared) < len(self._system.automata)
        has_others = self.changes < self._count
        if self._is_plain and not (has_corners or has_others):
            return self._instants[self._first + first :], self._states[self._first + first :]
        events, components = self._participants[:, first:]
        if has_others:
            is_change = components < len(self._system.automata)
            events, components = events[is_change], components[is_change]
        if has_corners:
            events = events[~self._system.is_corner[components]]
        return self._instants[events], self._states[events]

    def changes_of_components(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the instants (k, 2) at which components change their modes or are reset, and the components (k,)."""
        events, components = self._participants
        is_change = components < len(self._system.automata)
        return self._instants[events[is_change]], components[is_change]

    def single_transitions(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the instants (E, 2) and the guards (E,) of the events, or None unless each event is one transition."""
        components, owner = self._all_participants[1], self._system.owner
        if not self._is_plain or self._first or not ((self._fired >= 0) & (self._fired < len(owner))).all():
            return None
        return (self._instants, self._fired) if (owner[self._fired] == components).all() else None

    def since(self, first: int) -> EventBlock:
        """Return a block of the events, starting with the event of a given number."""
        later = copy(self)
        later._first += first
        return later

    def __getitem__(self, i: Any, /) -> Any:
        if isinstance(i, slice):
            return list(self._made(i))
        e, c = self._participants[:, range(len(self))[i]].tolist()
        modes = (0, 0)  # of no meaning for a schedule
        if c < self._before.shape[1]:
            modes = int(self._before[e, c]), int(self._after[e, c])
        return self._occurrence(c, int(self._fired[e]), *modes, self._instants[e].tolist(), *self._states[e])

    def __iter__(self) -> Iterator[Occurrence]:
        return self._made(slice(None))

    def _made(self, chosen: slice) -> Iterator[Occurrence]:
        e, c = (participants[chosen] for participants in self._participants)
        own = np.minimum(c, self._before.shape[1] - 1)  # of no meaning for a schedule
        has_modes = self._before.shape[1] > 0
        rows = zip(
            c.tolist(),
            self._fired[e].tolist(),
            self._before[e, own].tolist() if has_modes else c.tolist(),
            self._after[e, own].tolist() if has_modes else c.tolist(),
            self._instants[e].tolist(),
            self._states[e],
            strict=True,
        )
        for component, fired, source, target, instant, (x_minus, x_plus) in rows:
            yield self._occurrence(component, fired, source, target, instant, x_minus, x_plus)

    def _occurrence(
        self,
        component: int,
        fired: int,
        source: int,
        target: int,
        instant: list[float],
        x_minus: np.ndarray,
        x_plus: np.ndarray,
    ) -> Occurrence:
        at, automata = Instant(*instant), self._system.automata
        if component >= len(automata):
            name, kind = self._named[component]
            direction = 0 if kind == SCHEDULED else 1 if source == 1 else -1
            return Occurrence(at, kind, name, "", "", "", direction, x_minus, x_plus)
        automaton, guard, modes = automata[component], "", automata[component].modes
        if 0 <= fired < len(self._system.owner) and component == self._system.owner[fired]:
            guard = automaton.guard_names[source][automaton.guards[source].index(fired)]
        elif 0 <= fired < len(self._system.owner) and self._system.is_unilateral[self._system.owner[fired]]:
            guard = RESET if automaton.has_surface else automaton.guard_towards(source, target)
        return Occurrence(
            at, automaton.kind, automaton.name, guard, modes[source], modes[target], -1, x_minus, x_plus
        )
