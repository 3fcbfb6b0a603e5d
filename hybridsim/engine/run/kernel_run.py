"""What one call of a compiled loop has left behind: what it wrote, why it ended, and what holds there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.record.event_block import Crossings
from hybridsim.engine.record.segments import Segment, end_point
from hybridsim.engine.run.leap import AT_TARGET, FULL
from hybridsim.engine.system.instant import Instant

if TYPE_CHECKING:
    from hybridsim.engine.events.outcome import Outcome
    from hybridsim.engine.native.struct_pack import Sheet
    from hybridsim.engine.record.counters import Counters
    from hybridsim.engine.run.desk import Laid
    from hybridsim.engine.system.system import System


@dataclass(eq=False)
class Leapt:
    """One call, before it is committed to a trajectory.

    Parameters
    ----------
    sheet, memory : what the record is laid out by, and its blocks, that of the segments and that of the events; None
        once the segments are let go of. What comes from row `first` on was written.
    code, steps, count : what the kernel returned: why it ended, and how many steps and segments there are.
    clock, end : the instant (high, low) where it ended, and what holds there.
    has_news : modes have been met on the way that were not known before, so that it may go on.
    seconds : in compiled code.
    beside : what else its leaper keeps of it.
    vector : the last run-time vector, where the rows have nothing but the events any more.
    """

    system: System
    sheet: Sheet
    memory: tuple[np.ndarray, ...] | None
    first: int
    code: int
    steps: int
    count: int
    clock: list[float]
    end: Laid
    has_news: bool
    seconds: float
    beside: Any
    vector: np.ndarray | None = None

    def __post_init__(self) -> None:
        assert self.memory is not None
        self._happened = rows = self.sheet.rows((None, self.memory[1]))
        first, count = self.first, self.count
        self.events = 0  # how many of the segments an event ended: all but the last one in any case
        if count:  # else there may be no row left
            last = first + count  # where a segment ends is written where the next one would begin
            rows.clocks[last], rows.modes[last] = self.clock, self.end.part("z")
            self.events = count if rows.fires[last - 1] >= 0 else count - 1
        self._crossings: Crossings | None = None

    @cached_property
    def rows(self) -> Any:
        """All arrays of the record, a named tuple."""
        assert self.memory is not None
        return self.sheet.rows(self.memory)

    def after(self) -> Outcome:
        """What holds where it ended."""
        return self.end.outcome()

    @property
    def is_at_target(self) -> bool:
        """Whether it came to where it was to go."""
        return self.code == AT_TARGET

    @property
    def is_full(self) -> bool:
        """Whether it ended for want of room."""
        return self.code == FULL

    @property
    def instants(self) -> np.ndarray:
        """Instants of the events (E, 2)."""
        return self._happened.clocks[self.first + 1 : self.first + 1 + self.events]

    @property
    def owners(self) -> np.ndarray:
        """Components whose guards these events are (E,)."""
        return self.system.owner[self.fires]

    @property
    def fires(self) -> np.ndarray:
        """Numbers of these guards (E,)."""
        return self._happened.fires[self._ended]

    @property
    def crossings(self) -> Crossings | None:
        """The events; None if there are none."""
        if self._crossings is None and self.events:
            rows, ended = self._happened, self._ended
            after = slice(ended.start + 1, ended.stop + 1)
            self._crossings = Crossings(
                self.system,
                rows.clocks[after],
                rows.fires[ended],
                rows.modes[ended],
                rows.modes[after],
                rows.jumps[ended, -2:],  # the states at its end; more begins with that at its start
            )
        return self._crossings

    @property
    def ends_in_event(self) -> bool:
        """Whether an event ended the last of its segments, so that another state follows at the very same time."""
        return self.count > 0 and self.events == self.count

    def count_in(self, counters: Counters) -> None:
        """Add what every call costs."""
        counters.kernel_time += self.seconds
        counters.steps += self.steps
        counters.restarts += self.count
        counters.events += len(self.crossings or ())

    @property
    def last_end(self) -> Segment:
        """The end of the last segment."""
        rows, last = self._happened, self.first + self.count - 1
        vector = self.rows.vectors[last] if self.vector is None else self.vector
        return end_point(Instant(*self.clock), rows.modes[last], vector, rows.jumps[last, -2])

    def forget_segments(self) -> None:
        """Let go of the memory of the segments; there is the end of the last one alone then."""
        assert self.memory is not None
        self.vector = self.sheet.row(self.memory, "vectors", self.first + self.count - 1)
        vars(self).pop("rows", None)
        self.sheet.take_back(self.memory[0])
        self.memory = None

    @property
    def _ended(self) -> slice:
        return slice(self.first, self.first + self.events)
