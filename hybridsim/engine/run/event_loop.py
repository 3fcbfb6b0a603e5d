"""The compiled mode loop: Taylor steps from event to event, with ordinary events resolved without Python.

A call integrates whole segments and commits them one by one. It ends at its target time, or before the first segment
with an event that is not ordinary. The general mode loop then takes that segment.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.after_segment import (
    differ_by_rounding,
    is_crowded,
    is_hidden,
    is_shallow,
    moved_on,
    resolve_and_advance,
    state_errors,
)
from hybridsim.engine.events.compiled.at_end import is_clear, may_vanish
from hybridsim.engine.native.constants import IN_A_ROW, STANDSTILL
from hybridsim.engine.native.kernels import call, call_noinline, call_series, inlined, kernel
from hybridsim.engine.native.loop_hints import fill, put
from hybridsim.engine.native.time_grid import on_the_grid
from hybridsim.engine.roots.defect_check import (
    BETWEEN,
    flow_holds,
    keeps_up,
    look_ahead,
    parts_of,
    seems_straight,
    values_at,
)
from hybridsim.engine.roots.earliest_exit import earliest_exit, parts_for_exit
from hybridsim.engine.roots.first_exit import FOUND, NEVER, OPEN
from hybridsim.engine.roots.vanishing_terms import may_end, where_it_ends
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.interpreter import SLACK, advance, expand, reach, sum_sizes
from hybridsim.engine.series.vanishing_kinds import KINDS, power_of, register_of
from hybridsim.engine.system.instant import phase_of
from hybridsim.engine.system.programs.modes_index import find_modes

AT_TARGET, STOPPED, FULL = 0, 1, 2
_SHORTER = 0.25
_TRIALS = 30
# Least number of steps in a part of a segment; with less space the next call takes the segment.
MIN_STEPS_IN_PART = 64


class Scratch(NamedTuple):
    """Scratch arrays of the kernel, for R registers, order + 1 terms, and G guards."""

    V: np.ndarray  # Taylor coefficients (R, order + 1) of all registers
    W: np.ndarray  # the same for values at other points, if the interpreter computes them
    guard_series: np.ndarray  # coefficients of active guards and of vanishing functions
    ahead: np.ndarray  # guards ahead of the step
    sizes: np.ndarray  # powers of a step, then sizes of guards over it
    numbers: np.ndarray  # 0, 1, ... for the guards
    a: np.ndarray  # coefficients (order + 1,) of a polynomial
    b: np.ndarray  # the same
    stack: np.ndarray  # its Bernstein forms
    scale: np.ndarray  # largest states (n,) on the segment
    sides: np.ndarray  # sides (G,) of the guards
    orders: np.ndarray  # their leading orders (G,)
    floors: np.ndarray  # their error bounds (G,)
    guard_registers: np.ndarray  # registers of the guards
    everyone: np.ndarray  # 0, 1, ..., n - 1
    pace: np.ndarray  # (3,), see `is_crowded`
    largest: np.ndarray  # largest values (G,) of the guards on the segment


class Record(NamedTuple):
    """The committed results of a call: S steps, and one row for each segment."""

    steps: np.ndarray  # start and length (S, 2)
    series: np.ndarray  # Taylor coefficients (S, n, order + 1)
    segments: np.ndarray  # row after the last step of each segment
    clocks: np.ndarray  # origins (., 2)
    modes: np.ndarray  # modes (., C)
    vectors: np.ndarray  # run-time vectors
    fires: np.ndarray  # the guard that fired, -1 for none
    jumps: np.ndarray  # states before and after the event (., 2, n)


@inlined
def set_origin(place: Any, rates: Any, hi: float, lo: float, p: Any) -> None:
    """Set the run-time vector for a segment whose local time starts at an instant; inputs stay unchanged."""
    origin_at, phases_at = place
    p[origin_at] = hi + lo
    for i in range(rates.shape[0]):
        p[phases_at + i] = phase_of(hi, lo, rates[i], 0.0)


@inlined
def load(inputs: Any, tapes: Any, k: int, p: Any, V: Any) -> None:
    """Load the constants of a segment into their registers."""
    for i in range(inputs.constants.shape[0]):
        V[inputs.constants[i], 0] = inputs.values[i, 0]
    for i in range(inputs.parameters.shape[0]):
        V[inputs.parameters[i], 0] = p[inputs.sources[i]]
    rows = tapes.constant[tapes.constant_start[k] : tapes.constant_start[k + 1]]
    call_noinline(advance, (rows, V, 0))


@inlined
def series_at(
    code: int,
    is_known: bool,
    rows: Any,
    high: Any,
    flow_registers: Any,
    order: int,
    s: float,
    x: Any,
    guard_registers: Any,
    fading: Any,
    V: Any,
    U: Any,
    out: Any,
) -> None:
    """Write coefficients of the states to out, and of guards and vanishing functions to U, from x at local time s.

    code: address of a compiled function that does the same; 0 for none. is_known: `values_at` was called last at this
    state.
    """
    if code != 0:
        call_series(code, s, 1.0 if is_known else 0.0, x, U, V, out)
        return
    call_noinline(expand, (rows, high, flow_registers, order, s, x, V))
    states = flow_registers[1]
    for i in range(states.shape[0]):
        for k in range(order + 1):
            out[i, k] = V[states[i], k]
    for j in range(guard_registers.shape[0]):
        for k in range(order + 1):
            U[j, k] = V[guard_registers[j], k]
    for j in range(fading.shape[0]):
        for k in range(order + 1):
            U[guard_registers.shape[0] + j, k] = V[register_of(fading[j]), k]


@kernel
def event_loop(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    codes: Any,
    phase_layout: Any,
    control: Any,
    target: Any,
    clock: Any,
    state: Any,
    work: Any,
    scratch: Any,
    record: Any,
) -> tuple[int, int, int]:
    """Run from event to event. Return why the call ended, and the numbers of committed steps and segments.

    codes: machine code of the tapes, if there is any. phase_layout: rates, and the positions of origin and phases in p.
    control: rtol, atol, order, max_step, longest segment. target (2,): instant at which to stop. clock (2,): origin of
    the segment, advanced by the call. state: x, x_error, z, p, sides, orders, floors at the start of the segment,
    advanced by the call. scratch: scratch arrays. record: receives the committed steps, segments and events. A segment
    with more steps than fit is committed in parts.
    """
    rates, origin_at, phases_at = phase_layout
    rtol, atol, order, max_step, longest = control
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    sides, orders, floors = state.sides, state.orders, state.floors
    V, W = scratch.V, scratch.W
    guard_series, ahead = scratch.guard_series, scratch.ahead
    powers, totals = scratch.sizes[: order + 1], scratch.sizes[order + 1 :]
    y, y_error, scale = work.y, work.y_error, scratch.scale
    side_now, order_now, floor_now = scratch.sides, scratch.orders, scratch.floors
    steps, series, segments, clocks = record.steps, record.series, record.segments, record.clocks
    modes, vectors, fires, jumps = record.modes, record.vectors, record.fires, record.jumps
    time, states = inputs.time[0], inputs.states
    n, n_steps, n_segments = x.shape[0], 0, 0
    pace = scratch.pace
    pace[0], pace[1], pace[2] = math.inf, math.inf, 0.0
    while True:
        k, first_step = find_modes(tapes, z), n_steps
        bound = (target[0] - clock[0]) + (target[1] - clock[1])
        if not bound > 0.0:
            return AT_TARGET, n_steps, n_segments
        if k < 0:
            return STOPPED, n_steps, n_segments
        if n_segments >= segments.shape[0]:
            return FULL, n_steps, n_segments
        set_origin((origin_at, phases_at), rates, clock[0], clock[1], p)
        rows = tapes.optimised[tapes.optimised_start[k] : tapes.optimised_start[k + 1]]
        high = tapes.high[tapes.high_start[k] : tapes.high_start[k + 1]]
        flow_registers = (time, states, tapes.derivatives[k])
        fading = tapes.fading[tapes.fading_start[k] : tapes.fading_start[k + 1]]
        code, values_code = codes.series[k], codes.values[k]
        ahead_code, sizes_code = codes.ahead[k], codes.sizes[k]
        load(inputs, tapes, k, p, V)
        if code == 0:
            load(inputs, tapes, k, p, W)
        count = tapes.active_start[k + 1] - tapes.active_start[k]
        guard_registers, numbers = scratch.guard_registers[:count], scratch.numbers[:count]
        y1, rates_now, values, sums = parts_of(ahead, order, n, count)
        for i in range(count):
            guard_registers[i] = tapes.guards[k, tapes.active[tapes.active_start[k] + i]]
        put(sides, side_now)
        put(orders, order_now)
        put(floors, floor_now)
        put(x, y)
        constants = V if code != 0 else W
        s, fired, short, is_projected, holds = (
            0.0,
            -1,
            0,
            any_projecting(automata, z),
            any_holding(automata, z),
        )
        for i in range(n):
            scale[i] = abs(x[i])
        fill(scratch.largest, 0.0)
        while fired < 0 and s < bound:
            if n_steps >= steps.shape[0]:
                if n_segments > 0 or n_steps < MIN_STEPS_IN_PART:
                    return FULL, first_step, n_segments
                break
            if s > longest:
                return STOPPED, first_step, n_segments
            coefficients = series[n_steps]
            is_known = n_steps > first_step and not is_projected
            series_at(
                code,
                is_known,
                rows,
                high,
                flow_registers,
                order,
                s,
                y,
                guard_registers,
                fading,
                V,
                guard_series,
                coefficients,
            )
            for i in range(count):
                scratch.largest[i] = max(scratch.largest[i], abs(guard_series[i, 0]))
            left = bound - s
            h = reach(
                sizes_code, coefficients, scratch.everyone, guard_series, numbers, order, rtol, atol, SLACK,
                min(left, max_step), powers, totals,
            )  # fmt: skip
            short = short + 1 if h < STANDSTILL * s else 0
            if not h > 0.0 or short >= IN_A_ROW:
                return STOPPED, first_step, n_segments
            outcome, g, d = earliest_exit(
                tapes,
                k,
                order,
                h,
                guard_series,
                numbers,
                powers,
                totals,
                parts_for_exit(scratch),
                codes.bernstein,
            )
            if outcome == OPEN:
                return STOPPED, first_step, n_segments
            for i in range(fading.shape[0]):
                u, kind, power = guard_series[count + i], fading[i] % KINDS, power_of(fading[i])
                if sizes_code == 0:
                    totals[count + i] = sum_sizes(guard_series, count + i, order, powers)
                if power > 1:
                    totals[count + i] *= power
                    for j in range(order + 1):
                        u[j] *= power
                if may_end(u, kind, totals[count + i]):
                    end = call_noinline(
                        where_it_ends, (u, kind, order, d, scratch.a, scratch.stack, codes.bernstein[1])
                    )
                    if end < d:
                        d, outcome = end, NEVER
            trials = 0
            first_look = len(BETWEEN)
            if seems_straight(tapes.computed[k], coefficients, order, powers, rtol, atol):
                first_look = 0
            while True:
                if outcome == NEVER and d < left:
                    d = on_the_grid(s, d)
                if trials > _TRIALS or not d > 0.0:
                    return STOPPED, first_step, n_segments
                look, passes = first_look, True
                while passes and look <= len(BETWEEN):
                    e = d if look == len(BETWEEN) else BETWEEN[look] * d
                    look_ahead(
                        ahead_code,
                        rows,
                        flow_registers,
                        order,
                        s,
                        e,
                        guard_registers,
                        coefficients,
                        guard_series,
                        constants,
                        ahead,
                    )
                    passes, look = flow_holds(ahead, order, n, e, y, rtol, atol), look + 1
                if passes and (
                    keeps_up(guard_series, numbers, order, ahead, rtol, values, sums)
                    or call_noinline(
                        differ_by_rounding, (automata, tapes, inputs, lin, k, s, values, sums, state, work)
                    )
                ):
                    break
                d, outcome, trials = _SHORTER * d, NEVER, trials + 1
            steps[n_steps, 0], steps[n_steps, 1] = s, d
            n_steps += 1
            s = bound if outcome == NEVER and trials == 0 and d >= left else s + d
            if outcome == FOUND:
                fired = g
            if is_projected:
                call(functions.project, s, y1, p, z, y)
            else:
                put(y1, y)
            for i in range(n):
                scale[i] = max(scale[i], abs(y1[i]))
            for g in range(side_now.shape[0]):
                side_now[g], order_now[g], floor_now[g] = 1, 0, 0.0
        if code == 0:
            codes.lacked[k] += n_steps - first_step
        if holds:
            call(functions.project, s, y, p, z, work.x_after)
            put(work.x_after, y)
        latest = max(abs(target[0]), abs(clock[0]))
        is_over = fired < 0 and s >= bound
        if is_over and not is_clear(values, scratch.largest, s, latest):
            taken = n_steps - first_step
            if call_noinline(
                may_vanish,
                (automata, tapes, inputs, lin, k, s, latest, taken, scale, rates_now, state, work),
            ):
                return STOPPED, first_step, n_segments
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
            if s < bound:  # a segment with more steps than fit is split
                move_on(s, clock, sides, orders, floors)
                return FULL, n_steps, n_segments + 1
            clock[0], clock[1] = target[0], target[1]
            return AT_TARGET, n_steps, n_segments + 1
        if is_crowded(s, clock, pace):
            return STOPPED, first_step, n_segments
        s_error, slope, bend = 2.0 * 2.0**-52 * s, 0.0, 0.0
        if holds:
            values_at(values_code, rows, flow_registers, s, y, guard_registers, constants, values, rates_now)
        for i in range(count):
            if tapes.active[tapes.active_start[k] + i] == fired:
                slope = guard_series[i, 1]
                for j in range(2, order + 1):
                    slope += j * guard_series[i, j] * ahead[j - 1]
                    bend += 0.5 * j * (j - 1) * guard_series[i, j] * ahead[j - 2]
                if slope != 0.0 and math.isfinite(values[i] / slope):
                    s_error = max(s_error, abs(values[i] / slope))
        state_errors(automata, s_error, y, scale, x_error, z, rates_now, y_error)
        if is_shallow(slope, bend, steps[n_steps - 1, 1]) and is_hidden(
            automata, tapes, inputs, lin, fired, slope, bend, s, s_error, state, work
        ):
            return STOPPED, first_step, n_segments
        if not resolve_and_advance(
            automata, tapes, inputs, lin, s, s_error, fired, n_steps - first_step, clock, state, work
        ):
            return STOPPED, first_step, n_segments
        put(work.x_after, jumps[n_segments, 1])
        n_segments += 1


@inlined
def move_on(s: float, clock: Any, sides: Any, orders: Any, floors: Any) -> None:
    """Make local time s the start of a new segment in the same modes, where every active guard is positive."""
    clock[0], clock[1] = moved_on(clock[0], clock[1], s)
    for g in range(sides.shape[0]):
        sides[g], orders[g], floors[g] = 1, 0, 0.0


@inlined
def any_holding(automata: Any, z: Any) -> bool:
    """Return whether any component holds its surface."""
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c]:
            return True
    return False


@inlined
def any_projecting(automata: Any, z: Any) -> bool:
    """Return whether any component keeps its surface by projection, so that each step is projected."""
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c] and automata.pin[c, 0] < 0:
            return True
    return False
