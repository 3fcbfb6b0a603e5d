"""This module finds periodic motions by Newton's method on the period map, in compiled code.

The method replaces waiting as long as the sequence of modes stays the same. Its kernel is compiled when a search first
needs it.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import inline_always, inlined
from hybridsim.engine.native.loop_hints import put
from hybridsim.ensemble.approach import is_approached, solve_step
from hybridsim.ensemble.period_map import begin_segment, carry_derivative, run_periods, word_of
from hybridsim.ensemble.returns import relative_change

NEXT, SEGMENTS_DONE = range(2)  # indices of `hybridsim.ensemble.search.Searches.at`
MULTIPLE, NEWTON_STEPS, FOLLOWED, OUTCOME = range(4)  # columns of `hybridsim.ensemble.search.Searches.counts`
FAILED, NOT_CERTAIN = 0, -1  # results of `close_orbit`
NEARLY = 1e3  # of the tolerance: a shorter return with this residual may be a motion with a shorter period
_STEPS = 12  # most steps of Newton's method
_LESS = 0.5  # a step that leaves a larger part of the residual is rejected
_ROUNDING = 1e-14  # relative to the states' scale; no step makes the residual smaller
_SAME = 10.0  # of the tolerance: the same motion with a shorter period


def close_orbit(packs: Any, searches: Any, scratch: Any, i: int, multiple: int, tol: float) -> int:
    """Find by Newton's method a motion that repeats after some periods; return its number of segments.

    The shortest such number of periods is entered in `searches.counts`, and the motion over them is recorded. Return
    FAILED if the method fails or the run does not approach the motion. The state is then as before, that of
    `scratch.last`. Return NOT_CERTAIN if the motion nearly repeats after a shorter time.
    """
    segments = _newton(packs, searches, scratch, i, multiple, tol)
    searches.counts[i, MULTIPLE] = multiple
    if segments == FAILED:
        return FAILED
    put(packs.record.jumps[0, 0], searches.points.starts[i])
    length, start = multiple * searches.points.periods[i], searches.points.starts[i]
    if not is_approached(packs, scratch, length, start, word_of(packs.rows.rows, segments)):
        _go_back(packs.state, scratch)
        return FAILED
    n = start.shape[0]
    for a in range(n):
        put(scratch.map.matrix[a], searches.matrices[i, a])
    shorter, segments = _shortest(packs, searches.points, scratch, i, multiple, tol)
    searches.counts[i, MULTIPLE] = shorter
    return segments if segments > 0 else NOT_CERTAIN


@inline_always
def _newton(packs: Any, searches: Any, scratch: Any, i: int, multiple: int, tol: float) -> int:
    """Find a fixed point of the map over some periods; return the number of segments, or FAILED."""
    state, record, scale, rows = packs.state, packs.record, scratch.scale, scratch.rows
    n, start, word, before = scale.shape[0], scratch.map.after, 0, math.inf
    put(state.z, scratch.modes)
    for step in range(_STEPS):
        segments = run_periods(packs, multiple * searches.points.periods[i])
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
        carry_derivative(packs, packs.model.lin, segments, scratch.map)
        if not solve_step(scratch, record.jumps[0, 0], state.x):
            break
        largest = 0.0
        for a in range(n):
            if not abs(rows[a, n]) <= largest:
                largest = abs(rows[a, n])
        if residual <= tol and largest <= tol:
            searches.counts[i, NEWTON_STEPS] += step
            return segments
        for a in range(n):
            start[a] = record.jumps[0, 0, a] + (scale[a] if scale[a] > 0.0 else 1.0) * rows[a, n]
        put(start, state.x)
    _go_back(state, scratch)
    return FAILED


@inlined
def _go_back(state: Any, scratch: Any) -> None:
    """Return to the state before Newton's method."""
    put(scratch.last, state.x)
    put(scratch.modes, state.z)
    begin_segment(state)


@inline_always
def _shortest(packs: Any, points: Any, scratch: Any, i: int, multiple: int, tol: float) -> tuple[int, int]:
    """Find the shortest period of the motion; return its number of forcing periods and its number of segments.

    There are 0 segments if the motion nearly repeats earlier. multiple: number of periods after which it repeats.
    """
    state, start = packs.state, points.starts[i]
    for shorter in range(1, multiple + 1):
        if multiple % shorter != 0:
            continue
        put(start, state.x)
        put(scratch.modes, state.z)
        begin_segment(state)
        segments = run_periods(packs, shorter * points.periods[i])
        change = relative_change(start, state.x, scratch.scale)
        if segments == 0 or shorter == multiple or change <= _SAME * tol:
            return shorter, segments
        if change <= NEARLY * tol:
            return shorter, 0
    return multiple, 0
