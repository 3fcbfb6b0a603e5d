"""The compiled mode loop of linear modes: each segment in closed form, from event to event, no Python between.

As `hybridsim.engine.run.leap`, with one closed form for a segment where that has steps.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.after_segment import (
    is_crowded,
    moved_on,
    reach_settling,
    settle_and_move_on,
    state_errors,
)
from hybridsim.engine.events.compiled.at_end import may_be_at_zero_of_linear
from hybridsim.engine.events.compiled.scratch import LEAP, ROW, called_by
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
    call_apart,
    call_kernel,
    inlined,
    kernel,
    kernel_address,
    merged,
)
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.simd_products import dot, vector_of
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.roots.first_exit import FOUND, OPEN
from hybridsim.engine.run.leap import AT_TARGET, FULL, STOPPED, holding, set_origin
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.programs.modes_index import find_modes

_NONE, _OPEN = -1, -2  # no guard goes negative; a question of rounding
_DONE = -1.0  # in place of a guard's size: its first zero is known


class Room(NamedTuple):
    """What a leap is to do, and scratch arrays.

    rates (R,) of angles, where in p the origin and the phases are (2,), the longest segment (1,), times (4,): the
    target, and the clock, which is moved on; how many segments were committed (1,), from how many points guards were
    followed (1,). Modal coordinates (J,), their sizes, terms of a guard (2, BOUND_TERMS), those at the start (G,
    BOUND_TERMS + 2), a state; hints (K, G): how long after these modes were entered a guard was zero when they were
    met last in this run, 0 where it was not; former (G,): a row of it before the segment under way; terms near a
    start (2, n + M).
    """

    rates: np.ndarray
    places: np.ndarray
    longest: np.ndarray
    times: np.ndarray
    committed: np.ndarray
    points: np.ndarray
    c: np.ndarray
    v: np.ndarray
    sizes: np.ndarray
    terms: np.ndarray
    starts: np.ndarray
    hints: np.ndarray
    former: np.ndarray
    series: np.ndarray
    scale: np.ndarray
    pace: np.ndarray


class Record(NamedTuple):
    """What is committed of each segment: its end in local time, origin (2,), row of the tables, modes, run-time vector,
    modal coordinates at its start, the guard that fired (-1: none), states at start and both sides of its end (3, n).
    """

    ends: np.ndarray
    clocks: np.ndarray
    rows: np.ndarray
    modes: np.ndarray
    vectors: np.ndarray
    coordinates: np.ndarray
    fires: np.ndarray
    jumps: np.ndarray


@merged
def first_exit_of(lin: Any, tapes: Any, k: int, bound: float, state: Any, room: Any) -> tuple[int, float]:
    """The guard of the modes in row k that first goes negative, and when; (_NONE, bound), or (_OPEN, time).

    Waves have their zeros in closed form. Of the others the one that was zero soonest when these modes were met last
    goes first, or else the one that falls fastest: the rest need to be followed no farther than it lasts. All are
    followed up to one horizon, and then to one four times as far: most stay positive for long.
    """
    c, starts, hints, sides, orders = room.c, room.starts, room.hints, state.sides, state.orders
    first, last = tapes.active_start[k], tapes.active_start[k + 1]
    lead, soonest, horizon, known, until = first, math.inf, bound, _NONE, bound
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
        fired, s = (known, until) if until <= horizon else (_NONE, min(horizon, bound))
        for j in range(first, last):
            i = lead if j == first else (j - 1 if j <= lead else j)
            if starts[i - first, BOUND_TERMS] == _DONE:
                continue
            g = tapes.active[i]
            outcome, at = first_zero(lin, k, g, i - first, s, state, room)
            if outcome == OPEN:
                return _OPEN, at
            if outcome == FOUND:
                fired, s = g, at
                hints[k, g] = at
        if fired >= 0 or horizon >= bound:
            return fired, s
        horizon *= 4.0


def room_for(system: Any, tables: Any) -> Room:
    """Room for leaps of a system by tables like these, as kernels take it."""
    n, widest, layout = system.n, tables.values.shape[1], system.layout
    room: Room = packed(
        Room(
            rates=np.zeros(layout.phases),
            places=np.array([layout.origin_at, layout.phases_at], dtype=np.int64),
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
    return room


@inlined
def stopped(hints: Any, k: int, former: Any) -> int:
    """The segment under way is left to others, or to a leap that begins with it: its zeros have not been met."""
    put(former, hints[k])
    return STOPPED


def exact_leap(
    automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any, room: Any, record: Any
) -> int:
    """Go from event to event; returns why it ended: FULL too where guards were followed for a second, or after growth.

    It is reached by its address, so that it is compiled once for all that go by it. automata, tapes, inputs, state,
    work as for `leap`; lin: tables of linear modes. record: what the segments and events are written to.
    """
    place, rates = (room.places[0], room.places[1]), room.rates
    longest, target, clock, functions = room.longest[0], room.times[:2], room.times[2:], called_by(work)
    committed = room.committed
    committed[0] = room.points[0] = 0
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    c, v, scale = room.c, room.v, room.scale
    y, y1, y_error, slopes = work.y, work.x_after, work.y_error, work.slopes
    ends, clocks, rows, modes = record.ends, record.clocks, record.rows, record.modes
    vectors, coordinates, fires, jumps = record.vectors, record.coordinates, record.fires, record.jumps
    n, n_segments = x.shape[0], 0
    pace = room.pace
    pace[0], pace[1], pace[2] = math.inf, math.inf, 0.0
    hints, former = room.hints, room.former
    k, is_known = find_modes(tapes, z), False
    while True:
        bound = (target[0] - clock[0]) + (target[1] - clock[1])
        if not bound > 0.0:
            return AT_TARGET
        if k < 0:
            return STOPPED
        if n_segments >= ends.shape[0] or room.points[0] > POINTS:
            return FULL
        if not is_known:
            set_origin(place, rates, clock[0], clock[1], p)
            functions_of_time(lin, 0.0, p, work.factors, work.w)
        put(hints[k], former)
        to_modal(lin, k, x, work.w, c)
        until = min(bound, lin.lasting[k])
        fired, s = first_exit_of(lin, tapes, k, until, state, room)
        if fired == _OPEN:
            return stopped(hints, k, former)
        if s > longest:
            return stopped(hints, k, former)
        moved(lin, k, c, s, v)
        states_of(lin, k, v, y)
        if s < lin.near[k]:
            call_apart(states_near_start, (lin, k, x, work.w, s, room.series, y))
        state_sizes(lin, k, c, v, room.sizes, scale)
        if holding(automata, z):
            call(functions.project, s, y, p, z, y1)
            put(y1, y)
        for i in range(n):
            if not abs(y[i]) < math.inf:
                return stopped(hints, k, former)
        if fired < 0 and until == bound:
            time = max(abs(target[0]), abs(clock[0]))
            if may_be_at_zero_of_linear(lin, tapes, k, s, time, v, room.sizes, room.terms[0]):
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
            if until < bound:  # the next leap begins there, with functions of time from there
                clock[0], clock[1] = moved_on(clock[0], clock[1], s)
                for g in range(state.sides.shape[0]):
                    state.sides[g], state.orders[g], state.floors[g] = 1, 0, 0.0
                return FULL
            clock[0], clock[1] = target[0], target[1]
            return AT_TARGET
        if is_crowded(s, clock, pace):
            return stopped(hints, k, former)
        # the event is settled at the origin of the segment that follows, whose functions of time these are
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
        work.whole[ROW] = k
        if not settle_and_move_on(automata, tapes, inputs, lin, 0.0, s_error, fired, 1, clock, state, work):
            clock[0], clock[1] = high, low
            set_origin(place, rates, high, low, p)
            return stopped(hints, k, former)
        k = work.whole[ROW] if work.whole[ROW] != k else find_modes(tapes, z)
        is_known = automata.hold[automata.owner[fired]] >= 0  # others may have changed what is in p
        put(y1, jumps[n_segments, 2])
        n_segments += 1
        committed[0] = n_segments


@kernel
def leap_at_address(
    automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any, room: Any, record: Any
) -> int:
    """Call `exact_leap`."""
    return call_kernel(work.reached[LEAP], (automata, tapes, inputs, lin, state, work, room, record))


def reach_leap(
    automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any, room: Any, record: Any
) -> None:
    """Compile what a leap needs, if need be, and put the addresses where kernels find them."""
    reach_settling(automata, tapes, inputs, lin, state, work)
    work.reached[LEAP] = kernel_address(exact_leap, automata, tapes, inputs, lin, state, work, room, record)
