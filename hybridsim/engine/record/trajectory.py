"""What a run leaves behind: segments with dense output, events, and how it ended."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from hybridsim.engine.record.block_list import Chain, SegmentChain
from hybridsim.engine.record.blocks import OccurrenceList
from hybridsim.engine.record.checkpoint import Checkpoint
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.limits import UNLIMITED, Limits
from hybridsim.engine.record.retention import ALL, Keep
from hybridsim.engine.record.segments import Occurrence, Pieces, Segment, end_point
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

# Events that a run may look back on where bounces come to an end. What is shown of it must not change what is found.
LOOKED_BACK_ON = 4096

Made = Callable[[int, int], Checkpoint]  # of how many segments and occurrences were recorded since

__all__ = ["LOOKED_BACK_ON", "Occurrence", "Pieces", "Segment", "Task", "Trajectory"]


class Trajectory:
    """The record of a run.

    segments and occurrences are sequences of `Segment` and `Occurrence`: append objects to them, or add the blocks
    (`hybridsim.engine.record.blocks`) that a compiled loop leaves behind. What is older than is to be kept is let go
    on the way, so that a run of any length takes no more memory than what it keeps. taken_over: the stiff method that
    went on from some time on, and that time.
    """

    taken_over: tuple[str, float] | None = None

    def __init__(self, system: System, keep: Keep = ALL) -> None:
        # the last segment is needed in any case: it says where a run ends
        self.segments = SegmentChain(system, 0.0 if keep.segments is None else keep.segments)
        self._may_bounce = system.may_bounce
        least = LOOKED_BACK_ON if self._may_bounce else 0
        self.occurrences: Chain[Occurrence] = Chain(OccurrenceList, keep.events, least)
        self.hidden: list[Any] = []  # the blocks of occurrences before some were let go of, to go on with
        self.counters = Counters()
        self.status, self.message = "finished", ""
        self.warnings_there: dict[str, int] = {}  # those up to the checkpoint
        self.warnings: dict[str, int] = {}  # message -> how often
        self._checkpoint: Checkpoint | Callable[[], Checkpoint] | None = None
        self._mark: tuple[Made, tuple[int, int], tuple[int, int], dict[str, int]] | None = None

    def stop_early(self, status: str, why: str, start: float) -> None:
        """Say of a run that stopped before its end why, where its solution ends (begun at `start`), how it goes on."""
        head = f"{why}; stopped" if why else "interrupted"
        reached = float(self.segments[-1].end) if self.segments else start
        self.status = status
        self.message = f"{head} at t = {reached!r}; what was computed is kept, and sol.resume() goes on"

    def finish(self, instant: Instant, z: np.ndarray, p: np.ndarray, x: np.ndarray, discrete: slice) -> None:
        """Keep the state after an event at the very end of the run, which no segment begins with."""
        if self.segments:
            if float(self.segments.blocks[-1].until) != float(instant):
                return
            last = self.segments[-1]
            if (last.z == z).all() and (last.x[-1] == x).all() and (last.p[discrete] == p[discrete]).all():
                return
        self.segments.append(end_point(instant, z, p, x))

    def close(self, keep: Keep) -> None:
        """Let go of everything that is not to be kept, to the exact time."""
        if keep == ALL or not self.segments:
            return
        if keep.segments is None:
            self.segments.keep_end()
        if keep.events != math.inf and self._may_bounce:
            self.hidden = list(self.occurrences.blocks)
        if keep.events is None:
            self.occurrences.blocks = []
        if keep.segments in (None, math.inf) and keep.events in (None, math.inf):
            return
        last = self.segments[-1]
        end, forward = last.end, last.s[-1] >= last.s[0]
        if keep.segments is not None and keep.segments < math.inf:
            self.segments.cut(_before(end, keep.segments, forward))
        if keep.events is not None and keep.events < math.inf:
            start = _before(end, keep.events, forward)
            sign = 1.0 if forward else -1.0
            times = np.concatenate([np.empty(0), *(block.times for block in self.occurrences.blocks)])
            first = int(np.searchsorted(sign * times, sign * start.high))
            # a double before it by less than an ulp
            while first < len(times) and sign * self.occurrences[first].instant.minus(start) < 0.0:
                first += 1
            self.occurrences.drop(first)

    def mark(self, checkpoint: Made) -> None:
        """Note where the run could go on; the last checkpoint is made when the run is over."""
        self._mark = (checkpoint, self.segments.mark(), self.occurrences.mark(), dict(self.warnings))

    def seal(self) -> None:
        """Make the last place that was noted the one to go on from: nothing more will be recorded."""
        if self._mark is not None:
            checkpoint, segments, occurrences, self.warnings_there = self._mark
            since = self.segments.since_mark(segments), self.occurrences.since_mark(occurrences)
            self._checkpoint = partial(checkpoint, *since)

    @property
    def checkpoint(self) -> Checkpoint | None:
        """The last place from which the run can go on; made when somebody asks for it."""
        if callable(self._checkpoint):
            self._checkpoint = self._checkpoint()
        return self._checkpoint

    @checkpoint.setter
    def checkpoint(self, checkpoint: Checkpoint | None) -> None:
        self._checkpoint = checkpoint

    def forget_checkpoint(self) -> None:
        """Leave no place from which the run could go on."""
        self._checkpoint = self._mark = None

    def up_to_checkpoint(self, system: System) -> Trajectory:
        """A copy that ends at the checkpoint, to go on with."""
        assert self.checkpoint is not None
        earlier = Trajectory(system)
        for chain, others, count in (
            (earlier.segments, self.segments, self.checkpoint.segments),
            (earlier.occurrences, self.occurrences, self.checkpoint.occurrences),
        ):
            chain.window, chain.blocks = others.window, others.without_last(count)
        if self.hidden:
            whole: Chain[Occurrence] = Chain(OccurrenceList)
            whole.blocks = self.hidden
            earlier.occurrences.blocks = whole.without_last(self.checkpoint.occurrences)
        earlier.counters, earlier.warnings = copy(self.counters), dict(self.warnings_there)
        earlier.checkpoint = self.checkpoint
        return earlier

    def warn(self, message: str) -> None:
        """Count a warning; each message is kept once."""
        self.warnings[message] = self.warnings.get(message, 0) + 1


def _before(end: Instant, length: float, forward: bool) -> Instant:
    """So long before the end, at a double."""
    return Instant(float(end.plus(-length if forward else length)))


@dataclass(frozen=True)
class Task:
    """What to run: from t0 to t1 out of x0 and z0, how accurately, and what to keep of it."""

    t0: float
    t1: float
    x0: np.ndarray
    z0: np.ndarray
    tolerances: Any
    discrete: np.ndarray
    keep: Keep = ALL
    limits: Limits = UNLIMITED
    record: Trajectory | None = None  # what to go on with, from its checkpoint
    successor: Any = None  # a stiff method (`hybridsim.engine.run.stepping.Method`), which may take over

    @cached_property
    def forward(self) -> bool:
        """Whether time runs forward."""
        return self.t1 >= self.t0

    @cached_property
    def plans(self) -> dict[str, Any]:
        """What `hybridsim.engine.run.setup` keeps here."""
        return {}

    @cached_property
    def beginning(self) -> tuple[Any, ...]:
        """What the start depends on: equal where runs of one system begin alike."""
        return self.t0, self.forward, self.x0.tobytes(), self.z0.tobytes(), self.discrete.tobytes()
