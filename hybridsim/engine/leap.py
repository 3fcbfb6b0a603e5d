"""The compiled mode loop: Taylor steps from event to event, ordinary events settled on the way, no Python between.

A leap goes over whole segments and commits them one by one. It ends at its target time, or before the first segment
that holds something which is not ordinary; the mode loop then takes that one segment by its general way.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.event_work import find_modes, put
from hybridsim.engine.first_exit import FOUND, NEVER, OPEN, first_exit
from hybridsim.engine.jets import UNIT
from hybridsim.engine.jit import call, inlined, kernel
from hybridsim.engine.segment_end import is_crowded, settle_and_move_on, state_errors
from hybridsim.engine.taylor import advance, expand, reach
from hybridsim.engine.timepair import phase_of

AT_TARGET, STOPPED, FULL = 0, 1, 2
_DEFECT = 100.0  # as in the taylor integrator
_SHORTER = 0.25
_TRIALS = 30
_SMALLEST = 10.0


class Room(NamedTuple):
    """Scratch arrays: two sets of series (registers, order + 1), a polynomial, its Bernstein forms, a state, guards."""

    V: np.ndarray
    W: np.ndarray
    a: np.ndarray
    b: np.ndarray
    stack: np.ndarray
    scale: np.ndarray
    sides: np.ndarray
    orders: np.ndarray
    floors: np.ndarray
    watched: np.ndarray
    pace: np.ndarray


class Record(NamedTuple):
    """What is committed: steps (S, 2) and their series (S, n, order + 1); for each segment the row after its last step,
    its origin (2,), modes, run-time vector, the guard that fired (-1: none), and the states before and after (2, n)."""

    steps: np.ndarray
    series: np.ndarray
    segments: np.ndarray
    clocks: np.ndarray
    modes: np.ndarray
    vectors: np.ndarray
    fires: np.ndarray
    jumps: np.ndarray


@inlined
def set_origin(place: Any, rates: Any, hi: float, lo: float, p: Any) -> None:
    """The run-time vector of a segment whose local time starts at an instant; inputs are left as they are."""
    origin_at, phases_at = place
    p[origin_at] = hi + lo
    for i in range(rates.shape[0]):
        p[phases_at + i] = phase_of(hi, lo, rates[i], 0.0)


@inlined
def load(inputs: Any, tapes: Any, k: int, p: Any, V: Any) -> None:
    """Constants of a segment into their registers."""
    for i in range(inputs.constants.shape[0]):
        V[inputs.constants[i], 0] = inputs.values[i, 0]
    for i in range(inputs.parameters.shape[0]):
        V[inputs.parameters[i], 0] = p[inputs.sources[i]]
    advance(tapes.constant[tapes.constant_start[k] : tapes.constant_start[k + 1]], V, 0)


@kernel
def holds(
    rows: Any,
    places: Any,
    order: int,
    s: float,
    x0: Any,
    x1: Any,
    d: float,
    rtol: float,
    atol: Any,
    watched: Any,
    V: Any,
    W: Any,
) -> bool:
    """Whether the series V from s still hold at s + d, where the state is x1: the equation, and the guards' values."""
    time, states, derivatives = places
    if time >= 0:
        W[time, 0] = s + d
    for i in range(states.shape[0]):
        W[states[i], 0] = x1[i]
    advance(rows, W, 0)
    for i in range(states.shape[0]):
        slope, change, power = 0.0, 0.0, 1.0
        for k in range(1, order + 1):
            term = V[states[i], k] * power
            slope += k * term
            power *= d
            change += abs(term * d)
        scale = atol[i] + rtol * max(abs(x0[i]), abs(x1[i])) + rtol * change
        if not abs(d * (slope - W[derivatives[i], 0])) <= _DEFECT * scale:
            return False
    for j in range(watched.shape[0]):
        r = watched[j]
        value, largest, power = 0.0, 0.0, 1.0
        for k in range(order + 1):
            term = V[r, k] * power
            value += term
            largest = max(largest, abs(term))
            power *= d
        if not abs(value - W[r, 0]) <= (_DEFECT * rtol + 64.0 * UNIT) * largest:
            return False
    return True


@inlined
def value_and_slope(rows: Any, places: Any, register: int, s: float, x: Any, W: Any) -> tuple[float, float]:
    """A function of the tape and its rate along the flow at (s, x)."""
    expand(rows, places, 1, s, x, W)
    return W[register, 0], W[register, 1]


@inlined
def state_at(states: Any, order: int, d: float, V: Any, x: Any) -> None:
    """States at a distance d from the origin of the series (Horner)."""
    for i in range(states.shape[0]):
        total = V[states[i], order]
        for k in range(order - 1, -1, -1):
            total = total * d + V[states[i], k]
        x[i] = total


@kernel
def earliest_exit(
    tapes: Any,
    k: int,
    order: int,
    h: float,
    sides: Any,
    orders: Any,
    floors: Any,
    V: Any,
    a: Any,
    b: Any,
    stack: Any,
) -> tuple[int, int, float]:
    """(NEVER, -1, h), or the guard of the mode that first goes negative in a step of length h: (FOUND, guard, time)."""
    found, best = -1, 1.0
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        r = tapes.guards[k, g]
        power, total = 1.0, 0.0
        for j in range(order + 1):
            a[j] = V[r, j] * power
            total += abs(a[j])
            power *= h
        if not total < math.inf:
            return OPEN, g, 0.0
        if total == 0.0 and sides[g] >= 0:
            continue  # zero all along: neither a side nor a change of it
        if sides[g] <= 0:
            return OPEN, g, 0.0
        error = 2.0 * (abs(a[order]) + abs(a[order - 1])) + 8.0 * UNIT * total + floors[g]
        if not error < math.inf:  # nothing is below what is not a number, and halving would not end
            return OPEN, g, 0.0
        outcome, theta = first_exit(a[: order + 1], error, orders[g], b, stack)
        if outcome == OPEN:
            return OPEN, g, theta * h
        if outcome == FOUND and (found < 0 or theta < best):
            found, best = g, theta
    return (FOUND, found, best * h) if found >= 0 else (NEVER, -1, h)


@kernel
def leap(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    places: Any,
    control: Any,
    target: Any,
    clock: Any,
    state: Any,
    work: Any,
    room: Any,
    record: Any,
) -> tuple[int, int, int]:
    """Go from event to event; returns why it ended and how many steps and segments were committed.

    places: rates, then where in p the origin and the phases are.
    control: rtol, atol, order, max_step, longest segment. target (2,): instant at which to stop. clock (2,): origin of
    the segment, moved on. state: x, x_error, z, p, sides, orders, floors at the start of the segment, moved on. room:
    scratch arrays. record: what the committed steps, segments and events are written to.
    """
    rates, origin_at, phases_at = places
    rtol, atol, order, max_step, longest = control
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    sides, orders, floors = state.sides, state.orders, state.floors
    V, W, a, b, stack = room.V, room.W, room.a, room.b, room.stack
    y, y1, y_error, slopes, scale = work.y, work.x_after, work.y_error, work.slopes, room.scale
    side_now, order_now, floor_now = room.sides, room.orders, room.floors
    steps, series, segments, clocks = record.steps, record.series, record.segments, record.clocks
    modes, vectors, fires, jumps = record.modes, record.vectors, record.fires, record.jumps
    time, states = inputs.time[0], inputs.states
    n, n_steps, n_segments = x.shape[0], 0, 0
    pace = room.pace
    pace[0], pace[1], pace[2] = math.inf, math.inf, 0.0
    while True:
        k, first_step = find_modes(tapes.modes, z), n_steps
        bound = (target[0] - clock[0]) + (target[1] - clock[1])
        if not bound > 0.0:
            return AT_TARGET, n_steps, n_segments
        if k < 0:
            return STOPPED, n_steps, n_segments
        if n_segments >= segments.shape[0]:
            return FULL, n_steps, n_segments
        set_origin((origin_at, phases_at), rates, clock[0], clock[1], p)
        rows = tapes.lean[tapes.lean_start[k] : tapes.lean_start[k + 1]]
        flow_places = (time, states, tapes.derivatives[k])
        load(inputs, tapes, k, p, V)
        load(inputs, tapes, k, p, W)
        count = tapes.active_start[k + 1] - tapes.active_start[k]
        watched = room.watched[:count]
        for i in range(count):
            watched[i] = tapes.guards[k, tapes.active[tapes.active_start[k] + i]]
        put(sides, side_now)
        put(orders, order_now)
        put(floors, floor_now)
        put(x, y)
        s, fired, lands = 0.0, -1, landing(automata, z)
        for i in range(n):
            scale[i] = abs(x[i])
        while fired < 0 and s < bound:
            if n_steps >= steps.shape[0]:
                return FULL, first_step, n_segments
            if s > longest:
                return STOPPED, first_step, n_segments
            expand(rows, flow_places, order, s, y, V)
            left = bound - s
            h = reach(V, states, watched, order, rtol, atol, min(left, max_step))
            if not h > _SMALLEST * 2.0**-52 * s:
                return STOPPED, first_step, n_segments
            outcome, g, d = earliest_exit(tapes, k, order, h, side_now, order_now, floor_now, V, a, b, stack)
            if outcome == OPEN:
                return STOPPED, first_step, n_segments
            state_at(states, order, d, V, y1)
            trials = 0
            while not holds(rows, flow_places, order, s, y, y1, d, rtol, atol, watched, V, W):
                d, outcome, trials = _SHORTER * d, NEVER, trials + 1
                if trials > _TRIALS:
                    return STOPPED, first_step, n_segments
                state_at(states, order, d, V, y1)
            steps[n_steps, 0], steps[n_steps, 1] = s, d
            for i in range(n):
                for j in range(order + 1):
                    series[n_steps, i, j] = V[states[i], j]
            n_steps += 1
            s = bound if outcome == NEVER and trials == 0 and d >= left else s + d
            if outcome == FOUND:
                fired = g
            if lands:
                call(functions.project, s, y1, p, z, y)
            else:
                put(y1, y)
            for i in range(n):
                scale[i] = max(scale[i], abs(y1[i]))
            for g in range(side_now.shape[0]):
                side_now[g], order_now[g], floor_now[g] = 1, 0, 0.0
        if holding(automata, z):
            call(functions.project, s, y, p, z, y1)
            put(y1, y)
        segments[n_segments], clocks[n_segments, 0], clocks[n_segments, 1] = n_steps, clock[0], clock[1]
        fires[n_segments] = fired
        put(z, modes[n_segments])
        put(p, vectors[n_segments])
        put(y, jumps[n_segments, 0])
        put(y, jumps[n_segments, 1])
        if fired < 0:
            put(y, x)
            for i in range(n):
                x_error[i] = 4.0 * UNIT * scale[i] + x_error[i]
            clock[0], clock[1] = target[0], target[1]
            return AT_TARGET, n_steps, n_segments + 1
        if is_crowded(s, clock, pace):
            return STOPPED, first_step, n_segments
        s_error = 2.0 * 2.0**-52 * s
        value, slope = value_and_slope(rows, flow_places, tapes.guards[k, fired], s, y, W)
        if slope != 0.0 and math.isfinite(value / slope):
            s_error = max(s_error, abs(value / slope))
        call(functions.flow, s, y, p, z, slopes)
        state_errors(automata, s_error, y, scale, x_error, z, slopes, y_error)
        if not settle_and_move_on(automata, tapes, inputs, lin, s, s_error, fired, clock, state, work):
            return STOPPED, first_step, n_segments
        put(y1, jumps[n_segments, 1])
        n_segments += 1


@inlined
def holding(automata: Any, z: Any) -> bool:
    """Whether any component holds its surface."""
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c]:
            return True
    return False


@inlined
def landing(automata: Any, z: Any) -> bool:
    """Whether any component keeps its surface by projection, onto which each step is to land."""
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c] and automata.pin[c, 0] < 0:
            return True
    return False
