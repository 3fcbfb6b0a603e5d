"""This module decides in compiled code whether a run approaches a motion that Newton's method has found.

The rules and their numbers are those of `hybridsim.analysis.steady.approach`.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import inline_always, inlined
from hybridsim.engine.native.loop_hints import put
from hybridsim.ensemble.nearness import CLOSE, LINEAR, MOST, NEARER
from hybridsim.ensemble.period_map import begin_segment, run_periods, solve, word_of
from hybridsim.ensemble.returns import relative_change


@inlined
def solve_step(scratch: Any, before: Any, after: Any) -> bool:
    """Write Newton's step, in units of the scale, to the last column of `scratch.rows`; return False if there is none.

    before, after: states (n,) at both ends of a period. The derivative over the period is `scratch.map.matrix`.
    """
    rows, matrix, scale = scratch.rows, scratch.map.matrix, scratch.scale
    n = scale.shape[0]
    for a in range(n):
        unit = scale[a] if scale[a] > 0.0 else 1.0
        for b in range(n):
            rows[a, b] = -matrix[a, b] * (scale[b] if scale[b] > 0.0 else 1.0) / unit
        rows[a, a] += 1.0
        rows[a, n] = (after[a] - before[a]) / unit
    return solve(rows)


@inline_always
def is_approached(packs: Any, scratch: Any, length: float, start: Any, word: int) -> bool:
    """Return whether the run from `scratch.last` approaches a motion with its start (n,) and sequence of modes.

    length: the period. `scratch.map.matrix` is the derivative over it.
    """
    state, record, scale, before = packs.state, packs.record, scratch.scale, scratch.map.after
    first = relative_change(start, scratch.last, scale)
    distance = first
    put(scratch.last, state.x)
    put(scratch.modes, state.z)
    for _ in range(MOST):
        begin_segment(state)
        segments = run_periods(packs, length)
        if segments == 0 or word_of(packs.rows.rows, segments) != word:
            return False
        distance = relative_change(start, state.x, scale)
        if distance <= max(NEARER * first, CLOSE):
            return True
    if not solve_step(scratch, record.jumps[0, 0], state.x):
        return False
    for a in range(scale.shape[0]):
        unit = scale[a] if scale[a] > 0.0 else 1.0
        before[a] = record.jumps[0, 0, a] + unit * scratch.rows[a, scale.shape[0]]
    return relative_change(start, before, scale) <= LINEAR * distance
