"""The compiled mode loop of linear modes, which goes from event to event in closed form without Python calls.

It corresponds to `hybridsim.engine.run.event_loop`, with one closed form per segment instead of steps.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.after_segment import (
    is_crowded,
    link_event_resolution,
    moved_on,
    resolve_and_advance,
    state_errors,
)
from hybridsim.engine.events.compiled.at_end import may_vanish_linear
from hybridsim.engine.events.compiled.scratch import EVENT_LOOP, ROW, called_by
from hybridsim.engine.linear.motion import (
    POINTS,
    errors_of_time,
    first_zero,
    first_zero_of_wave,
    functions_of_time,
    guard_terms,
    moved,
    slopes_of,
    state_sizes,
    states_near_start,
    states_of,
    to_modal,
)
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.kernels import (
    call,
    call_kernel,
    call_noinline,
    inline_always,
    inlined,
    kernel,
    kernel_address,
)
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.simd_products import dot, vector_of
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.roots.first_exit import FOUND, OPEN
from hybridsim.engine.run.event_loop import AT_TARGET, FULL, STOPPED, any_holding, set_origin
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.programs.modes_index import find_modes

_NO_GUARD, _OPEN = -1, -2  # no guard becomes negative; undecided because of rounding
_DONE = -1.0  # replaces a guard's size if its first zero is known


class Scratch(NamedTuple):
    """Task and scratch arrays of the compiled loop."""

    rates: np.ndarray  # (R,) rates of the angles
    layout_positions: np.ndarray  # (2,) places in p of the origin and of the phases
    longest: np.ndarray  # (1,) longest segment
    times: np.ndarray  # (4,) target, and clock, which is advanced
    committed: np.ndarray  # (1,) number of committed segments
    points: np.ndarray  # (1,) number of points from which guards were followed
    c: np.ndarray  # (J,) modal coordinates
    v: np.ndarray  # (J,) modal coordinates
    sizes: np.ndarray  # (J,) sizes of modal coordinates
    terms: np.ndarray  # (2, BOUND_TERMS) terms of a guard
    starts: np.ndarray  # (G, BOUND_TERMS + 2) terms of the guards at the start, with bounds
    hints: np.ndarray  # (K, G) time from entry to the last zero of a guard in this run, or 0
    former: np.ndarray  # (G,) a row of hints before the current segment
    series: np.ndarray  # (2, n + M) terms near a start
    scale: np.ndarray
    pace: np.ndarray


class Record(NamedTuple):
    """The committed segments, one row each."""

    ends: np.ndarray  # end in local time
    clocks: np.ndarray  # (., 2) time origin
    rows: np.ndarray  # row of the tables
    modes: np.ndarray  # mode vector
    vectors: np.ndarray  # run-time vector
    coordinates: np.ndarray  # modal coordinates at the start
    fires: np.ndarray  # guard that fired (-1: none)
    jumps: np.ndarray  # (., 3, n) state at the start, and before and after the end


@inline_always
def first_exit_of(lin: Any, tapes: Any, k: int, bound: float, state: Any, scratch: Any) -> tuple[int, float]:
    """Find the guard of the modes in row k that first becomes negative, and when; (_NO_GUARD, bound), or (_OPEN, time).

    Waves have their zeros in closed form. Of the other guards the one with the earliest zero in the last
    visit of these modes comes first, or else the one that falls fastest. The rest need to be followed no
    farther than its zero. All are followed up to one horizon, and then up to four times as far, since most
    stay positive for long.
    """
    c, starts, hints, sides, orders = scratch.c, scratch.starts, scratch.hints, state.sides, state.orders
    first, last = tapes.active_start[k], tapes.active_start[k + 1]
    lead, soonest, horizon, known, until = first, math.inf, bound, _NO_GUARD, bound
    for i in range(first, last):
        g = tapes.active[i]
        start = starts[i - first]
        if lin.waves[k, g] >= 0 and orders[g] == 0 and sides[g] > 0:
            outcome, at = first_zero_of_wave(lin, k, g, c, until)
            if outcome != OPEN:
                start[BOUND_TERMS] = _DONE
                if outcome == FOUND:
                    known, until = g, at
                continue
        start[BOUND_TERMS], start[BOUND_TERMS + 1] = guard_terms(lin, k, g, c, start)
        guess = math.inf
        if hints[k, g] > 0.0:
            guess = hints[k, g]
        elif start[1] < 0.0:
            guess = start[0] / -start[1]
        if guess < soonest:
            lead, soonest = i, guess
        if last - first > 1:
            horizon = min(horizon, lin.farthest[k, g])
    if not horizon > 0.0:
        return _OPEN, 0.0
    while True:
        fired, s = (known, until) if until <= horizon else (_NO_GUARD, min(horizon, bound))
        for j in range(first, last):
            i = lead if j == first else (j - 1 if j <= lead else j)
            if starts[i - first, BOUND_TERMS] == _DONE:
                continue
            g = tapes.active[i]
            outcome, at = first_zero(lin, k, g, i - first, s, state, scratch)
            if outcome == OPEN:
                return _OPEN, at
            if outcome == FOUND:
                fired, s = g, at
                hints[k, g] = at
        if fired >= 0 or horizon >= bound:
            return fired, s
        horizon *= 4.0


def scratch_for(system: Any, tables: Any) -> Scratch:
    """Return scratch arrays for the compiled loop of a system with tables of this shape, packed for kernels."""
    n, widest, layout = system.n, tables.values.shape[1], system.layout
    scratch: Scratch = packed(
        Scratch(
            rates=np.zeros(layout.phases),
            layout_positions=np.array([layout.origin_at, layout.phases_at], dtype=np.int64),
            longest=np.zeros(1),
            times=np.zeros(4),
            committed=np.zeros(1, dtype=np.int64),
            points=np.zeros(1, dtype=np.int64),
            c=np.zeros(widest, dtype=complex),
            v=np.zeros(widest, dtype=complex),
            sizes=vector_of(widest),
            terms=np.zeros((2, BOUND_TERMS)),
            starts=np.zeros((system.guard_count, BOUND_TERMS + 2)),
            hints=np.zeros(tables.farthest.shape),
            former=np.zeros(tables.farthest.shape[1]),
            series=np.zeros((2, tables.flows.shape[1])),
            scale=np.empty(n),
            pace=np.empty(3),
        )
    )
    return scratch


@inlined
def stopped(hints: Any, k: int, former: Any) -> int:
    """Restore the initial guesses of zeros for the current segment, because the segment is not committed."""
    put(former, hints[k])
    return STOPPED


def linear_event_loop(
    automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any, scratch: Any, record: Any
) -> int:
    """Run from event to event and return why the loop ended; FULL: full arrays, much work, or growing states.

    The kernel is called by address, so that it is compiled once for all callers. automata, tapes, inputs,
    state and work are as for `event_loop`; lin: tables of linear modes; record: output for segments and events.
    """
    place, rates = (scratch.layout_positions[0], scratch.layout_positions[1]), scratch.rates
    longest, target, clock, functions = (
        scratch.longest[0],
        scratch.times[:2],
        scratch.times[2:],
        called_by(work),
    )
    committed = scratch.committed
    committed[0] = scratch.points[0] = 0
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    c, v, scale = scratch.c, scratch.v, scratch.scale
    y, y1, y_error, slopes = work.y, work.x_after, work.y_error, work.slopes
    ends, clocks, rows, modes = record.ends, record.clocks, record.rows, record.modes
    vectors, coordinates, fires, jumps = record.vectors, record.coordinates, record.fires, record.jumps
    n, n_segments = x.shape[0], 0
    pace = scratch.pace
    pace[0], pace[1], pace[2] = math.inf, math.inf, 0.0
    hints, former = scratch.hints, scratch.former
    k, is_known = find_modes(tapes, z), False
    while True:
        bound = (target[0] - clock[0]) + (target[1] - clock[1])
        if not bound > 0.0:
            return AT_TARGET
        if k < 0:
            return STOPPED
        if n_segments >= ends.shape[0] or scratch.points[0] > POINTS:
            return FULL
        if not is_known:
            set_origin(place, rates, clock[0], clock[1], p)
            functions_of_time(lin, 0.0, p, work.factors, work.w)
        put(hints[k], former)
        to_modal(lin, k, x, work.w, c)
        until = min(bound, lin.lasting[k])
        fired, s = first_exit_of(lin, tapes, k, until, state, scratch)
        if fired == _OPEN:
            return stopped(hints, k, former)
        if s > longest:
            return stopped(hints, k, former)
        moved(lin, k, c, s, v)
        states_of(lin, k, v, y)
        if s < lin.near[k]:
            call_noinline(states_near_start, (lin, k, x, work.w, s, scratch.series, y))
        state_sizes(lin, k, c, v, scratch.sizes, scale)
        if any_holding(automata, z):
            call(functions.project, s, y, p, z, y1)
            put(y1, y)
        for i in range(n):
            if not abs(y[i]) < math.inf:
                return stopped(hints, k, former)
        if fired < 0 and until == bound:
            time = max(abs(target[0]), abs(clock[0]))
            if may_vanish_linear(lin, tapes, k, s, time, v, scratch.sizes, scratch.terms[0]):
                return stopped(hints, k, former)
        ends[n_segments], clocks[n_segments, 0], clocks[n_segments, 1] = s, clock[0], clock[1]
        rows[n_segments], fires[n_segments] = k, fired
        put(z, modes[n_segments])
        put(p, vectors[n_segments])
        put(c, coordinates[n_segments])
        put(x, jumps[n_segments, 0])
        put(y, jumps[n_segments, 1])
        put(y, jumps[n_segments, 2])
        if fired < 0:
            put(y, x)
            for i in range(n):
                x_error[i] = 4.0 * UNIT * scale[i] + x_error[i]
            committed[0] = n_segments + 1
            if until < bound:  # the next call begins there, with new functions of time
                clock[0], clock[1] = moved_on(clock[0], clock[1], s)
                for g in range(state.sides.shape[0]):
                    state.sides[g], state.orders[g], state.floors[g] = 1, 0, 0.0
                return FULL
            clock[0], clock[1] = target[0], target[1]
            return AT_TARGET
        if is_crowded(s, clock, pace):
            return stopped(hints, k, former)
        # the event is resolved at the origin of the next segment, to which these functions of time belong
        high, low = clock[0], clock[1]
        clock[0], clock[1] = moved_on(high, low, s)
        set_origin(place, rates, clock[0], clock[1], p)
        s_error = 2.0 * 2.0**-52 * s
        functions_of_time(lin, 0.0, p, work.factors, work.w)
        value = dot(lin.series, (k, fired, 0), (y, work.w))
        slope = dot(lin.series, (k, fired, 1), (y, work.w))
        if abs(value) > s_error * abs(slope) and slope != 0.0 and math.isfinite(value / slope):
            s_error = abs(value / slope)
        errors_of_time(lin, s_error, work.factors, work.w_error)
        slopes_of(lin, k, y, work.w, slopes)
        state_errors(automata, s_error, y, scale, x_error, z, slopes, y_error)
        work.int_slots[ROW] = k
        if not resolve_and_advance(automata, tapes, inputs, lin, 0.0, s_error, fired, 1, clock, state, work):
            clock[0], clock[1] = high, low
            set_origin(place, rates, high, low, p)
            return stopped(hints, k, former)
        k = work.int_slots[ROW] if work.int_slots[ROW] != k else find_modes(tapes, z)
        is_known = automata.hold[automata.owner[fired]] >= 0  # another event may have changed p
        put(y1, jumps[n_segments, 2])
        n_segments += 1
        committed[0] = n_segments


@kernel
def call_event_loop(
    automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any, scratch: Any, record: Any
) -> int:
    """Call `linear_event_loop` by its address."""
    return call_kernel(
        work.entry_points[EVENT_LOOP], (automata, tapes, inputs, lin, state, work, scratch, record)
    )


def link_event_loop(
    automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any, scratch: Any, record: Any
) -> None:
    """Compile the kernels that a call needs, if necessary, and store their addresses for other kernels."""
    link_event_resolution(automata, tapes, inputs, lin, state, work)
    work.entry_points[EVENT_LOOP] = kernel_address(
        linear_event_loop, automata, tapes, inputs, lin, state, work, scratch, record
    )
