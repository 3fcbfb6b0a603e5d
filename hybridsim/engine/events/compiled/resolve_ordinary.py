"""Resolve ordinary events in compiled code: one guard of one component fires, and rounding cannot change the outcome.

The rules are those of `hybridsim.engine.events.choice`. Other events are left unchanged for
`hybridsim.engine.events.resolve`, which can report the reason: several guards at once, a case undecided at rounding, a
cascade, no or several admissible motions, or an event in a model that also slides where it jumps. An impact is resolved
in `hybridsim.engine.events.compiled.resolve_impact`.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.events.choice.verdict import FINE, LEAVES, NO_SIDE, side_after, value_of
from hybridsim.engine.events.compiled.guard_series import guard_series, is_continuous
from hybridsim.engine.events.compiled.resolve_clear import resolve_clear
from hybridsim.engine.events.compiled.resolve_surface import choose_surface_modes, row_verdict
from hybridsim.engine.events.compiled.scratch import (
    DISCRETE,
    DISCRETE_AT,
    FIRED,
    IMPACT,
    LACKS_TAPE,
    NOBODY,
    ROW,
    SPREAD,
    LocatedEvent,
    called_by,
    located,
    row_of,
)
from hybridsim.engine.linear.guard_coefficients import has_tables, linear_series, measure_point
from hybridsim.engine.linear.motion import errors_of_time, functions_of_time
from hybridsim.engine.native.kernels import call, call_kernel, inline_always, inlined
from hybridsim.engine.native.loop_hints import put, short_loop
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.programs.modes_index import find_modes


@inlined
def is_alone(automata: Any, tapes: Any, lin: Any, k: int, fired: int, z: Any, work: Any) -> bool:
    """Return whether no other guard can be zero together with the fired guard.

    A guard that rises from zero does not count, except the limit of another contact, which may be released too.
    """
    c = automata.owner[fired]
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        if g == fired:
            continue
        value, bound = value_of(lin, k, g, work)
        if abs(value) > work.float_slots[SPREAD] * bound:
            continue
        d = automata.owner[g]
        if abs(value) > bound or (d != c and automata.hold[d] == z[d]):
            return False
        linear_series(lin, k, g, 1, work)
        if side_after(work.judged[0, g], work.judged[1, g], 1)[0] < 0:
            return False
    return True


@inlined
def way_back(automata: Any, c: int, mode: int, to: int, fired: int) -> int:
    """Return the guard of `mode`, other than the fired one, whose transition leads to the mode `to`, or NOBODY."""
    for j in range(automata.guards_of.shape[2]):
        g = automata.guards_of[c, mode, j]
        if g >= 0 and g != fired and automata.target[c, mode, j, 0] == to:
            return int(g)
    return NOBODY


@inline_always
def take_choice(
    functions: Any,
    automata: Any,
    at: Any,
    fired: int,
    x: Any,
    x_error: Any,
    z: Any,
    p: Any,
    work: Any,
) -> bool:
    """Take a guard's declared transition and apply its reset; return False if the general code has to do this."""
    for d in range(z.shape[0]):
        short_loop()
        if automata.hold[d] >= 0 and not automata.is_corner[automata.owner[fired]]:
            return False
    c, n, count = automata.owner[fired], x.shape[0], z.shape[0]
    n_discrete, discrete_at = work.int_slots[DISCRETE], work.int_slots[DISCRETE_AT]
    mode, place = at.z[c], automata.place[fired]
    asked = work.asked
    put(at.z, asked)
    asked[count], asked[count + 1], asked[count + 2] = c, mode, place
    call(functions.choose, at.s, at.x, at.p, asked, work.out)
    number = int(work.out[0])
    if number < 0:
        return False
    z[c] = automata.target[c, mode, place, number]
    reset = automata.reset[c, mode, place, number]
    if reset >= 0:
        out = work.out
        put(at.x, out)
        for i in range(n_discrete):
            short_loop()
            out[n + i] = at.p[discrete_at + i]
        asked[count] = reset
        call(functions.reset, at.s, at.x, at.p, asked, out)
        for i in range(n):
            short_loop()
            x[i] = out[i]
        for i in range(n_discrete):
            short_loop()
            p[discrete_at + i] = out[n + i]
        for i in range(automata.reset_start[reset], automata.reset_start[reset + 1]):
            slot = automata.reset_slot[i]
            if slot < n:
                x_error[slot] = UNIT * abs(x[slot])
                if not math.isfinite(x[slot]):
                    return False
    return True


@inline_always
def resolve_ordinary(
    automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any, fired: int
) -> int:
    """Compute the state and the modes after an ordinary event; return -1 for other events.

    The result is the row with sides, orders and floors of the guards in the new modes. A transition of a component
    without a surface may change the run-time vector, which is then written to p_after. If the event is not ordinary,
    other parts of the work space may have been overwritten.
    """
    functions, at, everything = called_by(work), located(state, work), work.everything
    x, x_error, z, p = work.x_after, work.slopes, work.trial, work.p_after
    put(at.x, x)
    put(at.x_error, x_error)
    k = find_modes(tapes, at.z)
    if k < 0:
        return -1
    is_known = tapes.active_start[k + 1] - tapes.active_start[k] > 1
    if is_known:
        measure_point(lin, work)
        guard_series(tapes, inputs, lin, k, at, x, x_error, work)
        if not is_alone(automata, tapes, lin, k, fired, at.z, work):
            return -1
    c, back = automata.owner[fired], NOBODY
    for i in range(automata.cluster_start[c], automata.cluster_start[c + 1]):
        d = automata.cluster[i]
        if automata.is_unilateral[d] and (d == c or at.z[d] == automata.hold[d]):
            return -1  # contacts at their gaps are decided together, with impacts
    work.int_slots[ROW] = k
    if automata.hold[c] >= 0:
        if at.z[c] != automata.hold[c] and automata.place[fired] > 0:
            return -1  # a guard on the load does not move the contact onto its surface
        number = choose_surface_modes(automata, tapes, inputs, lin, state, work, fired, k, is_known)
        # if the cluster has all components, all guards have been judged
        if number < 0 or automata.cluster_start[c + 1] - automata.cluster_start[c] == z.shape[0]:
            return number
        continuous, vector = is_continuous(automata, at, z, everything, work), at.p
    else:
        put(at.z, z)
        put(at.p, p)
        if not take_choice(functions, automata, at, fired, x, x_error, z, p, work):
            return -1
        if has_tables(lin):
            functions_of_time(lin, at.s, p, work.factors, work.w)
            errors_of_time(lin, at.s_error, work.factors, work.w_error)
            measure_point(lin, work)
        number, continuous, vector = 0, False, p
        work.is_zero[fired] = False
        back = way_back(automata, c, z[c], at.z[c], fired) if automata.is_corner[c] else NOBODY
        if back >= 0:
            work.is_zero[back] = True  # a corner is at zero on both sides
        put(z, work.now)
        work.int_slots[ROW] = row_of(tapes, z, work)
    k, found = work.int_slots[ROW], LEAVES
    if k >= 0:
        after = LocatedEvent(at.s, at.s_error, x, x_error, vector, at.z)
        guard_series(tapes, inputs, lin, k, after, x, x_error, work)
        found = row_verdict(automata, lin, k, z, everything, continuous, number, work)
    if back >= 0:
        work.is_zero[back] = False
    return number if found == FINE else -1


@inlined
def closes_gap(automata: Any, c: int, fired: int, z: Any) -> bool:
    """Return whether the fired guard is the gap of an open unilateral contact."""
    return automata.is_unilateral[c] and automata.place[fired] == 0 and z[c] != automata.hold[c]


def resolve_event(automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any) -> int:
    """Resolve the event in the work space and replace the state; return 1, or 0 for other events.

    If modes without an instruction tape are missing, nothing is decided: the event counts as one of the others. If no
    guard fired, only the series of the active guards are written to the work space. lin: tables of linear modes,
    empty for others. state: `hybridsim.engine.events.state.StateArrays`.
    """
    fired = work.int_slots[FIRED]
    if fired == NOBODY:
        at, k = located(state, work), find_modes(tapes, state.z)
        guard_series(tapes, inputs, lin, k, at, at.x, at.x_error, work)
        return 1
    if has_tables(lin) and resolve_clear(automata, tapes, lin, state, work, fired):
        return 1
    if work.int_slots[LACKS_TAPE] != 0:
        return 0
    c = automata.owner[fired]
    for d in range(state.z.shape[0]):
        short_loop()
        work.now[d] = work.before[d] = state.z[d]
        work.on_surface[d] = False
    work.is_zero[fired] = True
    work.released_to[c] = automata.place[fired] if automata.hold[c] == state.z[c] else NO_SIDE
    if closes_gap(automata, c, fired, state.z):
        row = call_kernel(work.entry_points[IMPACT], (automata, tapes, inputs, lin, state, work, fired))
    else:
        row = resolve_ordinary(automata, tapes, inputs, lin, state, work, fired)
    work.is_zero[fired] = False
    work.released_to[c] = NO_SIDE
    if row < 0:
        return 0
    put(work.x_after, state.x)
    put(work.slopes, state.x_error)
    put(work.trial, state.z)
    if automata.hold[c] < 0:
        put(work.p_after, state.p)
    put(work.all_sides[row], state.sides)
    put(work.all_orders[row], state.orders)
    put(work.all_floors[row], state.floors)
    return 1
