"""Call the compiled event loop: pass the state to the loop, store the results, and return the new state."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from time import perf_counter
from typing import Any

import numpy as np

from hybridsim.engine.events.compiled.known_time import (
    IS_CONTINUED,
    KNOWN,
    SEGMENTS,
    STEPS,
    store_known_times,
)
from hybridsim.engine.events.compiled.scratch import LACKS_TAPE, functions_of
from hybridsim.engine.events.monitor_corners import MonitorCorners
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.events.zeno.accumulation import MAX_EVENTS_PER_TURN, cannot_accumulate
from hybridsim.engine.native.array_layout import ALIGNED, LARGEST, ArrayLayout
from hybridsim.engine.native.constants import MAX_SEGMENTS
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.struct_pack import opaque, replaced
from hybridsim.engine.record.blocks import SegmentBlock
from hybridsim.engine.record.checkpoint import damaged
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.run.event_loop import MIN_STEPS_IN_PART, LoopRecord, call_event_loop, link_event_loop
from hybridsim.engine.run.kernel_run import (
    ARRIVED,
    BEFORE_SOMETHING,
    PAUSED,
    KernelRun,
    LoopResult,
    record_layout,
    skipped_rows,
)
from hybridsim.engine.run.method_kernels import NOT_LINEAR, STEPS_PER_LOOK, CallArrays, MethodKernels
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.known_times import TimesAhead
from hybridsim.engine.system.programs.mode_tables import tape_cache_of
from hybridsim.engine.system.system import System
from hybridsim.engine.system.timetable import Timetable
from hybridsim.engine.system.tolerances import Tolerances

_CALL_DOUBLES = LARGEST // 8  # doubles for the steps of one call, in a reusable block of memory
_NO_OWNERS = np.zeros(0, dtype=np.int64)

_event_loop = Precompiled(call_event_loop)
_compiled: list[Any] = []  # methods whose loops are compiled


def compile_loops(system: System, make: Callable[[System, Tolerances, float], MethodKernels]) -> None:
    """Compile the model's functions for compiled loops, and once per process the event loop itself."""
    functions_of(system)
    if make in _compiled or not system.n:
        return
    kernels = make(system, Tolerances(1e-3, np.full(system.n, 1e-3)), np.inf)
    nowhere = Instant(0.0)
    p = system.vector(nowhere, np.zeros(system.layout.discrete))
    still = Outcome.blank(system, p)
    # a rate may not be a number here; the run reports such an error itself
    with suppress(StepFailure):
        CompiledLoop(kernels).advance(nowhere, still, p, nowhere, Trajectory(system))
        cannot_accumulate(
            np.empty((0, 2)),
            _NO_OWNERS,
            system.owner,
            len(system.automata),
            np.empty((2, MAX_EVENTS_PER_TURN)),
        )
        _compiled.append(make)


class CompiledLoop:
    """The compiled loop of one run, which integrates whole segments with their ordinary events.

    It adds them to the record as blocks (`hybridsim.engine.record.blocks`) and updates its counters.

    Parameters
    ----------
    kernels : the part of the method.
    """

    def __init__(self, kernels: MethodKernels) -> None:
        self.kernels, self.system = kernels, kernels.system
        self.corners: MonitorCorners | None = None  # of the monitors that the loop passes
        self.tape_cache, layout = tape_cache_of(self.system), self.system.layout
        self.kernel_run: KernelRun | None = None  # a call made beforehand, which `advance` takes first
        self.times_ahead: TimesAhead | None = None  # known times of the run, which calls pass
        self.array_layout: ArrayLayout  # of `memory`
        self._layouts: dict[tuple[int, int], ArrayLayout] = {}  # those met so far, also by copies
        self.steps = MAX_SEGMENTS  # largest number of steps in one call
        if kernels.is_continued:
            beside = (MAX_SEGMENTS + 1) * (layout.size + 1) + ALIGNED
            self.steps = max((_CALL_DOUBLES - beside) // kernels.columns, MIN_STEPS_IN_PART)
        self.renew()

    def pass_monitors(self, corners: MonitorCorners) -> None:
        """Make this loop record the events of monitors, although its system represents monitors as corners."""
        self.corners, self.system, self.kernels.recorded = corners, corners.plain, corners.plain

    def look_ahead(self, timetable: Timetable, end: Instant) -> None:
        """Prepare the known times up to the end of the run; later calls process these times."""
        self.times_ahead = TimesAhead(self.kernels.system, timetable, end)

    def fresh_copy(self) -> CompiledLoop:
        """Return a copy of this loop for another run; the loop must not have been used."""
        other: CompiledLoop = object.__new__(type(self))
        other.__dict__ = vars(self).copy()
        other.kernels = self.kernels.fresh_copy()
        return other

    def renew(self) -> None:
        """Allocate new arrays for later calls, because the trajectory keeps the arrays of earlier calls."""
        self.used = (0, 0)  # used rows of steps, and of segments
        self.memory: tuple[np.ndarray, ...] | None = None
        # used rows, and packs of the rows behind them
        self._packed: tuple[tuple[int, int], list[Any]] | None = None

    @property
    def place(self) -> tuple[np.ndarray, ...]:
        """Return the state between two calls as arrays for a checkpoint; the arrays are never modified.

        Either the method's own, or the numbers of used step rows, used segment rows, and all step rows.
        """
        if not self.kernels.is_continued:
            return self.kernels.place
        return (np.array([*self.used, self.steps], dtype=float),)

    @place.setter
    def place(self, place: np.ndarray) -> None:
        if not self.kernels.is_continued:
            self.kernels.place = place
            return
        if not (place.shape == (3,) and ((place >= 0.0) & (place <= max(_CALL_DOUBLES, self.steps))).all()):
            raise damaged("the numbers of rows, segments and steps are out of range")
        rows, segments, steps = (int(number) for number in place)
        if not (1 <= steps <= self.steps and rows <= steps and segments <= MAX_SEGMENTS + 1):
            raise damaged("the numbers of rows, segments and steps are out of range")
        if steps != self.steps:
            self.steps = steps
            self.renew()
        self.used = (rows, segments)

    def go(self, origin: Instant, state: HybridState, target: Instant) -> KernelRun | None:
        """Call the kernel without storing the result in the trajectory; return None if compiled code cannot run."""
        kernels, tape_cache = self.kernels, self.tape_cache
        tapes = tape_cache.with_modes(state.z)
        known = kernels.part_of(self.times_ahead.after(origin).up_to(target)) if self.times_ahead else None
        found = kernels.tables(tapes, state, origin, target)
        if found is None:
            return None
        lin, spare = found
        record, rows = self._record()
        try:
            arrays = spare.pop()
        except IndexError:
            arrays = CallArrays(kernels, state, tapes, lin)
            link_event_loop(
                kernels.loop, arrays.model, arrays.call, arrays.as_packed, arrays.work, record,
                kernels.begin(arrays.own, tapes), rows,
            )  # fmt: skip
        call, own = arrays.call, kernels.begin(arrays.own, tapes)
        if self.times_ahead is not None and known is not None:
            store_known_times(call.known, known, self.times_ahead.resets)
        arrays.state.memory[:] = state.memory
        times = call.times
        (times[0], times[1]), (times[2], times[3]) = known.first if known else target, origin
        call.longest[0] = kernels.longest
        if arrays.rates is not self.system.exact_rates:
            arrays.rates = call.rates[:] = self.system.exact_rates
        model = arrays.model
        if model.tapes is not tapes or model.lin is not lin:
            model = replaced(model, tapes=tapes, lin=lin)
        seconds = 0.0
        while True:
            began = perf_counter()
            code = _event_loop(model, call, arrays.as_packed, arrays.work, record, opaque(own), opaque(rows))
            seconds += perf_counter() - began
            if not (lacks_tapes := arrays.work.int_slots[LACKS_TAPE] != 0):
                break
            more = tape_cache.with_modes(arrays.work.missing)
            found = kernels.tables(more, state, origin, target)
            if found is None or found[1] is not spare:
                break  # the next call has arrays of another form
            tapes, lin = more, found[0]
            model, own = replaced(model, tapes=tapes, lin=lin), kernels.with_tapes(own, tapes)
            call.int_slots[IS_CONTINUED] = 1
        arrays.own = own
        if known is not None:
            call.known.kinds[0] = -1  # another run with these arrays may have no known times ahead
        if lin is NOT_LINEAR:
            tape_cache.look()
        result = kernels.end(own, tapes, lin)
        end, clock, counts = arrays.state.copy(), times[2:].tolist(), call.int_slots.tolist()
        spare.append(arrays)
        return KernelRun(
            self.system, self.array_layout, self.memory, *self.used, code, counts[STEPS], counts[SEGMENTS],
            clock, end, lacks_tapes, seconds, result, known, counts[KNOWN], self.corners,
        )  # fmt: skip

    def _record(self) -> list[Any]:
        """Return the unused rows of the record: a pack for each part of the layout."""
        kernels, (steps, first) = self.kernels, self.used
        if self.memory is None:
            key = self.steps, kernels.columns
            if key not in self._layouts:
                kind = kernels.rows, kernels.keeps_starts, *kernels.fields()
                self._layouts[key] = record_layout(kernels.system, self.steps, *kind)
            self.array_layout = self._layouts[key]
            self.memory, self._packed = self.array_layout.blank(), None
        if self._packed is None or self._packed[0] != self.used:
            skipped = skipped_rows(first, steps, len(kernels.rows._fields))
            self._packed = self.used, self.array_layout.packed(self.memory, skipped)
        return self._packed[1]

    def advance(
        self, origin: Instant, outcome: Outcome, p: np.ndarray, target: Instant, record: Trajectory
    ) -> LoopResult:
        """Run until the target is reached, the arrays are full, or an event needs the Python code; store the result."""
        run, self.kernel_run = self.kernel_run, None
        if run is None:
            state = HybridState.of(outcome, p) if self.corners is None else self.corners.state(outcome, p)
            run = None if state is None else self.go(origin, state, target)
        if run is None:
            return LoopResult(
                origin, outcome.copy, BEFORE_SOMETHING, np.zeros((0, 2)), _NO_OWNERS, None, None
            )
        self.kernels.take(run.result)
        self.count(run, record.counters)
        if run.count:
            self._commit(run, record)
        if run.is_full or not self.kernels.is_continued:
            self.renew()
        may_continue = run.is_full or run.lacks_tapes
        end = ARRIVED if run.is_at_target else PAUSED if may_continue else BEFORE_SOMETHING
        return LoopResult(Instant(*run.clock), run.outcome, end, *run.changes, run.adopted, run.known_passed)

    def count(self, run: KernelRun, counters: Counters) -> None:
        """Add the cost of one call to the counters of the run."""
        run.count_in(counters)
        self.kernels.count(counters, run.steps, run.result)

    def forget_segments(self, run: KernelRun) -> bool:
        """Release the memory of all segments except the run's end; return False if the steps are still needed.

        Fewer steps than one look at stiffness takes are never examined.
        """
        if self.kernels.is_looked_at and run.steps >= STEPS_PER_LOOK:
            return False
        run.forget_segments()
        self.memory = None
        return True

    def segments_of(self, run: KernelRun) -> SegmentBlock:
        """Return the segments that one call of the compiled loop has stored."""
        rows, begun = run.rows, slice(run.first, run.first + run.count)
        rows.last_steps[run.first] = 0
        steps = slice(run.first_step, run.first_step + run.steps)
        return self.kernels.block(
            run.result,
            self.kernels.rows._make([array[steps] for array in rows[len(LoopRecord._fields) :]]),
            rows.last_steps[run.first : run.first + run.count + 1],
            rows.clocks[begun],
            run.plain_modes(rows.modes[begun]),
            rows.vectors[begun],
            rows.jumps[begun],
        )

    def _commit(self, run: KernelRun, record: Trajectory) -> None:
        """Append the segments and events of one call to the trajectory."""
        self.used = (run.first_step + run.steps, run.first + run.count + 1)
        if run.memory is None or (record.segments.is_end_alone and not self.kernels.is_looked_at):
            record.segments.set_end(run.last_end)
        else:
            record.segments.add(self.segments_of(run))
        if run.event_block is not None:
            record.occurrences.add(run.event_block)
