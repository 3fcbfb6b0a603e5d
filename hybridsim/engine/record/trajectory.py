"""This module stores the record of a run: segments with dense output, events, and final status."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from hybridsim.engine.record.block_list import BlockList, SegmentBlockList
from hybridsim.engine.record.blocks import OccurrenceList
from hybridsim.engine.record.checkpoint import Checkpoint
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.limits import UNLIMITED, Limits
from hybridsim.engine.record.retention import ALL, Retention
from hybridsim.engine.record.segments import Occurrence, PiecewiseDense, Segment, end_point
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

# Events that the search for the end of bounces may examine. They are stored even if fewer are shown.
LOOKED_BACK_ON = 4096

Made = Callable[[int, int], Checkpoint]  # (segments, events recorded since) -> checkpoint

__all__ = ["LOOKED_BACK_ON", "Occurrence", "PiecewiseDense", "Segment", "Task", "Trajectory"]


class Trajectory:
    """The record of a run: segments, events and final status.

    segments and occurrences are sequences of `Segment` and `Occurrence`. Objects can be appended, and blocks
    (`hybridsim.engine.record.blocks`) of a compiled loop added. Items that are not to be kept are discarded during the
    run, so that its memory is bounded by what it keeps. taken_over: the name of the stiff method that took over, and
    the time.
    """

    taken_over: tuple[str, float] | None = None

    def __init__(self, system: System, retention: Retention = ALL) -> None:
        # the last segment is always needed, because it gives the end of the run
        self.segments = SegmentBlockList(system, 0.0 if retention.segments is None else retention.segments)
        self._may_bounce = system.may_bounce
        least = LOOKED_BACK_ON if self._may_bounce else 0
        self.occurrences: BlockList[Occurrence] = BlockList(OccurrenceList, retention.events, least)
        self.hidden: list[Any] = []  # blocks of events before some were discarded, to continue from
        self.counters = Counters()
        self.status, self.message = "finished", ""
        self.warnings_there: dict[str, int] = {}  # warnings up to the checkpoint
        self.warnings: dict[str, int] = {}  # message -> count
        self._checkpoint: Checkpoint | Callable[[], Checkpoint] | None = None
        self._mark: tuple[Made, tuple[int, int], tuple[int, int], dict[str, int]] | None = None

    def stop_early(self, status: str, why: str, start: float) -> None:
        """Store the status and message of a run that stopped before its end."""
        head = f"{why}; stopped" if why else "interrupted"
        reached = float(self.segments[-1].end) if self.segments else start
        self.status = status
        self.message = (
            f"{head} at t = {reached!r}; the results so far are kept, and sol.resume() continues the run"
        )

    def finish(
        self, instant: Instant, t0: float, z: np.ndarray, p: np.ndarray, x: np.ndarray, discrete: slice
    ) -> None:
        """Store the state after an event at the end of the run, where no segment begins.

        A segment to this instant ends there up to the rounding of its length, which is less than the time since t0.
        """
        if self.segments:
            last, longest = self.segments[-1], abs(instant.minus(Instant(t0)))
            if abs(instant.minus(last.end)) > math.ulp(longest):
                return
            if (last.z == z).all() and (last.x[-1] == x).all() and (last.p[discrete] == p[discrete]).all():
                return
        self.segments.append(end_point(instant, z, p, x))

    def close(self, retention: Retention) -> None:
        """Discard results outside the part of the run that is stored."""
        if retention == ALL or not self.segments:
            return
        if retention.segments is None:
            self.segments.drop_all_but_end()
        if retention.events != math.inf and self._may_bounce:
            self.hidden = list(self.occurrences.blocks)
        if retention.events is None:
            self.occurrences.blocks = []
        if retention.segments in (None, math.inf) and retention.events in (None, math.inf):
            return
        last = self.segments[-1]
        end, forward = last.end, last.s[-1] >= last.s[0]
        if retention.segments is not None and retention.segments < math.inf:
            self.segments.cut(_before(end, retention.segments, forward))
        if retention.events is not None and retention.events < math.inf:
            start = _before(end, retention.events, forward)
            sign = 1.0 if forward else -1.0
            times = np.concatenate([np.empty(0), *(block.times for block in self.occurrences.blocks)])
            first = int(np.searchsorted(sign * times, sign * start.high))
            # the rounded instant may be less than an ulp before it
            while first < len(times) and sign * self.occurrences[first].instant.minus(start) < 0.0:
                first += 1
            self.occurrences.drop(first)

    def mark(self, checkpoint: Made) -> None:
        """Mark this point of the run, with a function that creates its checkpoint; a later mark replaces this mark."""
        self._mark = (checkpoint, self.segments.mark(), self.occurrences.mark(), dict(self.warnings))

    def seal(self) -> None:
        """Set the checkpoint to the last mark; call this after the run has recorded everything."""
        if self._mark is not None:
            checkpoint, segments, occurrences, self.warnings_there = self._mark
            since = self.segments.since_mark(segments), self.occurrences.since_mark(occurrences)
            self._checkpoint = partial(checkpoint, *since)

    @property
    def checkpoint(self) -> Checkpoint | None:
        """Return the last checkpoint from which the run can continue, created on demand."""
        if callable(self._checkpoint):
            self._checkpoint = self._checkpoint()
        return self._checkpoint

    @checkpoint.setter
    def checkpoint(self, checkpoint: Checkpoint | None) -> None:
        self._checkpoint = checkpoint

    def forget_checkpoint(self) -> None:
        """Delete the checkpoint of this run."""
        self._checkpoint = self._mark = None

    def up_to_checkpoint(self, system: System) -> Trajectory:
        """Return a copy of the record that ends at the checkpoint, from which the run can continue."""
        assert self.checkpoint is not None
        earlier = Trajectory(system)
        for items, others, count in (
            (earlier.segments, self.segments, self.checkpoint.segments),
            (earlier.occurrences, self.occurrences, self.checkpoint.occurrences),
        ):
            items.window, items.blocks = others.window, others.without_last(count)
        if self.hidden:
            whole: BlockList[Occurrence] = BlockList(OccurrenceList)
            whole.blocks = self.hidden
            earlier.occurrences.blocks = whole.without_last(self.checkpoint.occurrences)
        earlier.counters, earlier.warnings = copy(self.counters), dict(self.warnings_there)
        earlier.checkpoint = self.checkpoint
        return earlier

    def warn(self, message: str) -> None:
        """Count one occurrence of a warning; each message is stored once."""
        self.warnings[message] = self.warnings.get(message, 0) + 1


def _before(end: Instant, length: float, forward: bool) -> Instant:
    """Return the instant at a given time before the end of the run."""
    return Instant(float(end.plus(-length if forward else length)))


@dataclass(eq=False)
class Task:
    """The definition of a run: time span, initial state and modes, tolerances, and results to store.

    A task never changes. The class is not frozen, because a frozen object takes three times as long to make.
    """

    t0: float
    t1: float
    x0: np.ndarray  # initial states (n,)
    z0: np.ndarray  # initial modes (C,), -1 for none
    tolerances: Any
    discrete: np.ndarray  # initial discrete states
    retention: Retention = ALL
    limits: Limits = UNLIMITED
    record: Trajectory | None = None  # record to continue, from its checkpoint
    successor: Any = None  # a stiff method (`hybridsim.engine.run.stepping.Method`), which may take over
    is_stepped: bool = False  # whether t1 is an instant of its own, at which the run leaves a checkpoint
    # set-ups of runs; a copy of the task has its own
    setups: dict[str, Any] = field(init=False, repr=False, default_factory=dict)

    @property
    def forward(self) -> bool:
        """Return whether time runs forward."""
        return self.t1 >= self.t0

    @cached_property
    def beginning(self) -> tuple[Any, ...]:
        """Return a key of the initial time, direction and state; equal keys mean the same start of the run."""
        return self.t0, self.forward, self.x0.tobytes(), self.z0.tobytes(), self.discrete.tobytes()
