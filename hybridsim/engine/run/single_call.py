"""Run a task in one call of its compiled loop, and build the full record only on demand.

In a short run the compiled loop takes less time than Python needs to build the record, and programs that repeat runs
use little of it. The times of events and the states between them are therefore read from the arrays of the loop. Other
attributes trigger the mode loop, which builds the full record from the same call.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from hybridsim.engine.events.zeno.accumulation import MOST, leads_nowhere
from hybridsim.engine.events.zeno.hidden_bounces import may_be_hidden
from hybridsim.engine.native.kernels import Door
from hybridsim.engine.record.block_list import Chain, SegmentChain
from hybridsim.engine.record.blocks import OccurrenceList
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.limits import UNLIMITED
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.run.mode_loop import ModeLoop
from hybridsim.engine.run.setup import plan_of
from hybridsim.engine.run.stepping import Leaps, Method
from hybridsim.engine.system.failures import StepFailure
from hybridsim.engine.system.system import System

if TYPE_CHECKING:
    from hybridsim.engine.record.segments import Occurrence
    from hybridsim.engine.run.kernel_run import Leapt


class AtOnce(Trajectory):
    """The record of a finished run. Only its segments, events and cost exist before the full record is requested.

    Parameters
    ----------
    leapt : the kernel call that was the whole run.
    segments : makes the segments; None if they need the full record.
    count : makes the counters.
    make : makes the full record.
    """

    def __init__(
        self,
        leapt: Leapt,
        segments: Callable[[], SegmentChain] | None,
        count: Callable[[], Counters],
        make: Callable[[], Trajectory],
    ) -> None:
        self.status, self.message = "finished", ""
        self._leapt, self._segments, self._count, self._make = leapt, segments, count, make

    def then(self, last: Callable[[Trajectory], None]) -> None:
        """Register a function to be applied to the full record once it is made."""
        first = self._make

        def make() -> Trajectory:
            record = first()
            last(record)
            return record

        self._make = make

    def whole(self) -> None:
        """Make the full record now."""
        vars(self).update(vars(self._make()))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name == "counters":
            self.counters = self._count()
        elif name == "occurrences":
            happened = self._leapt.crossings
            found: Chain[Occurrence] = Chain(OccurrenceList)
            if happened is not None:
                found.add(happened)
            self.occurrences = found  # assigned when complete, because another thread may read it
        elif name == "segments" and self._segments is not None:
            self.segments = self._segments()
        else:
            self.whole()
        return getattr(self, name)


class _BrokenOff:
    """A stand-in for a compiled loop whose first call raised an error, so that the mode loop handles the error."""

    leapt = None

    def __init__(self, place: tuple[np.ndarray, ...], error: BaseException) -> None:
        self.place, self._error = place, error

    def leap(self, *_: Any) -> Any:
        """Raise the error."""
        raise self._error


_leads_nowhere = Door(leads_nowhere)


def _is_over(system: System, leapt: Leapt) -> bool:
    """Return whether the call is certainly the whole run: its events have no limit and hide no bounces."""
    if not leapt.is_at_target or leapt.has_news or not leapt.count:
        return False
    if leapt.events == 0:
        return True
    fires = leapt.fires
    last = system.owner[fires[-1]]
    if not system.has_surface[last] and may_be_hidden(system, leapt.after(), leapt.crossings or ()):
        return False
    work = np.empty((2, MOST))
    return bool(_leads_nowhere(leapt.instants, fires, system.owner, len(system.automata), work))


def carried_out(
    system: System, method: Method, task: Task, progress: Callable[[float], None] | None
) -> Trajectory:
    """Run a task with its compiled loop if possible, and with the mode loop for the rest."""
    plan, keep = plan_of(system, method, task), task.keep
    start = plan.silent_start
    is_plain = progress is None and task.record is None and task.limits is UNLIMITED
    # with limited retention the record must be small, but the arrays of the loop are not
    is_kept = keep.events == math.inf and keep.segments in (None, math.inf)
    if start is None or not is_plain or not is_kept:
        return ModeLoop(system, method, task, progress).run()
    leaper = plan.leaper()
    assert leaper is not None
    try:
        leapt = leaper.leapt = leaper.go(plan.origin, start, plan.end)
    except (KeyboardInterrupt, StepFailure) as error:
        return ModeLoop(system, method, task, None, cast("Leaps", _BrokenOff(leaper.place, error))).run()
    if leapt is None or not _is_over(system, leapt) or not (keep.segments or leaper.forget_segments(leapt)):
        return ModeLoop(system, method, task, None, leaper).run()

    def made() -> Trajectory:
        again = plan.leaper()
        assert again is not None
        again.leapt = leapt
        record = ModeLoop(system, method, task, None, again).run()
        if record.status == "interrupted":  # the run itself is finished; only the access is interrupted
            raise KeyboardInterrupt
        return record

    def counted() -> Counters:
        counters = Counters()
        leaper.count(leapt, counters)
        return counters

    def between() -> SegmentChain:
        found = SegmentChain(system)
        found.add(leaper.segments_of(leapt))
        return found

    return AtOnce(leapt, None if leapt.ends_in_event or not keep.segments else between, counted, made)
