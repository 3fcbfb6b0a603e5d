"""This module runs many parameter points in compiled code, and measures the last period of each run."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.known_time import SEGMENTS as SEGMENTS_AT
from hybridsim.engine.events.compiled.scratch import EVENT_LOOP
from hybridsim.engine.native.kernels import call_kernel, inline_always, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.run.event_loop import AT_TARGET, FULL
from hybridsim.engine.system.instant import two_sum
from hybridsim.ensemble.points import BEGIN, MOVES, RESTS, SUMMARISE, store_summary

SEGMENTS = 1024  # largest number of segments in one compiled call
# A compiled call ends if events follow each other ever faster, because they may accumulate. A few shrinking intervals
# are not an accumulation, so the run is resumed up to this many times.
_MAX_RESUMPTIONS = 4
_SEGMENTS_PER_CHECK = 8192  # between checks for interruption: some milliseconds
NEXT, BEGUN, STORED, RESUMED = range(4)  # indices of `Runs.at`


class Runs(NamedTuple):
    """The m runs of a group, with their results."""

    points: Any  # `hybridsim.ensemble.points.Points`
    ends: np.ndarray  # end times (m,)
    done: np.ndarray  # whether each run (m,) is finished
    summaries: Any  # `hybridsim.ensemble.points.PeriodSummary` of each run
    at: np.ndarray  # (4,): current run, whether it has begun, segments kept, number of resumptions


@kernel
def run_ensemble(packs: Any, none: Any, fixed: Any, runs: Any, record: Any, rows: Any, found: Any) -> None:
    """Run each point of a group, in order; stop early when the number of segments reaches a limit.

    packs: `LoopPacks`, whose record is the second half of `record` and `rows` (`LoopRecord`, `ClosedFormRows`). none:
    empty tables; fixed: `hybridsim.ensemble.points.Fixed`. found: `PeriodSummary` of one run.
    """
    at, points, loop, work = runs.at, runs.points, packs.call, packs.work
    clock, target = loop.times[2:], loop.times[:2]
    segments = 0
    while at[NEXT] < runs.ends.shape[0] and segments < _SEGMENTS_PER_CHECK:
        i = at[NEXT]
        if at[BEGUN] == 0:
            segments += 1
            outcome = call_kernel(packs.entry_points[BEGIN], (packs, none, fixed, points, found, i))
            if outcome == RESTS:
                store_summary(found, runs.summaries, i)
                runs.done[i] = True
            if outcome != MOVES:
                at[NEXT] += 1
                continue
            clock[0], clock[1], target[0], target[1] = 0.0, 0.0, runs.ends[i], 0.0
            at[BEGUN], at[STORED], at[RESUMED] = 1, 0, 0
        code = call_kernel(
            work.entry_points[EVENT_LOOP],
            (packs.model, loop, packs.state, work, packs.record, packs.own, packs.rows),
        )
        count = loop.int_slots[SEGMENTS_AT]
        segments += count if code != FULL else _SEGMENTS_PER_CHECK
        if code == AT_TARGET:
            first, begin = _begin(record, at[STORED], count, runs.ends[i] - points.periods[i])
            if first >= 0:
                arguments = packs, fixed, record, rows, found, first, SEGMENTS + count, begin
                if call_kernel(packs.entry_points[SUMMARISE], arguments) != 0:
                    store_summary(found, runs.summaries, i)
                    runs.done[i] = True
            count = 0
        elif count > 0:
            at[RESUMED] += 0 if code == FULL else 1
            at[STORED] = min(at[STORED] + count, SEGMENTS)
            _shift_back(record, rows, at[STORED], count)
        if count == 0 or at[RESUMED] > _MAX_RESUMPTIONS:
            at[NEXT] += 1
            at[BEGUN] = 0


@inline_always
def _begin(record: Any, stored: int, count: int, since: float) -> tuple[int, float]:
    """Return the segment that contains an instant, and the local time, or -1 if no segment contains the instant."""
    first = SEGMENTS + count - 1
    while first >= SEGMENTS - stored:
        high, low = record.clocks[first, 0], record.clocks[first, 1]
        if (high - since) + low <= 0.0:
            high, error = two_sum(since, -high)
            return first, high + (error - low)
        first -= 1
    return -1, 0.0


@inline_always
def _shift_back(record: Any, rows: Any, stored: int, count: int) -> None:
    """Move the later half of the segments to the start of a record, to make room for new segments."""
    for i in range(SEGMENTS - stored, SEGMENTS):
        rows.ends[i], rows.rows[i] = rows.ends[i + count], rows.rows[i + count]
        put(record.clocks[i + count], record.clocks[i])
        put(record.modes[i + count], record.modes[i])
        put(rows.coordinates[i + count], rows.coordinates[i])
        for side in range(record.jumps.shape[1]):
            put(record.jumps[i + count, side], record.jumps[i, side])
