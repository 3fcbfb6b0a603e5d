"""This module integrates the motion up to the next event by Taylor steps."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.events.compiled.after_segment import differ_by_rounding
from hybridsim.engine.events.compiled.at_end import is_clear, may_vanish
from hybridsim.engine.events.compiled.known_time import SEGMENTS, STEPS
from hybridsim.engine.events.compiled.scratch import called_by
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
from hybridsim.engine.run.event_loop import (
    FOLLOWED,
    FULL,
    MIN_STEPS_IN_PART,
    STOPPED,
    SegmentEnd,
    any_holding,
    any_projecting,
    event_loop,
    load_constants,
    not_followed,
)
from hybridsim.engine.series.interpreter import SLACK, expand, reach, sum_sizes
from hybridsim.engine.series.vanishing_kinds import KINDS, power_of, register_of

_SHORTER = 0.25
_TRIALS = 30


@inlined
def series_at(
    code: int, is_known: bool, rows: Any, high: Any, flow_registers: Any, order: int, s: float, x: Any,
    guard_registers: Any, fading: Any, V: Any, U: Any, out: Any,
) -> None:  # fmt: skip
    """Compute the Taylor coefficients of states, guards and vanishing functions at the local time s and the state x.

    code: address of a compiled function that does the same; 0 for none. is_known: `values_at` was called last at this
    state.
    """
    if code != 0:
        call_series(code, s, 1.0 if is_known else 0.0, x, U, V, out)
    else:
        tape = (rows, high, flow_registers)
        call_noinline(_interpreted_series, (tape, order, s, x, guard_registers, fading, V, U, out))


@kernel
def _interpreted_series(
    tape: Any, order: int, s: float, x: Any, guard_registers: Any, fading: Any, V: Any, U: Any, out: Any
) -> None:
    """Write the Taylor coefficients of `series_at` with the interpreter of instruction tapes."""
    rows, high, flow_registers = tape
    expand(rows, high, flow_registers, order, s, x, V)
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


@inlined
def taylor_segment(
    start: Any, model: Any, loop: Any, state: Any, work: Any, own: Any, rows: Any
) -> SegmentEnd:
    """Integrate one segment by Taylor steps, as part of the compiled event loop.

    own: `hybridsim.integrators.taylor.compiled_loop.TaylorArrays`.
    """
    k, bound, _, is_rejected = start
    n_steps = first_step = loop.int_slots[STEPS]
    if is_rejected:
        return not_followed(STOPPED)
    automata, tapes, inputs = model.automata, model.tapes, model.inputs
    codes, functions = own.codes, called_by(work)
    control, atol, order = own.settings.control, own.settings.atol, own.V.shape[1] - 1
    rtol, max_step = control[0], control[1]
    x, z, p, longest = state.x, state.z, state.p, loop.longest[0]
    V, guard_series, ahead = own.V, own.guard_series, own.ahead
    powers, totals = own.sizes[: order + 1], own.sizes[order + 1 :]
    y, scale = work.y, loop.scale
    side_now, order_now, floor_now = own.sides, own.orders, own.floors
    steps, series, n = rows.steps, rows.series, x.shape[0]
    tape = tapes.optimised[tapes.optimised_start[k] : tapes.optimised_start[k + 1]]
    high = own.high.rows[own.high.start[k] : own.high.start[k + 1]]
    flow_registers = (inputs.time[0], inputs.states, tapes.derivatives[k])
    fading = tapes.fading[tapes.fading_start[k] : tapes.fading_start[k + 1]]
    code, values_code = codes.series[k], codes.values[k]
    ahead_code, sizes_code = codes.ahead[k], codes.sizes[k]
    load_constants(inputs, tapes, k, p, V)
    if code == 0:
        load_constants(inputs, tapes, k, p, own.W)
    count = tapes.active_start[k + 1] - tapes.active_start[k]
    guard_registers, numbers = own.guard_registers[:count], own.numbers[:count]
    y1, rates_now, values, sums = parts_of(ahead, order, n, count)
    for i in range(count):
        guard_registers[i] = tapes.guards[k, tapes.active[tapes.active_start[k] + i]]
    put(state.sides, side_now)
    put(state.orders, order_now)
    put(state.floors, floor_now)
    put(x, y)
    constants = V if code != 0 else own.W
    s, fired, short = 0.0, -1, 0
    is_projected, holds = any_projecting(automata, z), any_holding(automata, z)
    for i in range(n):
        scale[i] = abs(x[i])
    fill(own.largest, 0.0)
    while fired < 0 and s < bound:
        if n_steps >= steps.shape[0]:
            if loop.int_slots[SEGMENTS] > 0 or n_steps < MIN_STEPS_IN_PART:
                return not_followed(FULL)
            break
        if s > longest:
            return not_followed(STOPPED)
        coefficients = series[n_steps]
        is_known = n_steps > first_step and not is_projected
        series_at(
            code, is_known, tape, high, flow_registers, order, s, y, guard_registers, fading, V, guard_series,
            coefficients,
        )  # fmt: skip
        for i in range(count):
            own.largest[i] = max(own.largest[i], abs(guard_series[i, 0]))
        left = bound - s
        h = reach(
            sizes_code, coefficients, own.everyone, guard_series, numbers, order, rtol, atol, SLACK,
            min(left, max_step), powers, totals,
        )  # fmt: skip
        short = short + 1 if h < STANDSTILL * s else 0
        if not h > 0.0 or short >= IN_A_ROW:
            return not_followed(STOPPED)
        outcome, g, d = earliest_exit(
            tapes, k, order, h, guard_series, numbers, powers, totals, parts_for_exit(own), codes.bernstein
        )
        if outcome == OPEN:
            return not_followed(STOPPED)
        for i in range(fading.shape[0]):
            u, kind, power = guard_series[count + i], fading[i] % KINDS, power_of(fading[i])
            if sizes_code == 0:
                totals[count + i] = sum_sizes(guard_series, count + i, order, powers)
            if power > 1:
                totals[count + i] *= power
                for j in range(order + 1):
                    u[j] *= power
            if may_end(u, kind, totals[count + i]):
                end = call_noinline(where_it_ends, (u, kind, order, d, own.a, own.stack, codes.bernstein[1]))
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
                return not_followed(STOPPED)
            look, passes = first_look, True
            while passes and look <= len(BETWEEN):
                e = d if look == len(BETWEEN) else BETWEEN[look] * d
                look_ahead(
                    ahead_code, tape, flow_registers, order, s, e, guard_registers, coefficients, guard_series,
                    constants, ahead,
                )  # fmt: skip
                passes, look = flow_holds(ahead, order, n, e, y, rtol, atol), look + 1
            if passes and (
                keeps_up(guard_series, numbers, order, ahead, rtol, values, sums)
                or call_noinline(differ_by_rounding, (model, k, s, values, sums, state, work))
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
    s_error, slope, bend = 2.0 * 2.0**-52 * s, 0.0, 0.0
    if fired < 0:
        latest = max(abs(loop.times[0]), abs(loop.times[2]))
        if s >= bound and not is_clear(values, own.largest, s, latest):
            taken = n_steps - first_step
            if call_noinline(may_vanish, (model, k, s, latest, taken, scale, rates_now, state, work)):
                return not_followed(STOPPED)
    else:
        if holds:
            values_at(values_code, tape, flow_registers, s, y, guard_registers, constants, values, rates_now)
        for i in range(count):
            if tapes.active[tapes.active_start[k] + i] == fired:
                slope = guard_series[i, 1]
                for j in range(2, order + 1):
                    slope += j * guard_series[i, j] * ahead[j - 1]
                    bend += 0.5 * j * (j - 1) * guard_series[i, j] * ahead[j - 2]
                if slope != 0.0 and math.isfinite(values[i] / slope):
                    s_error = max(s_error, abs(values[i] / slope))
        put(rates_now, work.slopes)
    last_step = steps[n_steps - 1, 1]
    return SegmentEnd(FOLLOWED, s, fired, n_steps - first_step, s, s_error, slope, bend, last_step, False)


def taylor_loop(model: Any, call: Any, state: Any, work: Any, record: Any, own: Any, rows: Any) -> int:
    """Run from event to event, with segments of Taylor steps."""
    return event_loop(taylor_segment, model, call, state, work, record, own, rows)
