"""The result of one call of a compiled loop: its record, the reason for its end, and the final state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.monitor_corners import MonitorCorners
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.state import HybridState
from hybridsim.engine.native.array_layout import ArrayLayout
from hybridsim.engine.native.constants import MAX_SEGMENTS
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.event_block import AT_KNOWN_TIME, EventBlock
from hybridsim.engine.record.segments import Segment, end_point
from hybridsim.engine.run.event_loop import AT_TARGET, FULL, NO_GUARD, LoopRecord
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.known_times import KnownTimes
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System

ARRIVED, PAUSED, BEFORE_SOMETHING = 0, 1, 2  # why a compiled call ended
_NO_STATES = np.zeros(0)


@per_structure
def record_layout(
    system: System, steps: int, rows: Any, keeps_starts: bool, *fields: tuple[Any, tuple[int, ...]]
) -> ArrayLayout:
    """Return the layout of the arrays that the kernels write, with separate memory blocks for events and for steps."""
    return ArrayLayout(
        (LoopRecord, rows),
        (
            # one row more, for the end of the last segment
            (float, (MAX_SEGMENTS + 1, 2), 1),
            (np.int64, (MAX_SEGMENTS + 1, len(system.automata)), 1),
            (float, (MAX_SEGMENTS, system.layout.size), 0),
            (np.int64, (MAX_SEGMENTS + 1,), 0),
            (np.int64, (MAX_SEGMENTS,), 1),
            (float, (MAX_SEGMENTS, 3 if keeps_starts else 2, system.n), 1),
            *((dtype, (steps, *shape), 0) for dtype, shape in fields),
        ),
    )


def skipped_rows(first: int, steps: int, count: int) -> tuple[int, ...]:
    """Return how many leading rows of each array a call has to skip."""
    return (first, first, first, first + 1, first, first, *(steps,) * count)


class LoopResult(NamedTuple):
    """The end of a compiled call: the origin and the state of the next segment, and the reason for the end.

    end: ARRIVED at the target, PAUSED because the arrays are full, or BEFORE_SOMETHING that is not ordinary. instants,
    owners: see `KernelRun.changes`. outcome: makes the state on demand.
    adopted: the last instant at which anything was resolved. passed: the known times on the way.
    """

    origin: Instant
    outcome: Callable[[], Outcome]
    end: int
    instants: np.ndarray
    owners: np.ndarray
    adopted: Instant | None
    passed: KnownTimesPassed | None


class KnownTimesPassed(NamedTuple):
    """The known times that a compiled call passed.

    last: the last one. steps: number of steps since then. x: state (n,) just after it. ahead: those not passed.
    """

    last: Instant | None
    steps: int
    x: np.ndarray
    ahead: KnownTimes


@dataclass(eq=False)
class KernelRun:
    """The result of one call, before its segments and events are stored in a trajectory.

    Parameters
    ----------
    array_layout, memory : layout of the record, and its two blocks of memory, for segments and for events. The memory
        is None after the segments are released. The call wrote from rows `first_step` and `first` on.
    code, steps, count : why the call ended, and the numbers of steps and segments.
    clock, end : the instant (high, low) at which it ended, and the state there.
    lacks_tapes : whether it ended before an event that needs more instruction tapes, so that another call continues.
    seconds : time in compiled code.
    result : further results of the method.
    known, passed : the known times ahead of the call, and how many it passed.
    corners : the corners in place of monitors, if there are any.
    vector : the last run-time vector, if only the events are kept.
    """

    system: System
    array_layout: ArrayLayout
    memory: tuple[np.ndarray, ...] | None
    first_step: int
    first: int
    code: int
    steps: int
    count: int
    clock: list[float]
    end: HybridState
    lacks_tapes: bool
    seconds: float
    result: Any
    known: KnownTimes | None
    passed: int
    corners: MonitorCorners | None = None
    vector: np.ndarray | None = None

    def __post_init__(self) -> None:
        assert self.memory is not None
        self._event_memory, last = self.memory[1], self.first + self.count - 1
        self._fires = self._array("fires")
        self.events = self.count  # number of segments that an event ended: all, or all except the last
        if self.count and self._fires[last] == NO_GUARD:
            self.events -= 1
        self._event_block: EventBlock | None = None

    def _array(self, name: str) -> np.ndarray:
        """Return an array of event data by its name."""
        return self.array_layout.array((None, self._event_memory), name)

    @cached_property
    def rows(self) -> Any:
        """Return all arrays of the record as a named tuple."""
        assert self.memory is not None
        return self.array_layout.rows(self.memory)

    @property
    def is_at_target(self) -> bool:
        """Return whether the call ended at its target or at a known time that needs the Python code."""
        known = self.known
        return self.code == AT_TARGET and not (known and known.is_part and self.passed == len(known.kinds))

    @property
    def is_full(self) -> bool:
        """Return whether the call ended because arrays were full or because it covered only the first known times."""
        return self.code == FULL or (self.code == AT_TARGET and not self.is_at_target)

    @property
    def instants(self) -> np.ndarray:
        """Return the instants (E, 2) at which guards fired."""
        found = self._array("clocks")[self.first + 1 : self.first + 1 + self.events]
        return found if self._has_guards_alone else found[self._have_fired]

    @property
    def changes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the instants (E, 2) at which components changed their modes or were reset, and the components (E,).

        An impact also changes the sides of contacts whose guards have not fired.
        """
        if self.system.is_unilateral.any() and self.event_block is not None:
            return self.event_block.changes_of_components()
        return self.instants, self.system.owner[self.fires]

    @property
    def adopted(self) -> Instant | None:
        """Return the last instant at which a guard fired or a known time was passed, or None if there is none."""
        return Instant(*self._array("clocks")[self.first + self.events].tolist()) if self.events else None

    @property
    def known_passed(self) -> KnownTimesPassed | None:
        """Return the known times that were passed, or None for a call without known times."""
        if self.known is None:
            return None
        ahead = self.known.since(self.passed)
        if not self.passed:
            return KnownTimesPassed(None, 0, _NO_STATES, ahead)
        rows = self.rows
        last = self.first + int(np.flatnonzero(self._fires[self._ended] <= AT_KNOWN_TIME)[-1])
        steps = self.steps - int(rows.last_steps[last + 1])
        return KnownTimesPassed(self.known.instant(self.passed - 1), steps, rows.jumps[last, -1], ahead)

    @property
    def fires(self) -> np.ndarray:
        """Return the indices (E,) of the guards that fired."""
        found = self._fires[self._ended]
        return found if self._has_guards_alone else found[self._have_fired]

    @property
    def _has_guards_alone(self) -> bool:
        """Return whether all segments ended at guards of the model."""
        return not self.passed and self.corners is None

    @property
    def _have_fired(self) -> np.ndarray:
        """Return a mask of the segments that a guard has ended."""
        fires = self._fires[self._ended]
        return np.asarray((fires >= 0) & (fires < self.system.guard_count))

    def plain_modes(self, modes: np.ndarray) -> np.ndarray:
        """Return modes (k, C) without the columns of the corners that represent monitors."""
        return modes if self.corners is None else np.ascontiguousarray(modes[:, : len(self.system.automata)])

    def outcome(self) -> Outcome:
        """Return the state at the end."""
        return self.end.outcome() if self.corners is None else self.corners.outcome(self.end)

    @property
    def event_block(self) -> EventBlock | None:
        """Return the events as one block, or None if there are none."""
        if self._event_block is None and self.events:
            ended = self._ended
            after = slice(ended.start + 1, ended.stop + 1)
            modes = self._array("modes")[ended.start : after.stop]
            modes = modes if self.corners is None else self.corners.sides(modes)
            self._event_block = EventBlock(
                self.system,
                self._array("clocks")[after],
                self._fires[ended],
                modes[:-1],
                modes[1:],
                self._array("jumps")[ended, -2:],  # the states at its end, after the state at its start
                self.known.due if self.known is not None and self.passed else (),
            )
        return self._event_block

    @property
    def ends_in_event(self) -> bool:
        """Return whether an event ended the last segment, so that another state follows at the same time."""
        return self.count > 0 and self.events == self.count

    def count_in(self, counters: Counters) -> None:
        """Add the costs that every kernel counts to the counters of the run."""
        counters.kernel_time += self.seconds
        counters.steps += self.steps
        counters.restarts += self.count
        counters.events += self.event_block.changes if self.event_block is not None else 0

    @property
    def last_end(self) -> Segment:
        """Return the time and the state at the end of the last segment."""
        last = self.first + self.count - 1
        vector = self.rows.vectors[last] if self.vector is None else self.vector
        return end_point(
            Instant(*self.clock),
            self.plain_modes(self._array("modes")[last : last + 1])[0],
            vector,
            self._array("jumps")[last, -2],
        )

    def forget_segments(self) -> None:
        """Release the memory of the segments, except for the end of the last segment."""
        assert self.memory is not None
        self.vector = self.array_layout.array(self.memory, "vectors")[self.first + self.count - 1].copy()
        vars(self).pop("rows", None)
        self.array_layout.take_back(self.memory[0])
        self.memory = None

    @property
    def _ended(self) -> slice:
        return slice(self.first, self.first + self.events)
