"""The compiled loop over segments of linear modes, for the general mode loop."""

from __future__ import annotations

import math
from time import perf_counter

import numpy as np

from hybridsim.engine.events.compiled.scratch import work_space
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.linear.closed_form_block import ClosedFormBlock
from hybridsim.engine.linear.tables import LinearTables, tables_of
from hybridsim.engine.native.constants import MAX_SEGMENTS
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.struct_pack import ArrayLayout
from hybridsim.engine.record.array_forms import check_modes
from hybridsim.engine.record.checkpoint import damaged
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.run.call_arrays import CallArrays, StateBuffer, buffer_of
from hybridsim.engine.run.kernel_run import KernelRun
from hybridsim.engine.run.stepping import ARRIVED, BEFORE_SOMETHING, PAUSED, LoopResult
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.programs.mode_tables import automata_of, tape_cache_of
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.closed_form.segments import Record, call_event_loop, link_event_loop, scratch_for

_NO_OWNERS = np.zeros(0, dtype=np.int64)

_event_loop = Precompiled(call_event_loop)


class ClosedFormLoop:
    """The compiled loop of one run."""

    def __init__(self, system: System, tolerances: Tolerances, longest: float) -> None:
        self.system, self.longest = system, longest
        self.horizon = 0.0  # longest segment that was possible so far
        # as in `Scratch.hints` after the last call
        self.hints = np.zeros((0, system.guard_count))
        self.tape_cache, self.automata = tape_cache_of(system), automata_of(system)
        self.tables: LinearTables | None = None  # tables for which the layout was made
        self.array_layout: ArrayLayout
        self.kernel_run: KernelRun | None = None  # a call made beforehand, which `advance` takes first

    def fresh_copy(self) -> ClosedFormLoop:
        """Return the same loop for another run."""
        other: ClosedFormLoop = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    @property
    def place(self) -> tuple[np.ndarray, ...]:
        """Return the horizon of the tables and the last zeros of guards, which affect later zeros slightly.

        The hints are stored with their mode vectors, because another process has these in other rows.
        """
        count = len(self.hints)
        modes = self.tape_cache.tapes.modes[:count]
        return np.array([self.horizon, float(count)]), modes.ravel().astype(float), self.hints.ravel()

    @place.setter
    def place(self, place: np.ndarray) -> None:
        guards, components = self.system.guard_count, len(self.system.automata)
        what = "the last zeros of guards"
        whole = len(place) >= 2 and 0.0 <= place[0] < math.inf and 0.0 <= place[1] <= len(place)
        if not whole or len(place) != 2 + int(place[1]) * (components + guards):
            raise damaged(what)
        self.horizon, count = float(place[0]), int(place[1])
        try:
            check_modes(
                what,
                place[2 : 2 + count * components].reshape(count, components),
                [len(a.modes) for a in self.system.automata],
            )
        except ValueError:
            raise damaged(what) from None
        vectors = place[2 : 2 + count * components].reshape(count, components).astype(np.int64)
        hints = place[2 + count * components :].reshape(count, guards)
        is_known = (hints > 0.0).any(axis=1)
        rows = self.tape_cache.rows_of(vectors[is_known])
        self.hints = np.zeros((max(rows.tolist(), default=-1) + 1, guards))
        self.hints[rows] = hints[is_known]

    def go(self, origin: Instant, buffer: StateBuffer, target: Instant) -> KernelRun | None:
        """Call the kernel; return None if there are no tables."""
        system, tape_cache = self.system, self.tape_cache
        tape_cache.surround(buffer.part("z"))
        tapes, inputs = tape_cache.tapes, system.registers.inputs
        horizon = max(self.horizon, min(target.minus(origin), self.longest))
        found = tables_of(system, tapes.modes, buffer.part("p"), horizon)
        if found is None:
            self.horizon = horizon
            return None
        tables, spare = found
        if tables is not self.tables:
            self.tables, self.array_layout = tables, self._array_layout(tables)
        memory = self.array_layout.blank()
        rows = self.array_layout.packed(memory)
        try:
            call_arrays = spare.pop()
        except IndexError:
            work = work_space(system, len(tables.kinds), len(tables.factors))
            call_arrays = CallArrays.of(buffer, work, scratch_for(system, tables))
            link_event_loop(
                self.automata, tapes, inputs, tables, call_arrays.as_packed, work, call_arrays.scratch, rows
            )
        call_arrays.set_state(buffer)
        scratch = call_arrays.scratch
        scratch.rates[:], scratch.longest[0] = system.rates, self.longest
        scratch.times[:] = *target, *origin
        hints, known = scratch.hints, len(self.hints)
        hints[:known], hints[known:] = self.hints, 0.0
        began = perf_counter()
        code = _event_loop(
            self.automata, tapes, inputs, tables, call_arrays.as_packed, call_arrays.work, scratch, rows
        )
        seconds = perf_counter() - began
        end, clock, count = call_arrays.final_state(), scratch.times[2:].tolist(), int(scratch.committed[0])
        beside = (tables, horizon, hints.copy())
        spare.append(call_arrays)
        tape_cache.surround(end.part("z"))
        has_news = count > 0 and len(tape_cache.tapes.modes) != len(tapes.modes)
        return KernelRun(
            system, self.array_layout, memory, 0, code, count, count, clock, end, has_news, seconds, beside
        )

    def advance(
        self, origin: Instant, outcome: Outcome, p: np.ndarray, target: Instant, record: Trajectory
    ) -> LoopResult:
        """Run over ordinary events until another kind of event, the target, or the end of the arrays."""
        kernel_run, self.kernel_run = self.kernel_run or self.go(origin, buffer_of(outcome, p), target), None
        if kernel_run is None:
            return LoopResult(origin, outcome.copy, BEFORE_SOMETHING, np.zeros((0, 2)), _NO_OWNERS)
        _, self.horizon, self.hints = kernel_run.beside
        self.count(kernel_run, record.counters)
        if kernel_run.count:
            self._commit(kernel_run, record)
        may_continue = kernel_run.is_full or kernel_run.has_news
        end = ARRIVED if kernel_run.is_at_target else (PAUSED if may_continue else BEFORE_SOMETHING)
        return LoopResult(
            Instant(*kernel_run.clock), kernel_run.after, end, kernel_run.instants, kernel_run.owners
        )

    def count(self, kernel_run: KernelRun, counters: Counters) -> None:
        """Add the cost of a call to the counters."""
        kernel_run.count_in(counters)

    def forget_segments(self, kernel_run: KernelRun) -> bool:
        """Release all segments except the end of the last one."""
        kernel_run.forget_segments()
        return True

    def _array_layout(self, tables: LinearTables) -> ArrayLayout:
        """Return the layout of the arrays that the kernel writes; event arrays are stored longest."""
        return _segment_layout(self.system, tables.values.shape[1])

    def segments_of(self, kernel_run: KernelRun) -> ClosedFormBlock:
        """Return the segments of a call, which must have stored some and released none."""
        ends, origins, numbers, modes, vectors, coordinates, _, jumps = kernel_run.rows
        begun, tables = slice(0, kernel_run.count), kernel_run.beside[0]
        return ClosedFormBlock(
            self.system,
            tables,
            numbers[begun],
            ends[begun],
            coordinates[begun],
            origins[begun],
            modes[begun],
            vectors[begun],
            jumps[begun],
        )

    def _commit(self, kernel_run: KernelRun, record: Trajectory) -> None:
        """Transfer the segments and the events to the trajectory."""
        if record.segments.is_end_alone:
            record.segments.set_end(kernel_run.last_end)
        else:
            record.segments.add(self.segments_of(kernel_run))
        if kernel_run.event_block is not None:
            record.occurrences.add(kernel_run.event_block)


@per_structure
def _segment_layout(system: System, widest: int) -> ArrayLayout:
    return ArrayLayout(
        Record,
        (
            (float, (MAX_SEGMENTS,), 0),
            # one more row: all starts, and the end of the last segment
            (float, (MAX_SEGMENTS + 1, 2), 1),
            (np.int64, (MAX_SEGMENTS,), 0),
            (np.int64, (MAX_SEGMENTS + 1, len(system.automata)), 1),
            (float, (MAX_SEGMENTS, system.layout.size), 0),
            (complex, (MAX_SEGMENTS, widest), 0),
            (np.int64, (MAX_SEGMENTS,), 1),
            (float, (MAX_SEGMENTS, 3, system.n), 1),
        ),
    )
