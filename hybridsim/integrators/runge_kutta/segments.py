"""The compiled mode loop of explicit Runge-Kutta methods, which steps from event to event without Python calls.

As in `hybridsim.engine.run.event_loop`, segments are committed one by one up to the target, or up to the first that
contains something unusual. The dense output of a step is the two-point Hermite polynomial on the Taylor
coefficients of the flow at its ends; a step in which a guard becomes negative is repeated up to the event.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.events.compiled.after_segment import (
    fill_guard_series,
    is_crowded,
    is_hidden,
    is_shallow,
    resolve_and_advance,
    state_errors,
)
from hybridsim.engine.events.compiled.at_end import may_vanish
from hybridsim.engine.native.kernels import call, call_noinline, call_series, inlined, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.time_grid import on_the_grid
from hybridsim.engine.record.hermite import fit_in_time, holds_between
from hybridsim.engine.roots.dense_guards import first_guard, first_linear_guard
from hybridsim.engine.roots.first_exit import FOUND, OPEN
from hybridsim.engine.run.event_loop import (
    AT_TARGET,
    FULL,
    MIN_STEPS_IN_PART,
    STOPPED,
    any_holding,
    any_projecting,
    load,
    move_on,
    set_origin,
)
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.interpreter import advance, expand
from hybridsim.engine.system.programs.modes_index import find_modes
from hybridsim.integrators.runge_kutta.step import attempt
from hybridsim.integrators.step_control import LAST_STEP_FACTOR, SAFETY, SMALLEST, forget, next_length

LANDED, UNSURE, REJECTED, LOST = 0, 1, 2, 3
_NEIGHBOURHOOD = 0.125  # share of a step within which an event time is corrected
_CORRECTIONS = 5  # most corrections of an event time; they converge quadratically
_HALF = 0.5
_PASSES = 3  # error of a first step in tolerances that still passes; its length aims at one


@kernel
def first_length(leading: Any, x: Any, tolerances: Any, series: Any, longest: float) -> float:
    """Return the step length at which the error estimate meets the tolerance, from a series (n, q + 2).

    leading: q, the coefficients of the main estimate at h**q x^(q)/q! and h**(q + 1) x^(q + 1)/(q + 1)!, then
    q and one such coefficient of the low estimate, with q = 0 if there is none; see `leading_terms`.
    """
    q, c, c_next, q_low, c_low = leading
    rtol, atol = tolerances
    n, h = x.shape[0], 0.0
    for turn in range(_PASSES):
        size, size_next, size_low = 0.0, 0.0, 0.0
        for i in range(n):
            end = series[i, q]
            for k in range(q - 1, -1, -1):
                end = end * h + series[i, k]
            scale = atol[i] + rtol * (max(abs(x[i]), abs(end)) if turn > 0 else abs(x[i]))
            if scale > 0.0:
                size += (c * series[i, q] / scale) ** 2
                size_next += (c_next * series[i, q + 1] / scale) ** 2
                size_low += (c_low * series[i, q_low] / scale) ** 2
        if not size + size_next + size_low < math.inf:
            return math.nan
        size, size_next, size_low = math.sqrt(size / n), math.sqrt(size_next / n), math.sqrt(size_low / n)
        h = longest
        if size > 0.0:
            h = min(h, size ** (-1.0 / q))
        if size_next > 0.0:
            h = min(h, size_next ** (-1.0 / (q + 1)))
        if q_low > 0 and size_low > 0.0 and size > 0.0:
            h = max(h, (size * size / (0.1 * size_low)) ** (-1.0 / (2 * q - q_low)))
    return min(SAFETY * h, longest)


@inlined
def gather(registers: Any, W: Any, out: Any) -> None:
    """Copy the coefficients of some registers, one row for each register."""
    for i in range(registers.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = W[registers[i], j]


@inlined
def is_finite(series: Any) -> bool:
    """Return whether all coefficients are finite."""
    total = 0.0
    for i in range(series.shape[0]):
        for k in range(series.shape[1]):
            total += abs(series[i, k])
    return total < math.inf


@kernel
def expand_ends(rows: Any, guard_rows: Any, flow_registers: Any, s: float, x: Any, W: Any, out: Any) -> None:
    """Compute the coefficients of the states (n, K) and of all registers (W) along the flow from (s, x).

    rows: tape rows of the flow and of further wanted functions; guard_rows: those of them that guards need.
    """
    time, states, derivatives = flow_registers
    n, last = out.shape
    last -= 1
    if time >= 0:
        W[time, 0], W[time, 1] = s, 1.0
    for i in range(n):
        W[states[i], 0] = x[i]
    for k in range(last):
        call_noinline(advance, (rows, W, k))
        for i in range(n):
            W[states[i], k + 1] = W[derivatives[i], k] / (k + 1)
    call_noinline(advance, (guard_rows, W, last))
    gather(states, W, out)


@inlined
def series_of(
    code: int,
    rows: Any,
    guard_rows: Any,
    flow_registers: Any,
    s: float,
    x: Any,
    guard_registers: Any,
    W: Any,
    out: Any,
    guards: Any,
) -> bool:
    """Compute coefficients of the states (n, K) and of the guards (one row each) along the flow from (s, x).

    code: address of a function that does so; 0 for none. Return whether those of the states are finite.
    """
    if code != 0:
        call_series(code, s, 0.0, x, guards, W, out)
    else:
        call_noinline(expand_ends, (rows, guard_rows, flow_registers, s, x, W, out))
        gather(guard_registers, W, guards)
    return is_finite(out)


@inlined
def is_still(stages: Any) -> bool:
    """Return whether the rates at all stages of a step are zero."""
    for i in range(stages.shape[0]):
        for m in range(stages.shape[1]):
            if stages[i, m] != 0.0:
                return False
    return True


@kernel
def land(
    functions: Any,
    tableau: Any,
    tolerances: Any,
    tapes: Any,
    k: int,
    guard_rows: Any,
    inputs: Any,
    code: int,
    guard_registers: Any,
    place: int,
    s: float,
    d: float,
    h: float,
    p: Any,
    z: Any,
    is_holding: bool,
    scratch: Any,
    work: Any,
) -> tuple[int, float]:
    """Repeat the step of length h up to a guard's zero, which the dense output locates at d.

    place: index of the function. The step starts from work.y; its end is in work.x_after, the series there
    are in scratch.right and scratch.guards_right. code: see `series_of`. Newton's method corrects the time until it
    is accurate to rounding; a correction within the range of the series at the end needs no new step.
    """
    W, right, y, y1, last = scratch.W, scratch.right, work.y, work.x_after, scratch.right.shape[1] - 1
    rows = tapes.optimised[tapes.optimised_start[k] : tapes.optimised_start[k + 1]]
    flow_registers = (inputs.time[0], inputs.states, tapes.derivatives[k])
    low, high = max(0.0, d - _NEIGHBOURHOOD * h), min(h, d + _NEIGHBOURHOOD * h)
    d = (s + d) - s
    if not d > 0.0:
        return LOST, d
    error = 0.0
    if not is_still(scratch.stages):
        error = attempt(functions.flow, tableau, s, d, y, scratch.dx, p, z, tolerances, scratch.stages, y1)
        scratch.counts[0] += 1
    for _ in range(_CORRECTIONS):
        if not error <= 1.0:
            return REJECTED, d
        if is_holding:
            call(functions.project, s + d, y1, p, z, work.slopes)
            put(work.slopes, y1)
        if not series_of(
            code, rows, guard_rows, flow_registers, s + d, y1, guard_registers, W, right, scratch.guards_right
        ):
            return LOST, d
        value, slope = scratch.guards_right[place, 0], scratch.guards_right[place, 1]
        move = -value / slope if slope != 0.0 else math.nan
        if not abs(move) < math.inf:
            return LOST, d
        if abs(move) <= 2.0 * 2.0**-52 * (s + d):
            return LANDED, d
        moved = min(max(d + move, low), high)
        moved = (s + moved) - s  # the event is at the end of the step to it
        if moved == d or not moved > 0.0:
            return UNSURE, d
        move, d = moved - d, moved
        is_near = True
        for i in range(y.shape[0]):
            is_near = is_near and abs(right[i, last] * move**last) <= UNIT * scratch.scale[i]
        if is_near:
            for i in range(y.shape[0]):
                y1[i] = right[i, last]
                for k in range(last - 1, -1, -1):
                    y1[i] = y1[i] * move + right[i, k]
        else:
            error = attempt(
                functions.flow, tableau, s, d, y, scratch.dx, p, z, tolerances, scratch.stages, y1
            )
            scratch.counts[0] += 1
    return UNSURE, d


@inlined
def is_zero(
    functions: Any,
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    fired: int,
    s: float,
    scale: Any,
    state: Any,
    work: Any,
) -> bool:
    """Return whether a guard at the present state is zero within twice its error by rounding and time."""
    s_error, y = 8.0 * 2.0**-52 * s, work.y
    call(functions.flow, s, y, state.p, state.z, work.slopes)
    state_errors(automata, s_error, y, scale, state.x_error, state.z, work.slopes, work.y_error)
    for i in range(y.shape[0]):
        work.y_error[i] *= 2.0
    fill_guard_series(automata, tapes, inputs, lin, s, s_error, state, work)
    return abs(work.judged[0, fired, 0]) <= work.judged[1, fired, 0]


@kernel
def rk_event_loop(
    functions: Any,
    automata: Any,
    tapes: Any,
    parts: Any,
    inputs: Any,
    lin: Any,
    codes: Any,
    phase_layout: Any,
    method: Any,
    control: Any,
    target: Any,
    clock: Any,
    state: Any,
    work: Any,
    scratch: Any,
    record: Any,
) -> tuple[int, int, int]:
    """Run from event to event; return why the loop ended, and how many steps and segments were committed.

    parts: `Parts` of the tapes; codes: `EndsCodes` of them. method: tableau, leading terms of its estimates,
    error order, matrices of the Hermite polynomial. control: rtol, atol, order of the guards' series,
    max_step, longest segment, and an array with the length of the first step (0: unknown), which is cleared
    after use. The others are as for `event_loop`.
    """
    rates, origin_at, phases_at = phase_layout
    tableau, leading, error_order, hermite = method
    rtol, atol, order, max_step, longest, first = control
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    sides, orders, floors = state.sides, state.orders, state.floors
    W, left, right = scratch.W, scratch.left, scratch.right
    scale, slopes, y, y1 = scratch.scale, work.slopes, work.y, work.x_after
    side_now, order_now, floor_now = scratch.sides, scratch.orders, scratch.floors
    steps, series, segments, clocks = record.steps, record.series, record.segments, record.clocks
    modes, vectors, fires, jumps = record.modes, record.vectors, record.fires, record.jumps
    time, states = inputs.time[0], inputs.states
    n, terms, tolerances = x.shape[0], left.shape[1], (rtol, atol)
    n_steps, n_segments = 0, 0
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
        guard_rows = parts.rows[parts.start[k] : parts.start[k + 1]]
        step_rows = parts.step_rows[parts.step_start[k] : parts.step_start[k + 1]]
        is_linear = parts.is_linear[k]
        step_guards = guard_rows if is_linear else guard_rows[:0]
        flow_registers = (time, states, tapes.derivatives[k])
        ends_code, first_code = codes.ends[k], codes.first[k]
        load(inputs, tapes, k, p, scratch.V)
        load(inputs, tapes, k, p, W)
        guard_registers = scratch.guard_registers[: tapes.active_start[k + 1] - tapes.active_start[k]]
        for i in range(guard_registers.shape[0]):
            scratch.numbers[i] = tapes.active[tapes.active_start[k] + i]
            guard_registers[i] = tapes.guards[k, scratch.numbers[i]]
        put(sides, side_now)
        put(orders, order_now)
        put(floors, floor_now)
        s, fired, is_holding, is_sure = 0.0, -1, any_holding(automata, z), True
        is_projected = any_projecting(automata, z)
        value, slope, bend, d = 0.0, 0.0, 0.0, 0.0
        forget(scratch.memory)
        put(x, y)
        for i in range(n):
            scale[i] = abs(x[i])
        if first_code != 0:
            call_series(first_code, 0.0, 0.0, y, scratch.guards_left, W, scratch.first)
        else:
            call_noinline(expand, (step_rows, step_rows[:0], flow_registers, leading[0] + 1, 0.0, y, W))
            gather(states, W, scratch.first)
            gather(guard_registers, W, scratch.guards_left)
        h = first_length(leading, y, tolerances, scratch.first, min(bound, max_step))
        tried = math.inf  # last rejected length from this point
        if first[0] > 0.0:
            h, first[0] = first[0], 0.0
        for i in range(n):
            for j in range(terms):
                left[i, j] = scratch.first[i, j]
        if not (is_finite(left) and h > 0.0):
            return STOPPED, n_steps, n_segments
        while fired < 0 and s < bound:
            if n_steps >= steps.shape[0]:
                if n_segments > 0 or n_steps < MIN_STEPS_IN_PART:
                    return FULL, first_step, n_segments
                first[0] = h  # the next call continues with it
                break
            # the rest would be too short for another step
            is_last = h * LAST_STEP_FACTOR >= bound - s - SMALLEST * 2.0**-52 * bound
            d = bound - s if is_last else on_the_grid(s, h)
            if s > longest or not 0.0 < d < tried:
                return STOPPED, first_step, n_segments
            tried = d
            for i in range(n):
                scratch.dx[i] = left[i, 1]
            error = attempt(
                functions.flow, tableau, s, d, y, scratch.dx, p, z, tolerances, scratch.stages, y1
            )
            scratch.counts[0] += 1
            h = min(next_length(d, error, error_order, scratch.memory), max_step)
            if is_projected:
                call(functions.project, s + d, y1, p, z, slopes)
                put(slopes, y1)
            if not (
                error <= 1.0
                and series_of(
                    ends_code,
                    step_rows,
                    step_guards,
                    flow_registers,
                    s + d,
                    y1,
                    guard_registers,
                    W,
                    right,
                    scratch.guards_right,
                )
            ):
                scratch.counts[1] += 1
                h = min(h, _HALF * d) if error <= 1.0 else h
                continue
            if not holds_between(
                functions.flow, hermite.middle, s, d, left, right, p, z, tolerances, scratch.ahead, slopes
            ):
                scratch.counts[1] += 1
                h = _HALF * d
                continue
            if is_linear:
                outcome, g, at = first_linear_guard(tapes, k, guard_registers.shape[0], d, hermite, scratch)
            elif fit_in_time(
                left, right, d, hermite.shift, hermite.inverse, scratch.lack, scratch.polynomial
            ):
                outcome, g, at = first_guard(
                    tapes, k, guard_rows, inputs, codes, order, rtol, s, d, atol, guard_registers, scratch
                )
            else:
                outcome, g, at = OPEN, -1, 0.0
            if outcome == OPEN:
                return STOPPED, first_step, n_segments
            if outcome == FOUND:
                place = 0
                while scratch.numbers[place] != g:
                    place += 1
                code, at = land(
                    functions, tableau, tolerances, tapes, k, guard_rows, inputs, ends_code, guard_registers, place,
                    s, at, d, p, z, is_holding, scratch, work,
                )  # fmt: skip
                if code == LOST:
                    return STOPPED, first_step, n_segments
                if code != REJECTED and not holds_between(
                    functions.flow,
                    hermite.middle,
                    s,
                    at,
                    left,
                    right,
                    p,
                    z,
                    tolerances,
                    scratch.ahead,
                    slopes,
                ):
                    code = REJECTED
                if code == REJECTED:
                    scratch.counts[1] += 1
                    h = _HALF * at
                    if s == 0.0:
                        put(sides, side_now)
                        put(orders, order_now)
                        put(floors, floor_now)
                    continue
                ahead = scratch.guards_right[place]
                value, slope, bend = ahead[0], ahead[1], ahead[2]
                d, is_last, fired, is_sure = at, False, g, code == LANDED
            steps[n_steps, 0], steps[n_steps, 1] = s, d
            for i in range(n):
                for j in range(terms):
                    series[n_steps, i, j], series[n_steps, i, terms + j] = left[i, j], right[i, j]
                    left[i, j] = right[i, j]
                y[i] = y1[i]
                scale[i] = max(scale[i], abs(y1[i]))
            for i in range(guard_registers.shape[0]):
                for j in range(terms):
                    scratch.guards_left[i, j] = scratch.guards_right[i, j]
            n_steps += 1
            tried = math.inf
            s = bound if is_last else s + d
        if ends_code == 0:
            codes.lacked[k] += n_steps - first_step + 1
        if is_holding:
            call(functions.project, s, y, p, z, y1)
            put(y1, y)
        if fired < 0 and s >= bound:
            latest = max(abs(target[0]), abs(clock[0]))
            call(functions.flow, s, y, p, z, slopes)
            if may_vanish(
                automata, tapes, inputs, lin, k, s, latest, n_steps - first_step, scale, slopes, state, work
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
            if s < bound:  # a segment that is too long for the buffers is divided
                move_on(s, clock, sides, orders, floors)
                return FULL, n_steps, n_segments + 1
            clock[0], clock[1] = target[0], target[1]
            return AT_TARGET, n_steps, n_segments + 1
        if is_crowded(s, clock, pace):
            return STOPPED, first_step, n_segments
        if not is_sure and not is_zero(functions, automata, tapes, inputs, lin, fired, s, scale, state, work):
            return STOPPED, first_step, n_segments
        s_error = 2.0 * 2.0**-52 * s
        if slope != 0.0 and abs(value / slope) < math.inf:
            s_error = max(s_error, abs(value / slope))
        call(functions.flow, s, y, p, z, slopes)
        state_errors(automata, s_error, y, scale, x_error, z, slopes, work.y_error)
        if is_shallow(slope, bend, d) and is_hidden(
            automata, tapes, inputs, lin, fired, slope, bend, s, s_error, state, work
        ):
            return STOPPED, first_step, n_segments
        if not resolve_and_advance(
            automata, tapes, inputs, lin, s, s_error, fired, n_steps - first_step, clock, state, work
        ):
            return STOPPED, first_step, n_segments
        put(y1, jumps[n_segments, 1])
        n_segments += 1
