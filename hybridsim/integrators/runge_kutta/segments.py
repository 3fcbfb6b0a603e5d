"""This module integrates the motion up to the next event by explicit Runge-Kutta steps.

The dense output of a step is the two-point Hermite polynomial on the Taylor coefficients of the flow at its ends; a
step in which a guard becomes negative is repeated up to the event.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.events.compiled.after_segment import fill_guard_series, state_errors
from hybridsim.engine.events.compiled.known_time import SEGMENTS, STEPS
from hybridsim.engine.events.compiled.scratch import called_by, note_or_restore
from hybridsim.engine.native.kernels import call, call_noinline, call_series, inlined, kernel
from hybridsim.engine.native.time_grid import on_the_grid
from hybridsim.engine.record.hermite import fit_in_time, holds_between
from hybridsim.engine.roots.dense_guards import first_guard, first_linear_guard
from hybridsim.engine.roots.first_exit import FOUND, OPEN
from hybridsim.engine.run.event_loop import (
    FULL,
    MIN_STEPS_IN_PART,
    STOPPED,
    SegmentEnd,
    event_loop,
    not_followed,
)
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.interpreter import advance, expand
from hybridsim.integrators.polynomial_steps import (
    REJECTED,
    TAKEN,
    TRIED,
    begin_segment,
    hold_states,
    project,
    put_sides,
    segment_end,
)
from hybridsim.integrators.runge_kutta.step import attempt
from hybridsim.integrators.step_control import LAST_STEP_FACTOR, SAFETY, SMALLEST, forget, next_length

LANDED, UNSURE, INACCURATE, LOST = range(4)  # results of `land`
_NEIGHBOURHOOD = 0.125  # share of a step within which an event time is corrected
_CORRECTIONS = 5  # most corrections of an event time; they converge quadratically
_HALF = 0.5
_PASSES = 3  # error of a first step in tolerances that still passes; its length aims at one


@kernel
def first_length(leading: Any, x: Any, tolerances: Any, series: Any, longest: float) -> float:
    """Return the step length at which the error estimate meets the tolerance, from a Taylor series.

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
    """Return whether all Taylor coefficients are finite."""
    total = 0.0
    for i in range(series.shape[0]):
        for k in range(series.shape[1]):
            total += abs(series[i, k])
    return total < math.inf


@kernel
def expand_ends(rows: Any, guard_rows: Any, flow_registers: Any, s: float, x: Any, W: Any, out: Any) -> None:
    """Compute the Taylor coefficients of the states and of all registers along the flow from (s, x).

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
    """Compute the Taylor coefficients of the states and of the guards along the flow from (s, x).

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
    model: Any, k: int, place: int, s: float, d: float, h: float, scale: Any, state: Any, own: Any, work: Any
) -> tuple[int, float]:
    """Repeat a step up to the zero of a guard that was located on the dense output.

    place: index of the guard. The step starts from work.y; its end is in work.x_after, the series there in own.right
    and own.guards. Newton's method corrects the time to the accuracy of rounding; it repeats the step only beyond the
    range of the series.
    """
    settings, parts, tapes, inputs = own.settings, own.parts, model.tapes, model.inputs
    flow, tableau, tolerances = called_by(work).flow, settings.tableau, (settings.control[0], settings.atol)
    right, y, y1, last, p, z = own.right, work.y, work.x_after, own.right.shape[1] - 1, state.p, state.z
    guard_rows = parts.rows[parts.start[k] : parts.start[k + 1]]
    guard_registers = own.search.guard_registers[: tapes.active_start[k + 1] - tapes.active_start[k]]
    rows = tapes.optimised[tapes.optimised_start[k] : tapes.optimised_start[k + 1]]
    flow_registers = (inputs.time[0], inputs.states, tapes.derivatives[k])
    code, W = own.codes.ends[k], own.search.W
    low, high = max(0.0, d - _NEIGHBOURHOOD * h), min(h, d + _NEIGHBOURHOOD * h)
    d = (s + d) - s
    if not d > 0.0:
        return LOST, d
    error = 0.0
    if not is_still(own.stages):
        error = attempt(flow, tableau, s, d, y, own.dx, p, z, tolerances, own.stages, y1)
        own.counts[TRIED] += 1
    for _ in range(_CORRECTIONS):
        if not error <= 1.0:
            return INACCURATE, d
        project(model, work, state, s + d, y1)
        if not series_of(
            code, rows, guard_rows, flow_registers, s + d, y1, guard_registers, W, right, own.guards
        ):
            return LOST, d
        value, slope = own.guards[place, 0], own.guards[place, 1]
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
            is_near = is_near and abs(right[i, last] * move**last) <= UNIT * scale[i]
        if is_near:
            for i in range(y.shape[0]):
                y1[i] = right[i, last]
                for j in range(last - 1, -1, -1):
                    y1[i] = y1[i] * move + right[i, j]
        else:
            error = attempt(flow, tableau, s, d, y, own.dx, p, z, tolerances, own.stages, y1)
            own.counts[TRIED] += 1
    return UNSURE, d


@inlined
def is_zero(model: Any, fired: int, s: float, scale: Any, state: Any, work: Any) -> bool:
    """Return whether a guard is zero within twice its error bound at the present state."""
    s_error, y = 8.0 * 2.0**-52 * s, work.y
    call(called_by(work).flow, s, y, state.p, state.z, work.slopes)
    state_errors(model.automata, s_error, y, scale, state.x_error, state.z, work.slopes, work.y_error)
    for i in range(y.shape[0]):
        work.y_error[i] *= 2.0
    fill_guard_series(model, s, s_error, state, work)
    return abs(work.judged[0, fired, 0]) <= work.judged[1, fired, 0]


@inlined
def runge_kutta_segment(
    start: Any, model: Any, loop: Any, state: Any, work: Any, own: Any, rows: Any
) -> SegmentEnd:
    """Integrate one segment by Runge-Kutta steps, as part of the compiled event loop.

    own: `hybridsim.integrators.runge_kutta.compiled_loop.RungeKuttaArrays`.
    """
    k, bound, _, is_rejected = start
    n_steps = first_step = loop.int_slots[STEPS]
    note_or_restore(own.first_step, is_rejected, work)
    if not begin_segment(start, model, loop, state, work, own):
        return not_followed(STOPPED)
    tapes, inputs, flow = model.tapes, model.inputs, called_by(work).flow
    settings, parts, codes, first = own.settings, own.parts, own.codes, own.first_step
    tableau, hermite, atol = settings.tableau, settings.hermite, settings.atol
    orders, sizes = settings.leading_orders, settings.leading
    leading = (orders[0], sizes[0], sizes[1], orders[1], sizes[2])
    error_order, order = settings.orders[0], settings.orders[1]
    rtol, max_step = settings.control[0], settings.control[1]
    z, p, longest = state.z, state.p, loop.longest[0]
    W, left, right, ahead = own.search.W, own.left, own.right, own.search.ahead
    scale, slopes, y, y1 = loop.scale, work.slopes, work.y, work.x_after
    steps, series, n, terms, tolerances = rows.steps, rows.series, y.shape[0], left.shape[1], (rtol, atol)
    guard_rows = parts.rows[parts.start[k] : parts.start[k + 1]]
    step_rows = parts.step_rows[parts.step_start[k] : parts.step_start[k + 1]]
    is_linear = parts.is_linear[k]
    step_guards = guard_rows if is_linear else guard_rows[:0]
    flow_registers = (inputs.time[0], inputs.states, tapes.derivatives[k])
    ends_code, first_code = codes.ends[k], codes.first[k]
    first_active = tapes.active_start[k]
    guard_registers = own.search.guard_registers[: tapes.active_start[k + 1] - first_active]
    s, fired, place, is_sure, d = 0.0, -1, -1, True, 0.0
    forget(own.memory)
    if first_code != 0:
        call_series(first_code, 0.0, 0.0, y, own.guards_left, W, own.first)
    else:
        call_noinline(expand, (step_rows, step_rows[:0], flow_registers, leading[0] + 1, 0.0, y, W))
        gather(inputs.states, W, own.first)
        gather(guard_registers, W, own.guards_left)
    h = first_length(leading, y, tolerances, own.first, min(bound, max_step))
    tried = math.inf  # last rejected length from this point
    if first[0] > 0.0:
        h, first[0] = first[0], 0.0
    for i in range(n):
        for j in range(terms):
            left[i, j] = own.first[i, j]
    if not (is_finite(left) and h > 0.0):
        return not_followed(STOPPED)
    while fired < 0 and s < bound:
        if n_steps >= steps.shape[0]:
            if loop.int_slots[SEGMENTS] > 0 or n_steps < MIN_STEPS_IN_PART:
                return not_followed(FULL)
            first[0] = h  # the next call continues with it
            break
        # the rest would be too short for another step
        is_last = h * LAST_STEP_FACTOR >= bound - s - SMALLEST * 2.0**-52 * bound
        d = bound - s if is_last else on_the_grid(s, h)
        if s > longest or not 0.0 < d < tried:
            return not_followed(STOPPED)
        tried = d
        for i in range(n):
            own.dx[i] = left[i, 1]
        error = attempt(flow, tableau, s, d, y, own.dx, p, z, tolerances, own.stages, y1)
        own.counts[TRIED] += 1
        h = min(next_length(d, error, error_order, own.memory), max_step)
        project(model, work, state, s + d, y1)
        if not (
            error <= 1.0
            and series_of(
                ends_code, step_rows, step_guards, flow_registers, s + d, y1, guard_registers, W, right,
                own.guards,
            )
        ):  # fmt: skip
            own.counts[REJECTED] += 1
            h = min(h, _HALF * d) if error <= 1.0 else h
            continue
        if not holds_between(flow, hermite.middle, s, d, left, right, p, z, tolerances, ahead, slopes):
            own.counts[REJECTED] += 1
            h = _HALF * d
            continue
        if is_linear:
            outcome, g, at = first_linear_guard(tapes, k, d, hermite, own)
        elif fit_in_time(left, right, d, hermite.shift, hermite.inverse, own.lack, own.polynomial):
            outcome, g, at = first_guard(
                tapes, k, guard_rows, inputs, codes, order, rtol, s, d, atol, own.polynomial, own.search
            )
        else:
            outcome, g, at = OPEN, -1, 0.0
        if outcome == OPEN:
            return not_followed(STOPPED)
        if outcome == FOUND:
            place = 0
            while tapes.active[first_active + place] != g:
                place += 1
            code, at = land(model, k, place, s, at, d, scale, state, own, work)
            if code == LOST:
                return not_followed(STOPPED)
            if code != INACCURATE and not holds_between(
                flow, hermite.middle, s, at, left, right, p, z, tolerances, ahead, slopes
            ):
                code = INACCURATE
            if code == INACCURATE:
                own.counts[REJECTED] += 1
                h = _HALF * at
                if s == 0.0:
                    put_sides(state, own)
                continue
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
                own.guards_left[i, j] = own.guards[i, j]
        n_steps += 1
        tried = math.inf
        s = bound if is_last else s + d
    own.counts[TAKEN] = n_steps - first_step
    if ends_code == 0:
        codes.lacked[k] += 1  # the first point
    hold_states(model, work, state, s)
    if fired >= 0 and not is_sure and not is_zero(model, fired, s, scale, state, work):
        return not_followed(STOPPED)
    return segment_end(start, model, loop, state, work, own, s, d, place if fired >= 0 else -1)


def runge_kutta_loop(model: Any, call: Any, state: Any, work: Any, record: Any, own: Any, rows: Any) -> int:
    """Run from event to event, with segments of Runge-Kutta steps."""
    return event_loop(runge_kutta_segment, model, call, state, work, record, own, rows)
