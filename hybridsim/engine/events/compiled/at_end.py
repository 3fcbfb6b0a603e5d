"""Whether a guard may be zero at the known time at which a compiled loop ends a segment: it leaves that to others.

What is zero there within rounding comes before what is due. The general way has the bounds that decide it; those here
are wider, so that both loops decide alike.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.compiled.after_segment import STAGES, judge
from hybridsim.engine.linear.motion import guard_terms
from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.series.bounded import UNIT

_NEAR = 2.0**-32  # of what a guard is made of: far beyond all that rounding leaves of a zero
_FAR = 2.0**-10  # of the largest value of a guard on a segment: nearer than this its bound is asked for
_SHORT = 2.0**-13  # of a run's time: on shorter segments a guard may have been that near all along


@inlined
def is_clear(values: Any, largest: Any, s: float, time: float) -> bool:
    """Whether guards are far from zero at the end of a segment, at local time s, by their largest values on it."""
    clear = s > _SHORT * time
    for i in range(values.shape[0]):
        clear = clear and (abs(values[i]) > _FAR * largest[i] or largest[i] == 0.0)
    return clear


@kernel
def may_be_at_zero(
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    k: int,
    s: float,
    time: float,
    steps: int,
    scale: Any,
    slopes: Any,
    state: Any,
    work: Any,
) -> bool:
    """Whether a guard of the modes in row k may be zero and about to be negative, after so many steps of a segment.

    y of the work space is the state there, at local time s, slopes its rates; scale: as for `state_errors`.
    """
    s_error = 8.0 * 2.0**-52 * time
    for i in range(scale.shape[0]):
        rounded = UNIT * (16.0 * steps + STAGES) * (2.0 + steps) * scale[i]
        work.y_error[i] = 2.0 * state.x_error[i] + rounded + s_error * abs(slopes[i])
    judge(automata, tapes, inputs, lin, s, s_error, state, work)
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        series, bounds = work.judged[0, tapes.active[i]], work.judged[1, tapes.active[i]]
        is_still = True
        for j in range(series.shape[0]):
            is_still = is_still and series[j] == 0.0
        if not (is_still or abs(series[0]) > bounds[0] or series[1] > bounds[1]):
            return True
    return False


@inlined
def may_be_at_zero_of_linear(
    lin: Any, tapes: Any, k: int, s: float, time: float, v: Any, sizes: Any, terms: Any
) -> bool:
    """The same for linear modes at modal coordinates v, of these sizes on the segment. terms (TERMS,): room."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g, size = tapes.active[i], 0.0
        guard_terms(lin, k, g, v, terms)
        for j in range(lin.counts[k]):
            size += lin.sizes[k, g, j] * sizes[j]
        size += abs(terms[1]) * (s + time) + abs(terms[2]) * s * s + abs(terms[3]) * s * s * s
        rises = terms[1] * min(lin.farthest[k, g], max(s, time)) > 2.0 * _NEAR * size
        if size > 0.0 and not (abs(terms[0]) > _NEAR * size or rises):
            return True
    return False
