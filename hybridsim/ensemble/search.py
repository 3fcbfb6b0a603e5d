"""This module finds, in compiled code, the periodic motions on which the runs of a group settle.

A run is followed period by period until its states repeat. If many more periods are expected, Newton's method on the
period map replaces waiting, as long as the sequence of modes stays the same. The rules are those of
`hybridsim.analysis.steady.steady_state`, which decides what is left undecided here.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.known_time import set_origin
from hybridsim.engine.events.compiled.start import plain_start
from hybridsim.engine.linear.motion_summary import sum_up
from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.loop_hints import fill, put
from hybridsim.engine.native.struct_pack import pack_at
from hybridsim.engine.series.bounded import UNIT
from hybridsim.ensemble.period_map import begin_segment, carry_derivative, run_periods, solve, word_of
from hybridsim.ensemble.returns import (
    measure_scale,
    nearest_return,
    periods_left,
    relative_change,
    repeats_after,
)
from hybridsim.ensemble.run import clear_summary, store_summary, take_rest
from hybridsim.ensemble.start import keeps_holding

UNDECIDED, PERIODIC, RESTS = range(3)
NEXT, SEGMENTS_DONE = range(2)  # indices of `Searches.at`
MULTIPLE, NEWTON_STEPS, FOLLOWED, OUTCOME = range(4)  # columns of `Searches.counts`
MOST_FOLLOWED = 512  # most periods in a row before the states are tested
MAX_PERIODS = 2048  # a motion that has not settled by then is undecided
_FEWEST = 8  # periods that take as long as Newton's method
_STEPS = 12  # most steps of Newton's method
_LESS = 0.5  # a step that leaves a larger part of the residual is rejected
_ROUNDING = 1e-14  # relative to the states' scale; no step makes the residual smaller
_MARGIN = 1.1  # on the expected number of periods
_NEAR = 1e-6  # of a period: an event this close to its end may move onto it while the motion settles
_NEARLY = 1e3  # of the tolerance: a shorter return with this residual may be a motion with a shorter period
_SAME = 10.0  # of the tolerance: the same motion with a shorter period
_HARDLY = 1e-9  # of its size: a state that moves by less may be at rest
_MAX_SEGMENTS = 1 << 17  # most segments of one search, some tens of milliseconds
_SEGMENTS_PER_CALL = 1 << 18  # after these a call returns, so that it can be interrupted


class Searches(NamedTuple):
    """The searches at the m points of a group, with their results."""

    tables: np.ndarray  # addresses (m,) of tables
    vectors: np.ndarray  # run-time vectors (m, P)
    rates: np.ndarray  # rates (m, R) of angles
    starts: np.ndarray  # initial states (m, n), then states at the start of the period
    periods: np.ndarray  # forcing periods (m,)
    longest: np.ndarray  # longest segments (m,)
    counts: np.ndarray  # (m, 4): multiple of the period, steps of Newton's method, periods, outcome
    residuals: np.ndarray  # (m,) change over the period
    matrices: np.ndarray  # (m, n, n) derivative of the period map, if Newton's method was used
    modes: np.ndarray  # modes (m, C) at the start of the period
    extremes: np.ndarray  # over the period, as in `hybridsim.engine.linear.motion_summary.MotionSummary`
    integrals: np.ndarray
    sides: np.ndarray
    held: np.ndarray
    holding: np.ndarray
    at: np.ndarray  # (2,): next point, and segments of the present call


class SearchScratch(NamedTuple):
    """Scratch arrays of one search."""

    states: np.ndarray  # (MOST_FOLLOWED, n) states after each period
    modes: np.ndarray  # (C,) modes before Newton's method
    scale: np.ndarray  # (n,) scale of each state
    seen: np.ndarray  # (n,) its largest scale so far
    rows: np.ndarray  # (n, n + 1) linear equations
    slopes: np.ndarray  # (3, n) for `sum_up`
    map: Any  # `hybridsim.ensemble.period_map.MapScratch`
    summary: Any  # `MotionSummary` of one period


@kernel
def search_orbits(
    packs: Any, lin_at: Any, none: Any, starting: Any, searches: Any, scratch: Any, settings: Any
) -> None:
    """Search the motions of the points of a group in order, until all are done or many segments are computed.

    lin_at (1,): address of the tables in the model, which each point changes. none: empty tables. starting: positions
    of the origin, the phases and the pin in p, surfaces, and holding modes. settings: tolerance, first number of
    periods, largest number, and nodes and weights of the quadrature.
    """
    at, counts = searches.at, searches.counts
    at[SEGMENTS_DONE] = 0
    while at[NEXT] < counts.shape[0] and at[SEGMENTS_DONE] < _SEGMENTS_PER_CALL:
        i = at[NEXT]
        lin = pack_at(searches.tables[i], packs.model.lin)
        lin_at[0] = searches.tables[i]
        outcome = _begin(packs, lin, none, starting, searches, i, scratch)
        if outcome == PERIODIC:
            outcome = _search(packs, lin, starting[4], searches, i, scratch, settings)
        counts[i, OUTCOME] = outcome
        if outcome == RESTS and counts[i, MULTIPLE] == 0:
            counts[i, MULTIPLE], counts[i, FOLLOWED] = 1, settings[1]
        if outcome != UNDECIDED:
            store_summary(scratch.summary, searches, i)
        at[NEXT] += 1


@inlined
def _begin(packs: Any, lin: Any, none: Any, starting: Any, searches: Any, i: int, scratch: Any) -> int:
    """Begin the run of a point; return RESTS for a state at rest, PERIODIC for a moving state, or UNDECIDED."""
    origin_at, phases_at, pin_at, surfaces, hold = starting
    model, state, work, call = packs.model, packs.state, packs.work, packs.call
    rates = searches.rates[i]
    put(searches.starts[i], state.x)
    put(searches.vectors[i], state.p)
    set_origin((origin_at, phases_at), rates, 0.0, 0.0, state.p)
    for j in range(state.x.shape[0]):  # as `hybridsim.engine.events.start.start_errors`
        x = state.x[j]
        state.x_error[j] = 0.0 if x == round(x) else 2.0 * UNIT * abs(x)
    if not plain_start(model.automata, model.tapes, model.inputs, none, pin_at, surfaces, state, work):
        return UNDECIDED
    if keeps_holding(model.tapes, lin, state, work, packs.own.c):
        put(state.x, searches.starts[i])
        put(state.z, searches.modes[i])
        take_rest(hold, searches.periods[i], state, scratch.summary)
        return RESTS
    put(rates, call.rates)
    for k in range(packs.own.hints.shape[0]):
        fill(packs.own.hints[k], 0.0)
    call.longest[0] = searches.longest[i]
    fill(scratch.seen, 0.0)
    return PERIODIC


@kernel
def _search(packs: Any, lin: Any, hold: Any, searches: Any, i: int, scratch: Any, settings: Any) -> int:
    """Follow the motion of a point until it repeats; return PERIODIC, RESTS or UNDECIDED."""
    tol, first_periods, most, rule = settings
    period, states, scale, counts = searches.periods[i], scratch.states, scratch.scale, searches.counts[i]
    before = searches.at[SEGMENTS_DONE]
    expected, followed, segments = first_periods, 0, 0
    while followed < most and searches.at[SEGMENTS_DONE] - before < _MAX_SEGMENTS:
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
        if not _sum_up(packs, lin, hold, segments, rule, scratch):
            return UNDECIDED
        measure_scale(scratch.summary.extremes, scratch.seen, scale)
        multiple = repeats_after(states, count, scale, tol)
        if multiple > 0:
            for shorter in range(1, multiple):
                residual = relative_change(states[count - 1 - shorter], states[count - 1], scale)
                if multiple % shorter == 0 and residual <= _NEARLY * tol:
                    return UNDECIDED
            segments = run_periods(packs, multiple * period)
            return _store(packs, lin, hold, searches, i, scratch, (multiple, segments, rule))
        multiple = nearest_return(states, count, scale)
        left = periods_left(states, count, multiple, scale, tol)
        if left > _FEWEST * multiple:
            segments = _newton(packs, lin, searches, i, scratch, (tol, states[count - 1], multiple))
            if segments > 0:
                if multiple > 1:
                    multiple, segments = _shortest(packs, searches, i, scratch, (tol, multiple))
                return _store(packs, lin, hold, searches, i, scratch, (multiple, segments, rule))
        if left < math.inf:
            expected = math.ceil(min(_MARGIN * left, 1.0 * MOST_FOLLOWED)) + 2 * multiple
        else:
            expected = max(first_periods, followed)
        expected = min(expected, MOST_FOLLOWED)
    return UNDECIDED


@kernel
def _newton(packs: Any, lin: Any, searches: Any, i: int, scratch: Any, about: Any) -> int:
    """Find a fixed point of the map over some periods by Newton's method; return the number of segments, or 0.

    The state is then that at the end of these periods. If the method fails, it is as before. about: tolerance, state
    after the last period, and number of periods.
    """
    tol, first, multiple = about
    state, record, scale, rows = packs.state, packs.record, scratch.scale, scratch.rows
    n, start, word, before = scale.shape[0], scratch.map.after, 0, math.inf
    put(state.z, scratch.modes)
    for step in range(_STEPS):
        segments = run_periods(packs, multiple * searches.periods[i])
        searches.at[SEGMENTS_DONE] += segments
        if segments == 0:
            break
        begin_segment(state)
        is_same = True
        for c in range(scratch.modes.shape[0]):
            is_same = is_same and state.z[c] == scratch.modes[c]
        here = word_of(packs.rows.rows, segments)
        word = here if step == 0 else word
        residual = relative_change(record.jumps[0, 0], state.x, scale)
        if not (is_same and here == word and (residual <= _LESS * before or residual <= _ROUNDING)):
            break
        before = residual
        carry_derivative(packs, lin, segments, scratch.map)
        for a in range(n):
            unit = scale[a] if scale[a] > 0.0 else 1.0
            for b in range(n):
                rows[a, b] = -scratch.map.matrix[a, b] * (scale[b] if scale[b] > 0.0 else 1.0) / unit
            rows[a, a] += 1.0
            rows[a, n] = (state.x[a] - record.jumps[0, 0, a]) / unit
        if not solve(rows):
            break
        largest = 0.0
        for a in range(n):
            if not abs(rows[a, n]) <= largest:
                largest = abs(rows[a, n])
        if residual <= tol and largest <= tol:
            searches.counts[i, NEWTON_STEPS] += step
            for a in range(n):
                put(scratch.map.matrix[a], searches.matrices[i, a])
            return segments
        for a in range(n):
            start[a] = record.jumps[0, 0, a] + (scale[a] if scale[a] > 0.0 else 1.0) * rows[a, n]
        put(start, state.x)
    put(first, state.x)
    put(scratch.modes, state.z)
    begin_segment(state)
    return 0


@kernel
def _shortest(packs: Any, searches: Any, i: int, scratch: Any, about: Any) -> tuple[int, int]:
    """Run the shortest period of the recorded motion; return its length in forcing periods, and its segments.

    There are 0 segments if the motion nearly repeats earlier. about: tolerance, and a number of periods after which
    the motion repeats.
    """
    tol, multiple = about
    state, start = packs.state, searches.starts[i]
    put(packs.record.jumps[0, 0], start)
    for shorter in range(1, multiple + 1):
        if multiple % shorter != 0:
            continue
        put(start, state.x)
        put(scratch.modes, state.z)
        begin_segment(state)
        segments = run_periods(packs, shorter * searches.periods[i])
        change = relative_change(start, state.x, scratch.scale)
        if segments == 0 or shorter == multiple or change <= _SAME * tol:
            return shorter, segments
        if change <= _NEARLY * tol:
            return shorter, 0
    return multiple, 0


@inlined
def _sum_up(packs: Any, lin: Any, hold: Any, segments: int, rule: Any, scratch: Any) -> bool:
    """Summarise the recorded segments; return False if a segment oscillates too often."""
    record, rows = packs.record, packs.rows
    clear_summary(scratch.summary)
    return sum_up(
        lin, hold, (rows.ends, rows.rows, record.modes, rows.coordinates, record.jumps), 0, segments, 0.0,
        rule[0], rule[1], (packs.own.v, scratch.slopes), scratch.summary,
    )  # fmt: skip


@kernel
def _store(packs: Any, lin: Any, hold: Any, searches: Any, i: int, scratch: Any, found: Any) -> int:
    """Store the motion over the recorded period; return PERIODIC, RESTS or UNDECIDED.

    found: number of forcing periods, number of segments, and the quadrature.
    """
    multiple, segments, rule = found
    state, record, ends, scale = packs.state, packs.record, packs.rows.ends, scratch.scale
    near = _NEAR * searches.periods[i]
    if segments == 0 or not _sum_up(packs, lin, hold, segments, rule, scratch):
        return UNDECIDED
    if segments > 1 and (ends[0] <= near or ends[segments - 1] <= near):
        return UNDECIDED
    for c in range(state.z.shape[0]):
        if state.z[c] != record.modes[0, c]:
            return UNDECIDED
    searches.residuals[i] = relative_change(record.jumps[0, 0], state.x, scale)
    searches.counts[i, MULTIPLE] = multiple
    put(record.jumps[0, 0], searches.starts[i])
    put(record.modes[0], searches.modes[i])
    extremes, rests, hardly = scratch.summary.extremes, True, True
    for j in range(state.x.shape[0]):
        range_of = extremes[1, j] - extremes[0, j]
        rests = rests and range_of == 0.0
        hardly = hardly and range_of <= _HARDLY * max(abs(extremes[0, j]), abs(extremes[1, j]))
    return RESTS if rests else UNDECIDED if hardly else PERIODIC
