"""The interface between the compiled event loop and a method: a segment kernel, its arrays, its record."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.known_time import ORIGIN_AT, PHASES_AT, SIGNALS_AT, known_time_arrays
from hybridsim.engine.events.compiled.scratch import work_space
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.linear.tables import no_tables
from hybridsim.engine.native.struct_pack import packed, replaced
from hybridsim.engine.record.blocks import SegmentBlock
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.series_block import SeriesBlock
from hybridsim.engine.run.event_loop import LoopCall, LoopModel
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.known_times import KnownTimes
from hybridsim.engine.system.per_structure import spare_scratch
from hybridsim.engine.system.programs.mode_tables import Tapes, automata_of
from hybridsim.engine.system.system import System

NOT_LINEAR = no_tables()  # for kernels without tables of linear modes
STEPS_PER_LOOK = 500  # a method with `is_looked_at` is examined for stiffness after so many steps


class StepRows(NamedTuple):
    """The stored steps of methods whose dense output is a polynomial in each step."""

    steps: np.ndarray  # start and length (S, 2) in local time
    # coefficients (S, n, terms) of the states: from the start of the step, or from both ends
    series: np.ndarray


class MethodKernels(ABC):
    """The compiled functions and data of one method for the event loop of one run.

    ``segment(start, model, call, state, work, own, rows)`` is an `inlined` kernel from `SegmentStart` to `SegmentEnd`.
    `loop` is a plain function that passes it to `event_loop`; both are compiled together. The other arguments of a
    segment are the packs `LoopModel`, `LoopCall`, `StateArrays`, `EventScratch`, and two of the method: `arrays` and
    the arrays of `fields`. It follows one segment from local time 0, in the modes of row ``start.mode_row`` of the
    tapes:

    1. The segment begins in ``state``, which the kernel must not change. It ends at the latest at local time
       ``start.bound``. If it would be longer than ``call.longest``, return ``not_followed(STOPPED)``.
    2. It ends at the first zero of an active guard. If zeros are not certain, or any number is not finite, the outcome
       is STOPPED; the general loop then takes the segment. It is FULL if the arrays are full.
    3. Otherwise it is FOLLOWED. Write the states at the end to ``work.y``, the largest states to ``call.scale``. At
       the bound no guard may be zero within rounding; see `hybridsim.engine.events.compiled.at_end`. An end before
       the bound without a guard divides the segment.
    4. For a guard write also the rates to ``work.slopes``. Its ``bend`` is 0 if the guard is certain to become
       negative.
    5. Write steps from row ``call.int_slots[STEPS]`` of the record on, and other data in row
       ``call.int_slots[SEGMENTS]``.
    6. A kernel may set origin and inputs of the next segment in ``state.p`` (`set_origin`, `set_inputs`), and return
       ``at = 0`` and ``is_ahead``. If ``start.is_ahead`` is set then, nothing has changed p since.
    7. If ``start.is_rejected`` is set, the last segment is not committed: restore what the kernel remembers of it, and
       the outcome is STOPPED. If ``work.int_slots[LACKS_TAPE]`` is set, a later call repeats this segment: restore also
       what the kernel counts.
    """

    loop: ClassVar[Callable[..., int]]
    rows: ClassVar[Any]  # named tuple of the method's part of the record, with a row for each step
    is_looked_at: ClassVar[bool] = False  # whether steps are examined after a call, even if they are not kept
    is_continued: ClassVar[bool] = True  # whether calls share one record until it is full
    remembers: ClassVar[bool] = False  # whether a call depends on earlier calls of the run
    keeps_starts: ClassVar[bool] = False  # whether the record keeps the state at the start of each segment
    kind: str  # name of the arrays, which are reused from run to run
    columns: int  # doubles that are recorded for each step

    def __init__(self, system: System, longest: float) -> None:
        self.system, self.longest = system, longest
        self.recorded = system  # the system of the segments, which may have monitors in place of corners
        self._reusable: tuple[Any, deque[Any]] | None = None

    def fresh_copy(self) -> MethodKernels:
        """Return a copy for another run, or this object if the method stores nothing between calls."""
        if not self.remembers:
            return self
        other: MethodKernels = object.__new__(type(self))
        other.__dict__ = vars(self).copy()
        return other

    @abstractmethod
    def arrays(self) -> Any:
        """Return new arrays for one call of the compiled loop."""

    @abstractmethod
    def fields(self) -> Sequence[tuple[Any, tuple[int, ...]]]:
        """Return the dtype and the row shape of each array in `rows`."""

    @abstractmethod
    def block(
        self,
        result: Any,
        rows: Any,
        last_steps: np.ndarray,
        origins: np.ndarray,
        modes: np.ndarray,
        vectors: np.ndarray,
        jumps: np.ndarray,
    ) -> SegmentBlock:
        """Return the segments of a call as one block; `last_steps` contains the last step of each segment."""

    def part_of(self, known: KnownTimes) -> KnownTimes:
        """Return the known times that one call can process: all of the given times, or only the first times."""
        return known

    def tables(
        self, tapes: Tapes, state: HybridState, origin: Instant, target: Instant
    ) -> tuple[Any, deque[Any]] | None:
        """Return the tables of linear modes and reusable arrays, or None if the kernel cannot be called."""
        if self._reusable is None:
            self._reusable = NOT_LINEAR, spare_scratch(self.system, self.kind)
        return self._reusable

    def begin(self, own: Any, tapes: Tapes) -> Any:
        """Write the settings of the run to the arrays before a call, and return the arrays."""
        return self.with_tapes(own, tapes)

    def with_tapes(self, own: Any, tapes: Tapes) -> Any:
        """Return the arrays of a call, adapted to the given instruction tapes."""
        return own

    def end(self, own: Any, tapes: Tapes, lin: Any) -> Any:
        """Return the results of a call that are not part of its record."""
        return None

    def count(self, counters: Counters, steps: int, result: Any) -> None:
        """Add the cost of the steps to the counters; the number of steps is counted elsewhere."""
        return

    def take(self, result: Any) -> None:
        """Store the parts of a result that the next call of this run needs."""
        return

    @property
    def place(self) -> tuple[np.ndarray, ...]:
        """Return the method's state between calls as arrays, for a checkpoint."""
        return ()

    @place.setter
    def place(self, place: np.ndarray) -> None:
        """Restore the method's state between calls from a checkpoint."""
        return


class StepKernels(MethodKernels):
    """The kernels of a method that records `terms` coefficients of each state for each step.

    adapted: names of attributes that provide arrays for the instruction tapes of the run, by their method `of`.
    """

    rows = StepRows
    blocks: ClassVar[type[SeriesBlock]] = SeriesBlock
    adapted: ClassVar[tuple[str, ...]] = ("parts", "codes")

    def __init__(self, system: System, longest: float, terms: int) -> None:
        super().__init__(system, longest)
        self.terms, self.columns = terms, system.n * terms + 2

    def fields(self) -> Sequence[tuple[Any, tuple[int, ...]]]:
        """Return the dtype and the row shape of each array in `rows`."""
        return (float, (2,)), (float, (self.system.n, self.terms))

    def of_tapes(self, tapes: Tapes) -> dict[str, Any]:
        """Return by name the arrays that belong to the given instruction tapes."""
        return {name: getattr(self, name).of(tapes) for name in self.adapted}

    def with_tapes(self, own: Any, tapes: Tapes) -> Any:
        """Return the arrays of a call, adapted to the given instruction tapes."""
        return replaced(own, **self.of_tapes(tapes))

    def block(self, result: Any, rows: Any, last_steps: np.ndarray, *record: np.ndarray) -> SeriesBlock:
        """Return the segments that one call of the compiled loop has stored."""
        return self.blocks(self.recorded, last_steps, *rows, *record)


class CallArrays:
    """The arrays of one call of a compiled loop, which later calls reuse.

    Parameters
    ----------
    like : a state of the system.
    lin : tables of linear modes of the shape for which the arrays are made.
    """

    def __init__(self, kernels: MethodKernels, like: HybridState, tapes: Any, lin: Any) -> None:
        system, layout = kernels.system, kernels.system.layout
        self.state = like.copy()
        self.as_packed = self.state.packed()
        self.work = work_space(system, len(lin.kinds), len(lin.factors))
        self.call: LoopCall = packed(
            LoopCall(
                int_slots=np.zeros(7, dtype=np.int64),
                longest=np.zeros(1),
                times=np.zeros(4),
                rates=np.zeros((layout.phases, 2)),
                scale=np.empty(system.n),
                pace=np.empty(5),
                known=known_time_arrays(system),
            )
        )
        offsets = layout.origin_at, layout.phases_at, layout.signals_at
        self.call.int_slots[[ORIGIN_AT, PHASES_AT, SIGNALS_AT]] = offsets
        self.rates: np.ndarray | None = None  # those in `call`
        self.own = kernels.arrays()
        self.model: LoopModel = packed(LoopModel(automata_of(system), tapes, system.registers.inputs, lin))
