"""Check whether a guard may be zero at the known end time of a segment.

A guard that is zero there within rounding comes before what is due, and the general loop decides it with its bounds.
The bounds here are wider, so that both loops decide alike.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.compiled.after_segment import STAGES, fill_guard_series
from hybridsim.engine.linear.guards import guard_size, guard_terms
from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.series.bounded import UNIT

_NEAR = 2.0**-32  # of the terms of a guard: far more than the rounding error of a zero
_FAR = 2.0**-10  # of the largest value of a guard on a segment; below it the error bound is computed
_SHORT = 2.0**-13  # of the time of a run; on shorter segments a guard may be close to zero throughout


@inlined
def is_clear(values: Any, largest: Any, s: float, time: float) -> bool:
    """Return whether all guards are far from zero at the end of a segment, relative to their maxima."""
    clear = s > _SHORT * time
    for i in range(values.shape[0]):
        clear = clear and (abs(values[i]) > _FAR * largest[i] or largest[i] == 0.0)
    return clear


@kernel
def may_vanish(
    model: Any, k: int, s: float, time: float, steps: int, scale: Any, slopes: Any, state: Any, work: Any
) -> bool:
    """Return whether a guard of the modes in row `k` may be zero and about to become negative.

    y of the work space is the state at local time s, after `steps` steps of the segment; slopes: its rates; scale: as
    for `state_errors`.
    """
    s_error, tapes = 8.0 * 2.0**-52 * time, model.tapes
    for i in range(scale.shape[0]):
        rounded = UNIT * (16.0 * steps + STAGES) * (2.0 + steps) * scale[i]
        work.y_error[i] = 2.0 * state.x_error[i] + rounded + s_error * abs(slopes[i])
    fill_guard_series(model, s, s_error, state, work)
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        series, bounds = work.judged[0, tapes.active[i]], work.judged[1, tapes.active[i]]
        is_still = True
        for j in range(series.shape[0]):
            is_still = is_still and series[j] == 0.0
        if not (is_still or abs(series[0]) > bounds[0] or series[1] > bounds[1]):
            return True
    return False


@kernel
def may_vanish_linear(lin: Any, tapes: Any, k: int, s: float, time: float, v: Any, own: Any) -> bool:
    """Return whether a guard of linear modes may be close to zero at the modal coordinates `v`.

    own: `hybridsim.integrators.closed_form.segments.ClosedFormArrays`, with the sizes of the coordinates.
    """
    terms = own.terms[0]
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        guard_terms(lin, k, g, v, terms, own.products)
        size = guard_size(lin, k, g, own.sizes)
        size += abs(terms[1]) * (s + time) + abs(terms[2]) * s * s + abs(terms[3]) * s * s * s
        rises = terms[1] * min(lin.farthest[k, g], max(s, time)) > 2.0 * _NEAR * size
        if size > 0.0 and not (abs(terms[0]) > _NEAR * size or rises):
            return True
    return False
