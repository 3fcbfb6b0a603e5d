"""Leaps over segments of linear modes, as the general mode loop sees them."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

from hybridsim.engine.closed_form_block import ClosedFormBlock
from hybridsim.engine.crossings import Crossings
from hybridsim.engine.event_work import functions_of, work_space
from hybridsim.engine.exact_leap import Record, Room, exact_leap
from hybridsim.engine.leap import AT_TARGET, FULL
from hybridsim.engine.linear_guards import TERMS
from hybridsim.engine.linear_tables import LinearTables, tables_of
from hybridsim.engine.mode_tables import automata_of, shelf_of
from hybridsim.engine.outcome import Outcome
from hybridsim.engine.packs import packed
from hybridsim.engine.segment_end import State, reach_settling
from hybridsim.engine.stepping import ARRIVED, BEFORE_SOMETHING, PAUSED, Landing, Tolerances
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Trajectory

_SEGMENTS = 1024  # room for one call
_NONE = np.zeros(0, dtype=np.int64)


class ExactLeaper:
    """Leaps of one run."""

    def __init__(self, system: System, tolerances: Tolerances, longest: float) -> None:
        self.system, self.longest = system, longest
        self.horizon = 0.0  # the farthest that a segment might have gone so far
        self.shelf, self.automata, self.functions = (
            shelf_of(system),
            automata_of(system),
            functions_of(system),
        )
        layout = system.layout
        self.places = (
            np.asarray(system.rates),
            layout.origin_at,
            layout.phases_at,
        )

    @property
    def place(self) -> np.ndarray:
        """How far ahead the tables reach."""
        return np.array([self.horizon])

    @place.setter
    def place(self, place: np.ndarray) -> None:
        self.horizon = float(place[0])

    def leap(
        self, origin: Instant, outcome: Outcome, p: np.ndarray, target: Instant, record: Trajectory
    ) -> Landing:
        """As far as ordinary events and the room for them go."""
        self.shelf.surround(outcome.z)
        clock, to = np.array([origin.high, origin.low]), np.array([target.high, target.low])
        state = State(
            outcome.x.copy(),
            outcome.x_error.copy(),
            outcome.z.copy(),
            p.copy(),
            outcome.sides.copy(),
            outcome.orders.copy(),
            outcome.guard_floors.copy(),
        )
        tapes = self.shelf.tapes
        self.horizon = max(self.horizon, min(target.minus(origin), self.longest))
        found = tables_of(self.system, tapes.modes, p, self.horizon)
        if found is None:
            return Landing(origin, outcome, BEFORE_SOMETHING, np.zeros((0, 2)), _NONE)
        tables, spare = found
        as_packed = packed(state)
        try:
            work, room = spare.pop()
        except IndexError:
            work, room = self._scratch(tables)
            reach_settling(self.automata, tapes, self.system.registers.inputs, tables, as_packed, work)
        rows = self._record(tables)
        record_packed, began = packed(rows), perf_counter()
        code, count = exact_leap(
            self.functions, self.automata, tapes, self.system.registers.inputs, tables, self.places, self.longest,
            to, clock, as_packed, work, room, record_packed,
        )  # fmt: skip
        record.counters.kernel_time += perf_counter() - began
        spare.append((work, room))
        instants, owners = self._commit(tables, Record(*(r[:count] for r in rows)), state[2], clock, record)
        x, x_error, z, p, sides, orders, floors = state
        self.shelf.surround(z)
        after = Outcome(x, p, z, sides, orders, _NONE, _NONE, x_error, floors, np.zeros(0), continuous=False)
        goes_on = code == FULL or (count > 0 and len(self.shelf.tapes.modes) != len(tapes.modes))
        end = ARRIVED if code == AT_TARGET else (PAUSED if goes_on else BEFORE_SOMETHING)
        return Landing(Instant(*clock.tolist()), after, end, instants, owners)

    def _scratch(self, tables: LinearTables) -> tuple[Any, Any]:
        """Room for events, and scratch arrays of the kernel."""
        n, widest = self.system.n, tables.values.shape[1]
        room = Room(
            c=np.zeros(widest, dtype=complex),
            v=np.zeros(widest, dtype=complex),
            terms=np.zeros((2, TERMS)),
            starts=np.zeros((self.system.guard_count, TERMS + 2)),
            hints=np.zeros(tables.farthest.shape),
            scale=np.empty(n),
            pace=np.empty(3),
        )
        return work_space(self.system, len(tables.kinds), len(tables.factor_start) - 1), packed(room)

    def _record(self, tables: LinearTables) -> Record:
        """Fresh arrays for the kernel to write to; the trajectory keeps them."""
        n, count = self.system.n, len(self.system.automata)
        return Record(
            np.empty(_SEGMENTS),
            np.empty((_SEGMENTS, 2)),
            np.empty(_SEGMENTS, dtype=np.int64),
            np.empty((_SEGMENTS, count), dtype=np.int64),
            np.empty((_SEGMENTS, self.system.layout.size)),
            np.empty((_SEGMENTS, tables.values.shape[1]), dtype=complex),
            np.empty(_SEGMENTS, dtype=np.int64),
            np.empty((_SEGMENTS, 3, n)),
        )

    def _commit(
        self,
        tables: LinearTables,
        rows: Record,
        z_after: np.ndarray,
        clock: np.ndarray,
        record: Trajectory,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Leave what was written to the trajectory; the instants (E, 2) of its events, and whose they are."""
        ends, origins, numbers, modes, vectors, coordinates, fired, jumps = rows
        count = len(ends)
        if not count:
            return np.empty((0, 2)), _NONE
        system, counters = self.system, record.counters
        record.segments.add(
            ClosedFormBlock(system, tables, numbers, ends, coordinates, origins, modes, vectors, jumps)
        )
        counters.steps += count
        counters.restarts += count
        events = count if fired[-1] >= 0 else count - 1
        instants = np.concatenate([origins[1:], clock[None]])[:events]
        if events:
            after = np.concatenate([modes[1:], z_after[None]])[:events]
            crossings = Crossings(system, instants, fired[:events], modes[:events], after, jumps[:events, 1:])
            counters.events += len(crossings)
            record.occurrences.add(crossings)
        return instants, system.owner[fired[:events]]
