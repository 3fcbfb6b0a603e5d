"""The compiled event loop: it integrates segments and resolves ordinary events without Python.

It knows no method. A kernel of the method, with which the loop is compiled, follows a segment. The contract of that
kernel is in `hybridsim.engine.run.method_kernels.MethodKernels`. A call commits segments one by one. It ends at its
target time, or before the first segment with an event that is not ordinary. The general mode loop then takes that
segment.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.after_segment import (
    STAGES,
    is_crowded,
    is_hidden,
    is_shallow,
    link_event_resolution,
    moved_on,
    resolve,
    spread,
    state_errors,
)
from hybridsim.engine.events.compiled.known_time import (
    KNOWN,
    ORIGIN_AT,
    PHASES_AT,
    SEGMENTS,
    SIGNALS_AT,
    SINCE,
    STEPS,
    begin_call,
    resolve_known_time,
    set_inputs,
    set_origin,
)
from hybridsim.engine.events.compiled.scratch import EVENT_LOOP, KNOWN_TIME, LACKS_TAPE, ROW, SPREAD
from hybridsim.engine.native.kernels import (
    call_kernel,
    call_noinline,
    inline_always,
    inlined,
    kernel,
    kernel_address,
)
from hybridsim.engine.native.loop_hints import index, put, short_loop
from hybridsim.engine.record.event_block import AT_KNOWN_TIME
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.interpreter import advance
from hybridsim.engine.system.programs.modes_index import find_modes

AT_TARGET, STOPPED, FULL = 0, 1, 2  # why a call ended
# Least number of steps in a part of a segment; with less space the next call takes the segment.
MIN_STEPS_IN_PART = 64
FOLLOWED = 3  # returned by a segment kernel that has followed a segment
# An event this close before a known time or the target may belong to that time: relative to the segment, to the time.
_NEAR_KNOWN, _NEAR_IN_TIME = 2.0**-20, 2.0**-40
NO_GUARD = -1  # the end of a segment without an event


class LoopModel(NamedTuple):
    """The data of a system that compiled loops read, as packed arrays."""

    automata: Any  # `hybridsim.engine.system.programs.mode_tables.Automata`
    tapes: Any  # `hybridsim.engine.system.programs.mode_tables.Tapes`
    inputs: Any  # inputs of the tapes
    lin: Any  # `hybridsim.engine.linear.tables.LinearTables`, empty if modes are not linear


class LoopCall(NamedTuple):
    """The arrays of one call of the event loop, for all methods."""

    int_slots: np.ndarray  # (7,) integers at ORIGIN_AT, ...
    longest: np.ndarray  # (1,) longest segment
    times: np.ndarray  # (4,) target, and clock: the origin of the segment, which is advanced
    rates: np.ndarray  # (R, 2) rates of the angles: numbers and rests
    scale: np.ndarray  # (n,) largest states on the segment
    # (5,), see `is_crowded`, and at SINCE the time from the last event to the last known time after it
    pace: np.ndarray
    known: Any  # `hybridsim.engine.events.compiled.known_time.KnownTimeArrays`


class LoopRecord(NamedTuple):
    """The stored segments of a run, with one row per segment."""

    clocks: np.ndarray  # (., 2) time origin
    modes: np.ndarray  # (., C) modes
    vectors: np.ndarray  # (., P) run-time vector
    last_steps: np.ndarray  # number of steps up to the end of the segment
    fires: np.ndarray  # the guard that fired, NO_GUARD, or AT_KNOWN_TIME less the kind of the known time
    # (., 2, n) states before and after the end, or (., 3, n), preceded by the state at the start
    jumps: np.ndarray


class SegmentStart(NamedTuple):
    """The start of a segment, as the compiled loop passes it to a segment kernel."""

    mode_row: int  # row of its modes in the tapes
    bound: float  # local time at which it ends at the latest
    is_ahead: bool  # whether p is as the kernel left it, with the origin of this segment
    is_rejected: bool  # whether the last segment of this kernel is not committed


class SegmentEnd(NamedTuple):
    """The result of a segment kernel: its outcome, and the data of the event at the end.

    The fields from `at` on have values only if a guard fired.
    """

    outcome: int
    s: float  # local time of the end
    fired: int  # the guard, or -1
    steps: int  # number of steps
    at: float  # local time of the end if p has the origin of this segment, 0 if that of the next
    error: float  # error bound of this time
    slope: float  # first two Taylor coefficients of the guard
    bend: float
    last_step: float  # length of the last step
    is_ahead: bool  # whether p has the origin of the next segment


@inlined
def not_followed(outcome: int) -> SegmentEnd:
    """Return the result of a segment kernel that has integrated nothing."""
    return SegmentEnd(outcome, 0.0, -1, 0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


@inline_always
def end_without_event(call: Any, state: Any, work: Any, s: float, is_divided: bool) -> int:
    """Take over the states at the end of a call of the compiled loop, and return the reason for its end.

    A segment that is too long is divided: it goes on in the same modes, where active guards are positive.
    """
    target, clock, scale, x_error = call.times[:2], call.times[2:], call.scale, state.x_error
    put(work.y, state.x)
    for j in range(scale.shape[0]):
        short_loop()
        x_error[j] = 4.0 * UNIT * scale[j] + x_error[j]
    if not is_divided:
        clock[0], clock[1] = target[0], target[1]
        return AT_TARGET
    clock[0], clock[1] = moved_on(clock[0], clock[1], s)
    for g in range(state.sides.shape[0]):
        short_loop()
        state.sides[g], state.orders[g], state.floors[g] = 1, 0, 0.0
    return FULL


@inline_always
def event_loop(
    segment: Any, model: Any, call: Any, state: Any, work: Any, record: Any, own: Any, rows: Any
) -> int:
    """Run from event to event, integrate each segment by the kernel `segment`, and return the reason for the end.

    The numbers of committed steps and segments are in `call`. state: `StateArrays` at the start of the segment,
    advanced by the call, like the clock. work: `EventScratch`. record: `LoopRecord`. own, rows: packs of the method,
    for its arrays and its record. A segment with more steps than fit is committed in parts. A call ends if the event of
    a segment needs modes without an instruction tape (`row_of`). The next call goes on from this segment as if nothing
    had happened, if `ints[IS_CONTINUED]` is set.
    """
    automata, tapes, ints = model.automata, model.tapes, call.int_slots
    target, clock, pace, scale, rates = call.times[:2], call.times[2:], call.pace, call.scale, call.rates
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    y, jumps, place = work.y, record.jumps, (ints[ORIGIN_AT], ints[PHASES_AT])
    before, after, known = jumps.shape[1] - 2, jumps.shape[1] - 1, call.known
    begin_call(ints, pace, work)
    step, i, since = ints[STEPS], ints[SEGMENTS], pace[SINCE]
    is_ahead, is_rejected, k = False, False, find_modes(tapes, z)
    while True:
        bound = (target[0] - clock[0]) + (target[1] - clock[1])
        if not bound > 0.0:
            return AT_TARGET
        kind, near = known.kinds[index(ints[KNOWN])], _NEAR_IN_TIME * abs(clock[0])
        if k < 0 or (kind >= 0 and bound <= near):
            return STOPPED
        k = index(k)
        if i >= record.fires.shape[0]:
            return FULL
        if not is_ahead:
            set_origin(place, rates, clock[0], clock[1], p)
            set_inputs(ints[SIGNALS_AT], known.starts, clock[0], clock[1], p)
        record.clocks[i, 0], record.clocks[i, 1] = clock[0], clock[1]
        put(z, record.modes[i])
        put(p, record.vectors[i])
        put(x, jumps[i, 0])
        start = SegmentStart(k, bound, is_ahead, is_rejected)
        end = segment(start, model, call, state, work, own, rows)
        if end.outcome != FOLLOWED:
            return end.outcome
        fired, s, step_after = end.fired, end.s, step + end.steps
        record.last_steps[i], record.fires[i] = step_after, fired
        put(y, jumps[i, before])
        if (
            not s < bound
            and kind >= 0
            and call_kernel(work.entry_points[KNOWN_TIME], (model, call, state, work, k, s, end.steps)) != 0
        ):
            record.fires[i] = AT_KNOWN_TIME - kind
            put(x, jumps[i, after])
            clock[0], clock[1] = target[0], target[1]
            ints[KNOWN] += 1
            target[0], target[1] = known.times[index(ints[KNOWN]), 0], known.times[index(ints[KNOWN]), 1]
            step, i = step_after, i + 1
            ints[STEPS], ints[SEGMENTS] = step, i
            since, is_ahead = since + s, False
            continue
        if fired < 0:
            put(y, jumps[i, after])
            ints[STEPS], ints[SEGMENTS] = step_after, i + 1
            return end_without_event(call, state, work, s, s < bound)
        fired = index(fired)
        at, error, slope, bend, is_ahead = end.at, end.error, end.slope, end.bend, end.is_ahead
        state_errors(automata, error, y, scale, x_error, z, work.slopes, work.y_error)
        work.float_slots[SPREAD], work.int_slots[ROW] = spread(end.steps, STAGES), k
        former = pace[0], pace[1], pace[2], pace[3]
        is_rejected = (
            is_crowded(since + s, clock, pace, automata.is_unilateral[index(automata.owner[fired])])
            or bound - s <= max(near, _NEAR_KNOWN * bound)
            or (
                is_shallow(slope, bend, end.last_step)
                and is_hidden(model, fired, slope, bend, at, error, state, work)
            )
        )
        if is_rejected or not resolve(model, at, error, fired, state, work):
            is_rejected, is_ahead = True, False  # the kernel of the segment returns STOPPED
            if work.int_slots[LACKS_TAPE] != 0:
                pace[0], pace[1], pace[2], pace[3] = former
                pace[SINCE] = since
            continue
        put(work.x_after, jumps[i, after])
        since = 0.0
        clock[0], clock[1] = moved_on(clock[0], clock[1], s)
        step, i = step_after, i + 1
        ints[STEPS], ints[SEGMENTS] = step, i
        k = work.int_slots[ROW] if work.int_slots[ROW] != k else find_modes(tapes, z)
        if automata.hold[index(automata.owner[fired])] < 0:
            is_ahead = False  # the event may have changed p


@kernel
def call_event_loop(model: Any, call: Any, state: Any, work: Any, record: Any, own: Any, rows: Any) -> int:
    """Call the event loop of a method by its address, and store the end of the last segment."""
    code = call_kernel(work.entry_points[EVENT_LOOP], (model, call, state, work, record, own, rows))
    i = call.int_slots[SEGMENTS]
    if i > 0:  # without segments there may be no row left
        record.clocks[i, 0], record.clocks[i, 1] = call.times[2], call.times[3]
        put(state.z, record.modes[i])
    return code


def link_event_loop(
    loop: Any, model: Any, call: Any, state: Any, work: Any, record: Any, own: Any, rows: Any
) -> None:
    """Compile the kernels that a call needs, and store their addresses for other kernels."""
    link_event_resolution(model, state, work)
    if call.known.times.shape[0] > 1:  # there may be more than the target
        work.entry_points[KNOWN_TIME] = kernel_address(
            resolve_known_time, model, call, state, work, 0, 0.0, 0
        )
    work.entry_points[EVENT_LOOP] = kernel_address(loop, model, call, state, work, record, own, rows)


@inlined
def load_constants(inputs: Any, tapes: Any, k: int, p: Any, V: Any) -> None:
    """Load the constants of the modes in row k into the registers of the segment kernel."""
    for i in range(inputs.constants.shape[0]):
        V[inputs.constants[i], 0] = inputs.values[i, 0]
    for i in range(inputs.parameters.shape[0]):
        V[inputs.parameters[i], 0] = p[inputs.sources[i]]
    rows = tapes.constant[tapes.constant_start[k] : tapes.constant_start[k + 1]]
    call_noinline(advance, (rows, V, 0))


@inlined
def any_holding(automata: Any, z: Any) -> bool:
    """Return whether any component is in the mode that holds its surface at zero."""
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c]:
            return True
    return False


@inlined
def any_projecting(automata: Any, z: Any) -> bool:
    """Return whether any component keeps its surface at zero by projection of each step."""
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c] and automata.pin[c, 0] < 0:
            return True
    return False
