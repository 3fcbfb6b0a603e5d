"""This module finds, in compiled code, the periodic motions on which the runs of a group settle.

A run is followed period by period until its states repeat. If many more periods are expected, Newton's method
(`hybridsim.ensemble.newton`) replaces waiting. The rules are those of
`hybridsim.analysis.steady.steady_state`, which decides what is left undecided here.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import call_kernel, inline_always, inlined, kernel
from hybridsim.engine.native.loop_hints import fill, put
from hybridsim.ensemble.newton import FAILED, FOLLOWED, MULTIPLE, NEARLY, NEXT, OUTCOME, SEGMENTS_DONE
from hybridsim.ensemble.period_map import begin_segment, run_periods
from hybridsim.ensemble.points import BEGIN, MOVES, NEWTON, RESTS, SEARCH, SUMMARISE, UNDECIDED, store_summary
from hybridsim.ensemble.returns import (
    measure_scale,
    nearest_return,
    periods_left,
    relative_change,
    remember_sizes,
    repeats_after,
)

PERIODIC = MOVES
MOST_FOLLOWED = 512  # most periods in a row before the states are tested
MAX_PERIODS = 2048  # a motion that has not settled by then is undecided
_NEEDS_NEWTON = -1  # result of `search_point`
_FEWEST = 8  # periods that take as long as Newton's method
_MARGIN = 1.1  # on the expected number of periods
_NEAR = 1e-6  # of a period: an event this close to its end may move onto it while the motion settles
# a motion may be rest if each state moves by less than this part of the largest state, or of its own former motion
_HARDLY = 1e-9
_MAX_SEGMENTS = 1 << 17  # most segments of one search, some tens of milliseconds
_SEGMENTS_PER_CALL = 1 << 18  # after these a call returns, so that it can be interrupted


class Searches(NamedTuple):
    """The searches at the m points of a group, with their results."""

    points: Any  # `hybridsim.ensemble.points.Points`; its starts become the states at the start of the period
    counts: np.ndarray  # (m, 4): multiple of the period, steps of Newton's method, periods, outcome
    residuals: np.ndarray  # (m,) change over the period
    matrices: np.ndarray  # (m, n, n) derivative of the period map, if Newton's method was used
    modes: np.ndarray  # modes (m, C) at the start of the period
    summaries: Any  # `hybridsim.ensemble.points.PeriodSummary` of each point
    at: np.ndarray  # (2,): next point, and segments of the present call


class SearchScratch(NamedTuple):
    """Scratch arrays of one search."""

    states: np.ndarray  # (MOST_FOLLOWED, n) states after each period
    modes: np.ndarray  # (C,) modes before Newton's method
    scale: np.ndarray  # (n,) scale of each state
    seen: np.ndarray  # (n,) its largest scale so far
    last: np.ndarray  # (n,) states before Newton's method
    rows: np.ndarray  # (n, n + 1) linear equations
    map: Any  # `hybridsim.ensemble.period_map.MapScratch`
    found: Any  # `PeriodSummary` of one point


@kernel
def search_orbits(packs: Any, none: Any, fixed: Any, searches: Any, scratch: Any, settings: Any) -> bool:
    """Search the steady motion at each point, in order; stop early when the number of segments reaches a limit.

    packs: `LoopPacks`; none: empty tables; fixed: `hybridsim.ensemble.points.Fixed`. settings: tolerance, first number
    of periods, and largest number. Return whether the next point needs Newton's method, which is not compiled yet. Its
    search then begins again in the next call.
    """
    at, counts, points, found = searches.at, searches.counts, searches.points, scratch.found
    tol, first_periods, most = settings
    at[SEGMENTS_DONE] = 0
    while at[NEXT] < counts.shape[0] and at[SEGMENTS_DONE] < _SEGMENTS_PER_CALL:
        i = at[NEXT]
        outcome = call_kernel(packs.entry_points[BEGIN], (packs, none, fixed, points, found, i))
        if outcome == RESTS:
            put(packs.state.x, points.starts[i])
            put(packs.state.z, searches.modes[i])
        if outcome == MOVES:
            arguments = packs, fixed, searches, scratch, i, tol, first_periods, most
            outcome = call_kernel(packs.entry_points[SEARCH], arguments)
            if outcome == _NEEDS_NEWTON:
                return True
        counts[i, OUTCOME] = outcome
        if outcome == RESTS and counts[i, MULTIPLE] == 0:
            counts[i, MULTIPLE], counts[i, FOLLOWED] = 1, first_periods
        if outcome != UNDECIDED:
            store_summary(found, searches.summaries, i)
        at[NEXT] += 1
    return False


def search_point(
    packs: Any, fixed: Any, searches: Any, scratch: Any, i: int, tol: float, first_periods: int, most: int
) -> int:
    """Follow the motion of a point until it repeats; return PERIODIC, RESTS, UNDECIDED or _NEEDS_NEWTON."""
    period, states, scale = searches.points.periods[i], scratch.states, scratch.scale
    counts, before = searches.counts[i], searches.at[SEGMENTS_DONE]
    fill(scratch.seen, 0.0)
    put(searches.points.starts[i], states[0])
    remember_sizes(states, 1, scratch.seen)
    expected, followed, segments, multiple, is_found = first_periods, 0, 0, 0, False
    while not is_found:
        if not (followed < most and searches.at[SEGMENTS_DONE] - before < _MAX_SEGMENTS):
            return UNDECIDED
        count = expected
        for row in range(count):
            segments = run_periods(packs, period)
            if segments == 0:
                return UNDECIDED
            searches.at[SEGMENTS_DONE] += segments
            put(packs.state.x, states[row])
            begin_segment(packs.state)
        followed += count
        counts[FOLLOWED] = followed
        remember_sizes(states, count, scratch.seen)
        if _summarise(packs, fixed, segments, scratch) == 0:
            return UNDECIDED
        measure_scale(scratch.found.extremes, scratch.seen, scale)
        multiple = repeats_after(states, count, scale, tol)
        if multiple > 0:
            for shorter in range(1, multiple):
                residual = relative_change(states[count - 1 - shorter], states[count - 1], scale)
                if multiple % shorter == 0 and residual <= NEARLY * tol:
                    return UNDECIDED
            segments, is_found = run_periods(packs, multiple * period), True
            continue
        multiple = nearest_return(states, count, scale)
        left = periods_left(states, count, multiple, scale, tol)
        if left > _FEWEST * multiple:
            newton = packs.entry_points[NEWTON]
            if newton == 0:
                return _NEEDS_NEWTON
            put(states[count - 1], scratch.last)
            segments = call_kernel(newton, (packs, searches, scratch, i, multiple, tol))
            if segments != FAILED:
                multiple, is_found = counts[MULTIPLE], True
                continue
        if left < math.inf:
            expected = math.ceil(min(_MARGIN * left, 1.0 * MOST_FOLLOWED)) + 2 * multiple
        else:
            expected = max(first_periods, followed)
        expected = min(expected, MOST_FOLLOWED)
    return _store(packs, fixed, searches, i, scratch, (multiple, segments))


@inlined
def _summarise(packs: Any, fixed: Any, segments: int, scratch: Any) -> int:
    """Summarise the recorded segments; return 0 if a segment has too many oscillations."""
    arguments = packs, fixed, packs.record, packs.rows, scratch.found, 0, segments, 0.0
    return call_kernel(packs.entry_points[SUMMARISE], arguments)


@inline_always
def _store(packs: Any, fixed: Any, searches: Any, i: int, scratch: Any, found: Any) -> int:
    """Store the motion over the recorded period; return PERIODIC, RESTS or UNDECIDED.

    found: number of forcing periods, and number of segments.
    """
    multiple, segments = found
    state, record, ends, scale = packs.state, packs.record, packs.rows.ends, scratch.scale
    near = _NEAR * searches.points.periods[i]
    if segments <= 0 or _summarise(packs, fixed, segments, scratch) == 0:
        return UNDECIDED
    if segments > 1 and (ends[0] <= near or ends[segments - 1] <= near):
        return UNDECIDED
    for c in range(state.z.shape[0]):
        if state.z[c] != record.modes[0, c]:
            return UNDECIDED
    searches.residuals[i] = relative_change(record.jumps[0, 0], state.x, scale)
    searches.counts[i, MULTIPLE] = multiple
    put(record.jumps[0, 0], searches.points.starts[i])
    put(record.modes[0], searches.modes[i])
    extremes, rests, hardly, largest = scratch.found.extremes, True, True, 0.0
    for j in range(state.x.shape[0]):
        largest = max(largest, abs(extremes[0, j]), abs(extremes[1, j]))
    for j in range(state.x.shape[0]):
        range_of = extremes[1, j] - extremes[0, j]
        rests = rests and range_of == 0.0
        hardly = hardly and range_of <= _HARDLY * max(largest, scratch.seen[j])
    return RESTS if rests else UNDECIDED if hardly else PERIODIC
