"""Leaps over segments of linear modes, as the general mode loop sees them."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from hybridsim.engine.closed_form_block import ClosedFormBlock
from hybridsim.engine.crossings import Crossings
from hybridsim.engine.desk import Desk
from hybridsim.engine.event_work import work_space
from hybridsim.engine.exact_leap import Record, leap_at_address, reach_leap, room_for
from hybridsim.engine.jit import Door
from hybridsim.engine.leap import AT_TARGET, FULL
from hybridsim.engine.linear_tables import LinearTables, tables_of
from hybridsim.engine.mode_tables import automata_of, shelf_of
from hybridsim.engine.outcome import Outcome
from hybridsim.engine.packs import Sheet
from hybridsim.engine.pieces import end_point
from hybridsim.engine.stepping import ARRIVED, BEFORE_SOMETHING, PAUSED, Landing, Tolerances
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Trajectory

_SEGMENTS = 1024  # room for one call
_NONE = np.zeros(0, dtype=np.int64)

_leap = Door(leap_at_address)


class ExactLeaper:
    """Leaps of one run."""

    def __init__(self, system: System, tolerances: Tolerances, longest: float) -> None:
        self.system, self.longest = system, longest
        self.horizon = 0.0  # the farthest that a segment might have gone so far
        # as in the room of a leap, where the last one left them
        self.hints = np.zeros((0, system.guard_count))
        self.shelf, self.automata = shelf_of(system), automata_of(system)
        self.tables: LinearTables | None = None  # those that the sheet is for
        self.sheet: Sheet

    def anew(self) -> ExactLeaper:
        """The same for another run."""
        other: ExactLeaper = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    @property
    def place(self) -> tuple[np.ndarray, ...]:
        """How far ahead the tables reach, and when guards were zero last: the last digits of a zero depend on it.

        The hints come with their vectors of modes: another process has these in other rows.
        """
        count = len(self.hints)
        modes = self.shelf.tapes.modes[:count]
        return np.array([self.horizon, float(count)]), modes.ravel().astype(float), self.hints.ravel()

    @place.setter
    def place(self, place: np.ndarray) -> None:
        guards, components = self.system.guard_count, len(self.system.automata)
        self.horizon, count = float(place[0]), int(place[1])
        vectors = place[2 : 2 + count * components].reshape(count, components).astype(np.int64)
        hints = place[2 + count * components :].reshape(count, guards)
        is_known = (hints > 0.0).any(axis=1)
        rows = self.shelf.rows_of(vectors[is_known])
        self.hints = np.zeros((max(rows.tolist(), default=-1) + 1, guards))
        self.hints[rows] = hints[is_known]

    def leap(
        self, origin: Instant, outcome: Outcome, p: np.ndarray, target: Instant, record: Trajectory
    ) -> Landing:
        """As far as ordinary events and the room for them go."""
        system, shelf = self.system, self.shelf
        shelf.surround(outcome.z)
        tapes, inputs = shelf.tapes, system.registers.inputs
        self.horizon = max(self.horizon, min(target.minus(origin), self.longest))
        found = tables_of(system, tapes.modes, p, self.horizon)
        if found is None:
            return Landing(origin, outcome.copy, BEFORE_SOMETHING, np.zeros((0, 2)), _NONE)
        tables, spare = found
        if tables is not self.tables:
            self.tables, self.sheet = tables, self._sheet(tables)
        memory = self.sheet.blank()
        rows = self.sheet.packed(memory)
        try:
            desk = spare.pop()
        except IndexError:
            work = work_space(system, len(tables.kinds), len(tables.factors))
            desk = Desk.of(outcome, p, work, room_for(system, tables))
            reach_leap(self.automata, tapes, inputs, tables, desk.as_packed, work, desk.room, rows)
        desk.take_up(outcome, p)
        room = desk.room
        room.rates[:], room.longest[0] = system.rates, self.longest
        room.times[:] = *target, *origin
        hints, known = room.hints, len(self.hints)
        hints[:known], hints[known:] = self.hints, 0.0
        began = perf_counter()
        code = _leap(self.automata, tapes, inputs, tables, desk.as_packed, desk.work, room, rows)
        record.counters.kernel_time += perf_counter() - began
        z, after = desk.leave()
        clock, count = room.times[2:].tolist(), int(room.committed[0])
        self.hints = hints.copy()
        spare.append(desk)
        instants, owners = self._commit(tables, self.sheet.rows(memory), count, z, clock, record)
        shelf.surround(z)
        goes_on = code == FULL or (count > 0 and len(shelf.tapes.modes) != len(tapes.modes))
        end = ARRIVED if code == AT_TARGET else (PAUSED if goes_on else BEFORE_SOMETHING)
        return Landing(Instant(*clock), after, end, instants, owners)

    def _sheet(self, tables: LinearTables) -> Sheet:
        """What the kernel writes to; the trajectory keeps it, events longer than segments."""
        widest, system = tables.values.shape[1], self.system

        def made() -> Sheet:
            return Sheet(
                Record,
                (
                    (float, (_SEGMENTS,), 0),
                    # one row more: where each begins and where the last one ends
                    (float, (_SEGMENTS + 1, 2), 1),
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
        clock: list[float],
        record: Trajectory,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Leave so many segments to the trajectory; the instants (E, 2) of their events, and whose they are."""
        ends, origins, numbers, modes, vectors, coordinates, fired, jumps = rows
        if not count:
            return np.empty((0, 2)), _NONE
        system, counters, begun = self.system, record.counters, slice(0, count)
        origins[count], modes[count] = clock, z_after
        if record.segments.is_end_alone:
            last = count - 1
            record.segments.keep_only(end_point(Instant(*clock), modes[last], vectors[last], jumps[last, 1]))
        else:
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
