"""Run a task in one call of its compiled loop, and build the full record only on demand.

In a short run the compiled loop takes less time than Python needs to build the record, and programs that repeat runs
use little of it. The times of events and the states between them are therefore read from the arrays of the loop. Other
attributes trigger the mode loop, which builds the full record from the same call.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from hybridsim.engine.events.zeno.accumulation import MAX_EVENTS_PER_TURN, cannot_accumulate
from hybridsim.engine.events.zeno.hidden_bounces import may_be_hidden
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.record.block_list import BlockList, SegmentBlockList
from hybridsim.engine.record.blocks import OccurrenceList
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.limits import UNLIMITED
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.run.compiled_loop import CompiledLoop
from hybridsim.engine.run.kernel_run import KernelRun
from hybridsim.engine.run.mode_loop import ModeLoop
from hybridsim.engine.run.setup import setup_of
from hybridsim.engine.run.stepping import Method
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.system import System


class LazyTrajectory(Trajectory):
    """The record of a finished run in compact form; the full record is built on demand.

    Parameters
    ----------
    kernel_run : the kernel call that was the whole run.
    segments : makes the segments; None if they need the full record.
    count : makes the counters.
    make : makes the full record.
    """

    def __init__(
        self,
        kernel_run: KernelRun,
        segments: Callable[[], SegmentBlockList] | None,
        count: Callable[[], Counters],
        make: Callable[[], Trajectory],
    ) -> None:
        self.status, self.message = "finished", ""
        self._kernel_run, self._segments, self._count, self._make = kernel_run, segments, count, make

    def then(self, last: Callable[[Trajectory], None]) -> None:
        """Register a function that is applied to the full record after it is built."""
        first = self._make

        def make() -> Trajectory:
            record = first()
            last(record)
            return record

        self._make = make

    def whole(self) -> None:
        """Build the full record now."""
        vars(self).update(vars(self._make()))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name == "counters":
            self.counters = self._count()
        elif name == "occurrences":
            happened = self._kernel_run.event_block
            found: BlockList[Occurrence] = BlockList(OccurrenceList)
            if happened is not None:
                found.add(happened)
            self.occurrences = found  # assigned when complete, because another thread may read it
        elif name == "segments" and self._segments is not None:
            self.segments = self._segments()
        else:
            self.whole()
        return getattr(self, name)


class _FailedCall:
    """The replacement of a compiled loop whose first call failed; it raises the error in the mode loop."""

    kernel_run = times_ahead = None

    def __init__(self, place: tuple[np.ndarray, ...], error: BaseException) -> None:
        self.place, self._error = place, error

    def look_ahead(self, *_: Any) -> None:
        """Do nothing, because a failed call has no known times to process."""

    def advance(self, *_: Any) -> Any:
        """Raise the error of the failed call."""
        raise self._error


_cannot_accumulate = Precompiled(cannot_accumulate)


def _is_over(system: System, kernel_run: KernelRun) -> bool:
    """Return whether one call certainly completed the run: no events accumulate, and no bounces are hidden."""
    if not kernel_run.is_at_target or kernel_run.lacks_tapes or not kernel_run.count:
        return False
    fires = kernel_run.fires
    if not len(fires):
        return True
    last = system.owner[fires[-1]]
    if not system.has_surface[last] and may_be_hidden(
        system, kernel_run.outcome(), kernel_run.event_block or ()
    ):
        return False
    work = np.empty((2, MAX_EVENTS_PER_TURN))
    return bool(_cannot_accumulate(kernel_run.instants, fires, system.owner, len(system.automata), work))


def run_task(
    system: System, method: Method, task: Task, progress: Callable[[float], None] | None
) -> Trajectory:
    """Run a task with its compiled loop if possible, and continue with the mode loop if necessary."""
    setup, retention = setup_of(system, method, task), task.retention
    is_plain = progress is None and task.record is None and task.limits is UNLIMITED and not task.is_stepped
    # with limited retention the record must be small, but the arrays of the loop are not
    keeps_all = retention.events == math.inf and retention.segments in (None, math.inf)
    compiled_loop = setup.compiled_loop()
    if compiled_loop is None or not is_plain or not keeps_all:
        return ModeLoop(system, method, task, progress).run()
    try:
        start = setup.silent_start(task)
        if start is None:
            return ModeLoop(system, method, task).run()
        kernel_run = compiled_loop.kernel_run = compiled_loop.go(setup.origin, start, setup.end)
    except (KeyboardInterrupt, StepFailure) as error:
        return ModeLoop(
            system, method, task, None, cast("CompiledLoop", _FailedCall(compiled_loop.place, error))
        ).run()
    if (
        kernel_run is None
        or not _is_over(system, kernel_run)
        or not (retention.segments or compiled_loop.forget_segments(kernel_run))
    ):
        return ModeLoop(system, method, task, None, compiled_loop).run()

    def made() -> Trajectory:
        again = setup.compiled_loop()
        assert again is not None
        again.kernel_run = kernel_run
        record = ModeLoop(system, method, task, None, again).run()
        if record.status == "interrupted":  # the run itself is finished; only the access is interrupted
            raise KeyboardInterrupt
        return record

    def counted() -> Counters:
        counters = Counters()
        compiled_loop.count(kernel_run, counters)
        return counters

    def between() -> SegmentBlockList:
        found = SegmentBlockList(system)
        found.add(compiled_loop.segments_of(kernel_run))
        return found

    return LazyTrajectory(
        kernel_run, None if kernel_run.ends_in_event or not retention.segments else between, counted, made
    )
