"""This module computes, in compiled code, the map over forcing periods and its derivative through all events.

At an event with guard g the derivative Y of the states becomes Y + (f- - f+) dt with dt = -(g_x Y)/(g_t + g_x f-), as
in `hybridsim.analysis.variations.carried`: contacts do not move the states at an event. A holding contact keeps its
state constant, so that the derivative of this state is zero.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.events.compiled.known_time import SEGMENTS as SEGMENTS_AT
from hybridsim.engine.events.compiled.scratch import EVENT_LOOP
from hybridsim.engine.linear.motion import functions_of_time, moved, slopes_of, states_of, to_modal
from hybridsim.engine.native.kernels import call_kernel, inline_always, inlined, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.simd.products import dot
from hybridsim.engine.run.event_loop import AT_TARGET
from hybridsim.ensemble.points import set_start_errors

_WORD_FACTOR, _WORD_MASK = 1_000_003, (1 << 40) - 1


class MapScratch(NamedTuple):
    """Scratch arrays for the derivative of the map; vectors are padded for `hybridsim.engine.native.simd.products`."""

    matrix: np.ndarray  # (n, n) derivative of the states by those at the start
    column: np.ndarray  # (n,) one column of it
    after: np.ndarray  # (n,) the column, or the state, after a segment
    before_rates: np.ndarray  # (n,) rates before an event
    after_rates: np.ndarray  # (n,) rates after it
    no_time: np.ndarray  # (M,) zeros in place of the functions of time


@kernel
def run_periods(packs: Any, length: float) -> int:
    """Run for a whole number of periods from the state in `packs`; return the number of segments, or 0.

    0 means that the compiled loop has left an event to the general one. The state begins a segment in its modes.
    """
    call, state = packs.call, packs.state
    call.times[0], call.times[1], call.times[2], call.times[3] = length, 0.0, 0.0, 0.0
    set_start_errors(state)
    arguments = (packs.model, call, state, packs.work, packs.record, packs.own, packs.rows)
    code = call_kernel(packs.work.entry_points[EVENT_LOOP], arguments)
    return call.int_slots[SEGMENTS_AT] if code == AT_TARGET else 0


@inlined
def begin_segment(state: Any) -> None:
    """Begin a segment at the present state, in modes whose guards are positive at this state."""
    for g in range(state.sides.shape[0]):
        state.sides[g], state.orders[g], state.floors[g] = 1, 0, 0.0


@inline_always
def word_of(rows: Any, count: int) -> int:
    """Return a number that identifies the sequence of modes of recorded segments."""
    word = 1
    for i in range(count):
        word = (word * _WORD_FACTOR + rows[i] + 1) & _WORD_MASK
    return word


@inlined
def _hold(automata: Any, z: Any, matrix: Any) -> None:
    """Set the derivatives of held states to zero."""
    for c in range(z.shape[0]):
        if automata.hold[c] >= 0 and z[c] == automata.hold[c]:
            for j in range(automata.pin.shape[1]):
                if automata.pin[c, j] >= 0:
                    for i in range(matrix.shape[1]):
                        matrix[automata.pin[c, j], i] = 0.0


@inline_always
def carry_derivative(packs: Any, lin: Any, count: int, scratch: Any) -> None:
    """Write to `scratch.matrix` the derivative of the last recorded state with respect to the first one."""
    automata, record = packs.model.automata, packs.record
    rows, work, own = packs.rows, packs.work, packs.own
    matrix, column, after = scratch.matrix, scratch.column, scratch.after
    before_rates, after_rates = scratch.before_rates, scratch.after_rates
    n = matrix.shape[0]
    for i in range(n):
        for j in range(n):
            matrix[i, j] = 1.0 if i == j else 0.0
    for segment in range(count):
        k, s = rows.rows[segment], rows.ends[segment]
        _hold(automata, record.modes[segment], matrix)
        for j in range(n):
            for i in range(n):
                column[i] = matrix[i, j]
            to_modal(lin, k, column, scratch.no_time, own.c)
            moved(lin, k, own.c, s, own.v)
            states_of(lin, k, own.v, after)
            for i in range(n):
                matrix[i, j] = after[i]
        guard = record.fires[segment]
        if guard < 0 or segment + 1 == count:
            continue
        functions_of_time(lin, s, record.vectors[segment], work.factors, work.w)
        put(record.jumps[segment, 1], column)
        slopes_of(lin, k, column, work.w, before_rates)
        passing = dot(lin.series, (k, guard, 1), (column, work.w))
        put(record.jumps[segment, 2], after)
        slopes_of(lin, rows.rows[segment + 1], after, work.w, after_rates)
        for j in range(n):
            moves = 0.0
            for i in range(n):
                moves += lin.series[k, guard, 0, i] * matrix[i, j]
            for i in range(n):
                matrix[i, j] -= (before_rates[i] - after_rates[i]) * moves / passing
    _hold(automata, record.modes[count - 1], matrix)


@inline_always
def solve(rows: Any) -> bool:
    """Solve linear equations (n, n + 1) in place in the last column; return False if the matrix is singular."""
    n = rows.shape[0]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(rows[i, k]) > abs(rows[best, k]):
                best = i
        if not abs(rows[best, k]) > _SINGULAR:
            return False
        for j in range(n + 1):
            rows[k, j], rows[best, j] = rows[best, j], rows[k, j]
        for i in range(n):
            if i != k:
                factor = rows[i, k] / rows[k, k]
                for j in range(k, n + 1):
                    rows[i, j] -= factor * rows[k, j]
    for k in range(n):
        rows[k, n] /= rows[k, k]
    return True


_SINGULAR = 1e-12  # a pivot of I - Y in units of the states below it is rounding
