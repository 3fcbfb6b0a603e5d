"""This module computes a segment of linear motion in closed form, up to the first event."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.after_segment import moved_on
from hybridsim.engine.events.compiled.at_end import may_vanish_linear
from hybridsim.engine.events.compiled.known_time import (
    ORIGIN_AT,
    PHASES_AT,
    SEGMENTS,
    SIGNALS_AT,
    set_inputs,
    set_origin,
)
from hybridsim.engine.events.compiled.scratch import called_by
from hybridsim.engine.linear.guard_coefficients import guard_coefficient
from hybridsim.engine.linear.guards import guard_terms
from hybridsim.engine.linear.motion import (
    POINTS,
    errors_of_time,
    first_zero,
    first_zero_of_wave,
    functions_of_time,
    moved,
    slopes_of,
    state_sizes,
    states_near_start,
    states_of,
    to_modal,
)
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.kernels import call, call_noinline, inline_always, inlined
from hybridsim.engine.native.loop_hints import index, put
from hybridsim.engine.roots.first_exit import FOUND, OPEN
from hybridsim.engine.run.event_loop import (
    FOLLOWED,
    FULL,
    STOPPED,
    SegmentEnd,
    any_holding,
    event_loop,
    not_followed,
)

_NO_GUARD, _OPEN = -1, -2  # no guard becomes negative; undecided because of rounding
# A polynomial turns as fast as all its factors together. Its first horizon is longer by this factor, so that another
# guard may end the segment within it.
_REACH = 4.0
_DONE = -1.0  # replaces a guard's size if its first zero is known


class ClosedFormArrays(NamedTuple):
    """The arrays of the segment kernel, for J modal coordinates and K combinations of modes."""

    # number of points from which guards were followed, now and at the start of the segment
    points: np.ndarray
    c: np.ndarray  # (J,) modal coordinates
    v: np.ndarray  # (J,) modal coordinates
    sizes: np.ndarray  # (J,) sizes of modal coordinates
    terms: np.ndarray  # (2, BOUND_TERMS) terms of a guard
    starts: np.ndarray  # (G, BOUND_TERMS + 2) terms of the guards at the start, with bounds
    hints: np.ndarray  # (K, G) time from entry to the last zero of a guard in this run, or 0
    former: np.ndarray  # (G,) a row of hints before the current segment
    series: np.ndarray  # (2, n + M) terms near a start
    products: np.ndarray  # (3, BOUND_TERMS) zeros, and terms of a factor and of a product


class ClosedFormRows(NamedTuple):
    """One row of data for each stored segment."""

    ends: np.ndarray  # end in local time
    rows: np.ndarray  # row of the tables
    coordinates: np.ndarray  # modal coordinates at the start


@inline_always
def first_exit_of(lin: Any, tapes: Any, k: int, bound: float, state: Any, own: Any) -> tuple[int, float]:
    """Find the first guard that becomes negative in the modes of table row `k`, and the time at which it does.

    Waves have their zeros in closed form. Of the other guards the one with the earliest zero in the last
    visit of these modes comes first, or else the one that falls fastest. The rest need to be followed no
    farther than its zero. All are followed up to one horizon, and then up to four times as far, since most
    stay positive for long.
    """
    c, starts, hints, sides, orders = own.c, own.starts, own.hints, state.sides, state.orders
    first, last = index(tapes.active_start[k]), tapes.active_start[k + 1]
    lead, soonest, horizon, known, until = first, math.inf, bound, _NO_GUARD, bound
    for i in range(first, last):
        g = index(tapes.active[i])
        start = starts[index(i - first)]
        if lin.waves[k, g] >= 0 and orders[g] == 0 and sides[g] > 0:
            outcome, at = first_zero_of_wave(lin, k, g, c, until)
            if outcome != OPEN:
                start[BOUND_TERMS] = _DONE
                if outcome == FOUND:
                    known, until = g, at
                continue
        start[BOUND_TERMS], start[BOUND_TERMS + 1] = guard_terms(lin, k, g, c, start, own.products)
        guess = math.inf
        if hints[k, g] > 0.0:
            guess = hints[k, g]
        elif start[1] < 0.0:
            guess = start[0] / -start[1]
        if guess < soonest:
            lead, soonest = i, guess
        if last - first > 1:
            horizon = min(horizon, lin.farthest[k, g] * (_REACH if lin.is_polynomial[k, g] != 0 else 1.0))
    if not horizon > 0.0:
        return _OPEN, 0.0
    while True:
        fired, s = (known, until) if until <= horizon else (_NO_GUARD, min(horizon, bound))
        for j in range(first, last):
            i = lead if j == first else (j - 1 if j <= lead else j)
            if starts[index(i - first), BOUND_TERMS] == _DONE:
                continue
            g = index(tapes.active[i])
            outcome, at = call_noinline(first_zero, (lin, k, g, i - first, s, state, own))
            if outcome == OPEN:
                return _OPEN, at
            if outcome == FOUND:
                fired, s = g, at
                hints[k, g] = at
        if fired >= 0 or horizon >= bound:
            return fired, s
        horizon *= 4.0


@inlined
def stopped(hints: Any, k: int, former: Any) -> SegmentEnd:
    """Restore the stored zeros of guards, because this segment is not accepted."""
    put(former, hints[k])
    return not_followed(STOPPED)


@inlined
def closed_form_segment(
    start: Any, model: Any, loop: Any, state: Any, work: Any, own: Any, rows: Any
) -> SegmentEnd:
    """Compute one segment in closed form, as part of the compiled event loop of the method `exact`.

    The result is FULL also after POINTS evaluations of guards; the rest of the run then begins in another call.
    """
    ints, lin, hints, former = loop.int_slots, model.lin, own.hints, own.former
    k, bound, is_ahead, is_rejected = start
    number = ints[SEGMENTS]
    if is_rejected:
        own.points[0] = own.points[1]
        return stopped(hints, k, former)
    if number == 0:
        own.points[0] = 0
    own.points[1] = own.points[0]
    if own.points[0] > POINTS:
        return not_followed(FULL)
    automata, tapes, functions = model.automata, model.tapes, called_by(work)
    target, clock = loop.times[:2], loop.times[2:]
    x, z, p, c, v, y, y1 = state.x, state.z, state.p, own.c, own.v, work.y, work.x_after
    if not is_ahead:
        functions_of_time(lin, 0.0, p, work.factors, work.w)
    put(hints[k], former)
    to_modal(lin, k, x, work.w, c)
    until = min(bound, lin.lasting[k])
    fired, s = first_exit_of(lin, tapes, k, until, state, own)
    if fired == _OPEN or s > loop.longest[0]:
        return stopped(hints, k, former)
    moved(lin, k, c, s, v)
    states_of(lin, k, v, y)
    if s < lin.near[k]:
        call_noinline(states_near_start, (lin, k, x, work.w, s, own.series, y))
    state_sizes(lin, k, c, v, own.sizes, loop.scale)
    if any_holding(automata, z):
        call(functions.project, s, y, p, z, y1)
        put(y1, y)
    for i in range(x.shape[0]):
        if not abs(y[i]) < math.inf:
            return stopped(hints, k, former)
    if fired < 0 and until == bound:
        time = max(abs(target[0]), abs(clock[0]))
        if call_noinline(may_vanish_linear, (lin, tapes, k, s, time, v, own)):
            return stopped(hints, k, former)
    rows.ends[number], rows.rows[number] = s, k
    put(c, rows.coordinates[number])
    s_error = 2.0 * 2.0**-52 * s
    if fired >= 0:
        # the event is resolved at the origin of the next segment, to which these functions of time belong
        high, low = moved_on(clock[0], clock[1], s)
        set_origin((ints[ORIGIN_AT], ints[PHASES_AT]), loop.rates, high, low, p)
        set_inputs(ints[SIGNALS_AT], loop.known.starts, high, low, p)
        functions_of_time(lin, 0.0, p, work.factors, work.w)
        value = guard_coefficient(lin, k, fired, 0, y, work)
        slope = guard_coefficient(lin, k, fired, 1, y, work)
        if abs(value) > s_error * abs(slope) and slope != 0.0 and math.isfinite(value / slope):
            s_error = abs(value / slope)
        errors_of_time(lin, s_error, work.factors, work.w_error)
        slopes_of(lin, k, y, work.w, work.slopes)
    return SegmentEnd(FOLLOWED, s, fired, 1, 0.0, s_error, 0.0, 0.0, 0.0, fired >= 0)


def closed_form_loop(model: Any, call: Any, state: Any, work: Any, record: Any, own: Any, rows: Any) -> int:
    """Run from event to event, with segments in closed form."""
    return event_loop(closed_form_segment, model, call, state, work, record, own, rows)
