"""Leaps over segments of linear modes, as the general mode loop sees them."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

from hybridsim.engine.closed_form_block import ClosedFormBlock
from hybridsim.engine.crossings import Crossings
from hybridsim.engine.desk import Desk
from hybridsim.engine.event_work import functions_of, work_space
from hybridsim.engine.exact_leap import Record, Room, exact_leap
from hybridsim.engine.jit import Door
from hybridsim.engine.leap import AT_TARGET, FULL
from hybridsim.engine.linear_guards import TERMS
from hybridsim.engine.linear_tables import LinearTables, tables_of
from hybridsim.engine.mode_tables import automata_of, shelf_of
from hybridsim.engine.outcome import Outcome
from hybridsim.engine.packs import Sheet, packed
from hybridsim.engine.segment_end import reach_settling
from hybridsim.engine.stepping import ARRIVED, BEFORE_SOMETHING, PAUSED, Landing, Tolerances
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Trajectory

_SEGMENTS = 1024  # room for one call
_NONE = np.zeros(0, dtype=np.int64)

_leap = Door(exact_leap)


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
        self.places = (system.rates, layout.origin_at, layout.phases_at)

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
        tapes, inputs = self.shelf.tapes, self.system.registers.inputs
        self.horizon = max(self.horizon, min(target.minus(origin), self.longest))
        found = tables_of(self.system, tapes.modes, p, self.horizon)
        if found is None:
            return Landing(origin, outcome, BEFORE_SOMETHING, np.zeros((0, 2)), _NONE)
        tables, spare = found
        try:
            desk = spare.pop()
        except IndexError:
            desk = Desk.of(outcome, p, *self._scratch(tables))
            reach_settling(self.automata, tapes, inputs, tables, desk.as_packed, desk.work)
        desk.take_up(outcome, p)
        sheet = self._sheet(tables)
        clock, to, memory = np.array(origin), np.array(target), sheet.blank()
        rows, began = sheet.packed(memory), perf_counter()
        code, count = _leap(
            self.functions, self.automata, tapes, inputs, tables, self.places, self.longest,
            to, clock, desk.as_packed, desk.work, desk.room, rows,
        )  # fmt: skip
        record.counters.kernel_time += perf_counter() - began
        after = desk.outcome()
        spare.append(desk)
        instants, owners = self._commit(tables, sheet.rows(memory), count, after.z, clock, record)
        self.shelf.surround(after.z)
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

    def _sheet(self, tables: LinearTables) -> Sheet:
        """What the kernel writes to; the trajectory keeps it, events longer than segments."""
        widest, system = tables.values.shape[1], self.system

        def made() -> Sheet:
            return Sheet(
                Record,
                (
                    (float, (_SEGMENTS,), 0),
                    (
                        float,
                        (_SEGMENTS + 1, 2),
                        1,
                    ),  # one row more: where each begins and where the last one ends
                    (np.int64, (_SEGMENTS,), 0),
                    (np.int64, (_SEGMENTS + 1, len(system.automata)), 1),
                    (float, (_SEGMENTS, system.layout.size), 0),
                    (complex, (_SEGMENTS, widest), 0),
                    (np.int64, (_SEGMENTS,), 1),
                    (float, (_SEGMENTS, 3, system.n), 1),
                ),
            )

        sheet: Sheet = system.code.shared(f"sheet for {widest} modal coordinates", made)
        return sheet

    def _commit(
        self,
        tables: LinearTables,
        rows: Record,
        count: int,
        z_after: np.ndarray,
        clock: np.ndarray,
        record: Trajectory,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Leave so many segments to the trajectory; the instants (E, 2) of their events, and whose they are."""
        ends, origins, numbers, modes, vectors, coordinates, fired, jumps = rows
        if not count:
            return np.empty((0, 2)), _NONE
        system, counters, begun = self.system, record.counters, slice(0, count)
        origins[count], modes[count] = clock, z_after
        record.segments.add(
            ClosedFormBlock(
                system,
                tables,
                numbers[begun],
                ends[begun],
                coordinates[begun],
                origins[begun],
                modes[begun],
                vectors[begun],
                jumps[begun],
            )
        )
        counters.steps += count
        counters.restarts += count
        events = count if fired[count - 1] >= 0 else count - 1
        instants, ended, after = origins[1 : events + 1], slice(0, events), slice(1, events + 1)
        if events:
            crossings = Crossings(
                system, instants, fired[ended], modes[ended], modes[after], jumps[ended, 1:]
            )
            counters.events += len(crossings)
            record.occurrences.add(crossings)
        return instants, system.owner[fired[ended]]
