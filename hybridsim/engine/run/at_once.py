"""A run that one call of its compiled loop takes from start to end: what it leaves behind is made when it is asked for.

A short run takes no longer in compiled code than Python takes to lay out what happened, and a program that runs the
same again and again looks at little of it. So the times of events and the states between them are read from what the
loop wrote; whoever asks for more gets the record that the mode loop makes of that very call.
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
    """The record of a finished run; all but its segments, its events and its cost is made when somebody asks for it.

    Parameters
    ----------
    leapt : the call that was all of the run.
    segments : makes its segments; None where the whole record is needed for them.
    count : makes the counters.
    make : makes the whole record.
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
        """What is to be done with the whole record, once it is made."""
        first = self._make

        def make() -> Trajectory:
            record = first()
            last(record)
            return record

        self._make = make

    def whole(self) -> None:
        """Make the whole record now."""
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
            self.occurrences = found  # once it is whole: another thread may ask as well
        elif name == "segments" and self._segments is not None:
            self.segments = self._segments()
        else:
            self.whole()
        return getattr(self, name)


class _BrokenOff:
    """In place of a compiled loop whose first call raised an error, for the mode loop to deal with it."""

    leapt = None

    def __init__(self, place: tuple[np.ndarray, ...], error: BaseException) -> None:
        self.place, self._error = place, error

    def leap(self, *_: Any) -> Any:
        """Raise it."""
        raise self._error


_leads_nowhere = Door(leads_nowhere)


def _is_over(system: System, leapt: Leapt) -> bool:
    """Whether the call is all of the run for certain: its events have no limit, and hide no bounces."""
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
    """Run a task: its compiled loop goes first, if it can, and where that is not all of it the mode loop goes on."""
    plan, keep = plan_of(system, method, task), task.keep
    start = plan.silent_start
    is_plain = progress is None and task.record is None and task.limits is UNLIMITED
    # where little is kept the record is small, and what the loop wrote is not
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
        if record.status == "interrupted":  # the run is over all the same: it is whoever asks that stops
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
