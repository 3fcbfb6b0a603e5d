"""Call the compiled mode loop from the general one: pass the state in, commit segments and events, return the state."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from hybridsim.engine.events.compiled.after_segment import link_event_resolution
from hybridsim.engine.events.compiled.scratch import functions_of, work_space
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.zeno.accumulation import MAX_EVENTS_PER_TURN, cannot_accumulate
from hybridsim.engine.linear.tables import no_tables
from hybridsim.engine.native.constants import MAX_SEGMENTS, TIGHTEST
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.struct_pack import ALIGNED, LARGEST, ArrayLayout, packed
from hybridsim.engine.record.blocks import SegmentBlock
from hybridsim.engine.record.checkpoint import damaged
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.series_block import SeriesBlock
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.roots.defect_check import ahead_size
from hybridsim.engine.run.call_arrays import CallArrays, StateBuffer, buffer_of
from hybridsim.engine.run.event_loop import MIN_STEPS_IN_PART, Record, Scratch, event_loop
from hybridsim.engine.run.kernel_run import KernelRun
from hybridsim.engine.run.stepping import ARRIVED, BEFORE_SOMETHING, PAUSED, CompiledLoop, LoopResult
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.per_structure import per_structure, spare_scratch
from hybridsim.engine.system.programs.code_cache import CodeCache, series_codes
from hybridsim.engine.system.programs.mode_code import most_fading
from hybridsim.engine.system.programs.mode_tables import automata_of, tape_cache_of
from hybridsim.engine.system.series_at import series_order
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances

_CALL_DOUBLES = LARGEST // 8  # doubles for the steps of one call, in a reusable block of memory
_NO_OWNERS = np.zeros(0, dtype=np.int64)
NOT_LINEAR = no_tables()  # for kernels without tables of linear modes


# (system, tolerances, longest segment) -> compiled loop
Maker = Callable[[System, Tolerances, float], CompiledLoop]

_compiled: list[Maker] = []


def compile_loops(system: System, make: Maker) -> None:
    """Compile the functions of this system that compiled loops call, and once per process the loop itself."""
    functions_of(system)
    if make in _compiled or not system.n:
        return
    compiled_loop = make(system, Tolerances(1e-3, np.full(system.n, 1e-3)), math.inf)
    nowhere, none = Instant(0.0), np.zeros(0, dtype=np.int64)
    guards, n = system.guard_count, system.n
    modes = np.zeros(len(system.automata), dtype=np.int64)
    p = system.vector(nowhere, np.zeros(system.layout.discrete))
    still = Outcome(
        np.zeros(n),
        p,
        modes,
        np.ones(guards, dtype=np.int64),
        np.zeros(guards, dtype=np.int64),
        none,
        none,
        np.zeros(n),
        np.zeros(guards),
        np.zeros(0),
    )
    # a rate may not be a number here; the run reports such an error itself
    with suppress(StepFailure):
        compiled_loop.advance(nowhere, still, p, nowhere, Trajectory(system))
        cannot_accumulate(
            np.empty((0, 2)), none, system.owner, len(system.automata), np.empty((2, MAX_EVENTS_PER_TURN))
        )
        _compiled.append(make)


class CompiledLoopBase(ABC):
    """A compiled loop for one run; subclasses define the kernel.

    Parameters
    ----------
    columns : number of columns that the kernel records for each step and state.
    kind : name of the scratch arrays, which are reused from run to run; each call takes a set of its own.
    """

    is_looked_at: ClassVar[bool] = False  # whether steps are examined after a call, even if they are not kept
    codes: CodeCache  # machine code of the modes
    taken: tuple[Any, Any]  # tapes of the last call, and their machine code

    def __init__(self, system: System, columns: int, kind: str) -> None:
        self.system, self.columns, layout = system, columns, system.layout
        self.tape_cache, self.automata = tape_cache_of(system), automata_of(system)
        self.functions = functions_of(system)
        self.inputs = system.registers.inputs
        self.phase_layout = (
            system.rates,
            layout.origin_at,
            layout.phases_at,
        )
        self.spare = spare_scratch(system, kind)
        self.kernel_run: KernelRun | None = None  # a call made beforehand, which `advance` takes first
        beside = (MAX_SEGMENTS + 1) * (layout.size + 1) + ALIGNED
        # largest number of steps in one call
        self.steps = max((_CALL_DOUBLES - beside) // (system.n * columns + 2), MIN_STEPS_IN_PART)
        self._renew()

    def fresh_copy(self) -> CompiledLoop:
        """Return a copy for another run."""
        other: CompiledLoop = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    @abstractmethod
    def _scratch(self) -> Any:
        """Return scratch arrays of the kernel for one call."""

    @abstractmethod
    def _go(
        self,
        to: np.ndarray,
        clock: np.ndarray,
        state: Any,
        work: Any,
        scratch: Any,
        rows: Any,
    ) -> tuple[int, int, int]:
        """Run the kernel on rows of the record. Return why it ended, and the numbers of steps and segments."""

    @abstractmethod
    def _cost(self, scratch: Any) -> Any:
        """Return the cost of a call except for its number of steps."""

    @abstractmethod
    def _count(self, counters: Counters, steps: int, cost: Any) -> None:
        """Add the cost of the steps to the counters, except for their number."""

    def _block(self, *arrays: np.ndarray) -> SegmentBlock:
        """Return the segments in the arrays as a `SeriesBlock`."""
        return SeriesBlock(self.system, *arrays)

    def _renew(self) -> None:
        """Allocate new arrays to write to; committed blocks keep the former ones."""
        self.used = (0, 0)  # used rows of steps, and of segments
        self.array_layout = self._array_layout()
        self.memory: tuple[np.ndarray, ...] | None = (
            None  # memory with the layout of the record, allocated on first use
        )

    def _array_layout(self) -> ArrayLayout:
        """Return the layout of the arrays that the kernel writes; the trajectory keeps events longer than steps."""
        return _step_layout(self.system, self.steps, self.columns)

    @property
    def place(self) -> tuple[np.ndarray, ...]:
        """Return the numbers of used step rows, used segment rows, and all step rows, for a checkpoint."""
        return (np.array([*self.used, self.steps], dtype=float),)

    @place.setter
    def place(self, place: np.ndarray) -> None:
        if not (place.shape == (3,) and ((place >= 0.0) & (place <= max(_CALL_DOUBLES, self.steps))).all()):
            raise damaged("the row counts of the run")
        rows, segments, steps = (int(number) for number in place)
        if not (1 <= steps <= self.steps and rows <= steps and segments <= MAX_SEGMENTS + 1):
            raise damaged("the row counts of the run")
        if steps != self.steps:
            self.steps = steps
            self._renew()
        self.used = (rows, segments)

    def go(self, origin: Instant, buffer: StateBuffer, target: Instant) -> KernelRun:
        """Call the kernel."""
        self.tape_cache.surround(buffer.part("z"))
        try:
            call_arrays = self.spare.pop()
        except IndexError:
            call_arrays = CallArrays.of(buffer, work_space(self.system), self._scratch())
            link_event_resolution(
                self.automata,
                self.tape_cache.tapes,
                self.inputs,
                NOT_LINEAR,
                call_arrays.as_packed,
                call_arrays.work,
            )
        call_arrays.set_state(buffer)
        clock, to = call_arrays.clock, call_arrays.target
        clock[0], clock[1] = origin
        to[0], to[1] = target
        # counted before the call, because another thread may add the modes that this call misses
        known = len(self.tape_cache.tapes.modes)
        rows, began = self._rows(), perf_counter()
        code, steps, count = self._go(
            to, clock, call_arrays.as_packed, call_arrays.work, call_arrays.scratch, rows
        )
        seconds = perf_counter() - began
        self.tape_cache.look()
        self.codes.look(*self.taken)
        cost = self._cost(call_arrays.scratch)
        end, at = call_arrays.final_state(), clock.tolist()
        self.spare.append(call_arrays)
        self.tape_cache.surround(end.part("z"))
        has_news = len(self.tape_cache.tapes.modes) != known
        assert self.memory is not None
        first_step, first = self.used
        return KernelRun(
            self.system,
            self.array_layout,
            self.memory,
            first,
            code,
            steps,
            count,
            at,
            end,
            has_news,
            seconds,
            (first_step, cost),
        )

    def advance(
        self, origin: Instant, outcome: Outcome, p: np.ndarray, target: Instant, record: Trajectory
    ) -> LoopResult:
        """Run until an event that is not ordinary, the target, or the end of the arrays, and commit the result."""
        kernel_run, self.kernel_run = self.kernel_run or self.go(origin, buffer_of(outcome, p), target), None
        instants: list[np.ndarray] = []
        owners: list[np.ndarray] = []
        while True:
            self.memory = kernel_run.memory
            self.count(kernel_run, record.counters)
            is_full = kernel_run.is_full
            if kernel_run.count:
                self._commit(kernel_run, record)
                instants.append(kernel_run.instants)
                owners.append(kernel_run.owners)
            if is_full:
                self._renew()
            if is_full or not kernel_run.has_news:
                break
            kernel_run = self.go(Instant(*kernel_run.clock), kernel_run.end, target)
        end = PAUSED if is_full else (ARRIVED if kernel_run.is_at_target else BEFORE_SOMETHING)
        if len(instants) == 1:
            return LoopResult(Instant(*kernel_run.clock), kernel_run.after, end, instants[0], owners[0])
        all_instants = np.concatenate([np.empty((0, 2)), *instants])
        return LoopResult(
            Instant(*kernel_run.clock),
            kernel_run.after,
            end,
            all_instants,
            np.concatenate([_NO_OWNERS, *owners]),
        )

    def count(self, kernel_run: KernelRun, counters: Counters) -> None:
        """Add the cost of a call to the counters."""
        kernel_run.count_in(counters)
        self._count(counters, kernel_run.steps, kernel_run.beside[1])

    def forget_segments(self, kernel_run: KernelRun) -> bool:
        """Release all segments except the end of the last one. Return False if their steps are needed."""
        if self.is_looked_at:
            return False
        kernel_run.forget_segments()
        self.memory = None
        return True

    def _rows(self) -> Any:
        """Return the rows that the next call writes."""
        steps, first = self.used
        if self.memory is None:
            self.memory = self.array_layout.blank()
        return self.array_layout.packed(self.memory, (steps, steps, first + 1, *(first,) * 5))

    def segments_of(self, kernel_run: KernelRun) -> SegmentBlock:
        """Return the segments of a call, which must have stored some and released none."""
        first_step, first = kernel_run.beside[0], kernel_run.first
        lengths, series, ends, origins, modes, vectors, _, jumps = kernel_run.rows
        steps, begun = (
            slice(first_step, first_step + kernel_run.steps),
            slice(first, first + kernel_run.count),
        )
        ends[first] = 0
        return self._block(
            ends[first : first + kernel_run.count + 1],
            lengths[steps],
            series[steps],
            origins[begun],
            modes[begun],
            vectors[begun],
            jumps[begun],
        )

    def _commit(self, kernel_run: KernelRun, record: Trajectory) -> None:
        """Add the segments and events of one call to the trajectory."""
        self.used = (kernel_run.beside[0] + kernel_run.steps, kernel_run.first + kernel_run.count + 1)
        if record.segments.is_end_alone and not self.is_looked_at:
            record.segments.set_end(kernel_run.last_end)
        else:
            record.segments.add(self.segments_of(kernel_run))
        if kernel_run.event_block is not None:
            record.occurrences.add(kernel_run.event_block)


@per_structure
def _step_layout(system: System, steps: int, columns: int) -> ArrayLayout:
    return ArrayLayout(
        Record,
        (
            (float, (steps, 2), 0),
            (float, (steps, system.n, columns), 0),
            # one row more, for the end of the last segment
            (np.int64, (MAX_SEGMENTS + 1,), 0),
            (float, (MAX_SEGMENTS + 1, 2), 1),
            (np.int64, (MAX_SEGMENTS + 1, len(system.automata)), 1),
            (float, (MAX_SEGMENTS, system.layout.size), 0),
            (np.int64, (MAX_SEGMENTS,), 1),
            (float, (MAX_SEGMENTS, 2, system.n), 1),
        ),
    )


_event_loop = Precompiled(event_loop)


class TaylorLoop(CompiledLoopBase):
    """The compiled loop of Taylor series."""

    def __init__(self, system: System, tolerances: Tolerances, longest: float) -> None:
        rtol = max(tolerances.rtol, TIGHTEST)
        self.order = series_order(rtol, system.is_linear)
        super().__init__(system, self.order + 1, f"order {self.order}")
        self.codes = series_codes(system, self.order)
        self.control = (rtol, tolerances.atol, self.order, tolerances.max_step, longest)

    def _scratch(self) -> Any:
        system, order, n = self.system, self.order, self.system.n
        registers, guards = system.registers.count, system.guard_count
        scratch: Scratch = packed(
            Scratch(
                V=np.zeros((registers, order + 1)),
                W=np.zeros((registers, order + 1)),
                guard_series=np.zeros((guards + most_fading(system), order + 1)),
                ahead=np.empty(ahead_size(order, n, guards)),
                sizes=np.empty(order + 1 + guards + most_fading(system)),
                numbers=np.arange(guards, dtype=np.int64),
                everyone=np.arange(n, dtype=np.int64),
                a=np.empty(order + 1),
                b=np.empty(order + 1),
                stack=np.empty((64, order + 3)),
                floors=np.empty(guards),
                pace=np.empty(3),
                largest=np.empty(guards),
                scale=np.empty(n),
                **{name: np.empty(guards, dtype=np.int64) for name in ("sides", "orders", "guard_registers")},
            )
        )
        return scratch

    def _go(
        self,
        to: np.ndarray,
        clock: np.ndarray,
        state: Any,
        work: Any,
        scratch: Any,
        rows: Any,
    ) -> tuple[int, int, int]:
        tapes = self.tape_cache.tapes  # read once, because another thread may replace them
        codes = self.codes.of(tapes)
        code, steps, count = _event_loop(
            self.functions, self.automata, tapes, self.inputs, NOT_LINEAR, codes, self.phase_layout, self.control,
            to, clock, state, work, scratch, rows,
        )  # fmt: skip
        self.taken = tapes, codes
        return code, steps, count

    def _cost(self, scratch: Any) -> None:
        """Return None: Taylor steps have no further cost."""

    def _count(self, counters: Counters, steps: int, cost: None) -> None:
        counters.rhs_evaluations += 2 * steps  # one series and one check per step
