"""Resolve ordinary events in compiled code: one guard of one component, with a certain outcome.

The rules are those of `hybridsim.engine.events.choice.verdict`. Other events are left unchanged for
`hybridsim.engine.events.resolve`, which can report the reason: several guards at once, a case undecided at rounding, a
cascade, no or several admissible motions, an impact, or an event in a model that also slides where it jumps.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.events.choice.verdict import FINE
from hybridsim.engine.events.compiled.resolve_clear import resolve_clear
from hybridsim.engine.events.compiled.resolve_surface import choose_surface_modes
from hybridsim.engine.events.compiled.scratch import (
    DISCRETE,
    DISCRETE_AT,
    FIRED,
    NOBODY,
    SPREAD,
    LocatedEvent,
    called_by,
    located,
)
from hybridsim.engine.events.compiled.verdicts import (
    guard_series,
    guard_side,
    is_continuous,
    is_linear,
    members_verdict,
    size_at,
)
from hybridsim.engine.linear.motion import errors_of_time, functions_of_time
from hybridsim.engine.native.kernels import call, call_noinline, inline_always, inlined
from hybridsim.engine.native.loop_hints import fill, put
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.programs.modes_index import find_modes


@inlined
def is_alone(tapes: Any, lin: Any, k: int, fired: int, x: Any, x_error: Any, work: Any) -> bool:
    """Return whether no other guard can be zero together with the fired one, given the rounding of the steps."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        if g == fired:
            continue
        value, bound = size_at(lin, k, g, x, x_error, work)
        if abs(value) > work.float_slots[SPREAD] * bound:
            continue
        if abs(value) > bound or call_noinline(guard_side, (lin, k, g, 1, x, x_error, work))[0] < 0:
            return False
    return True


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
    """Apply the declared transition of the guard and its reset; return False if surfaces may move."""
    for d in range(z.shape[0]):
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
            out[n + i] = at.p[discrete_at + i]
        asked[count] = reset
        call(functions.reset, at.s, at.x, at.p, asked, out)
        for i in range(n):
            x[i] = out[i]
        for i in range(n_discrete):
            p[discrete_at + i] = out[n + i]
        for i in range(automata.reset_start[reset], automata.reset_start[reset + 1]):
            slot = automata.reset_slot[i]
            if slot < n:
                x_error[slot] = UNIT * abs(x[slot])
                if not math.isfinite(x[slot]):
                    return False
    return True


@inline_always
def resolve_ordinary(automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any) -> bool:
    """Compute the state after an ordinary event (x_after, slopes, z_after); return False for other events.

    A transition of a component without a surface may change the run-time vector, which is then written to p_after.
    Sides, orders and floors of the guards in the new modes are in the work space as well. If the event is not ordinary,
    other parts of the work space may have been overwritten.
    """
    functions, fired, at = called_by(work), work.int_slots[FIRED], located(state, work)
    x, x_error, z, p = work.x_after, work.slopes, work.z_after, work.p_after
    put(at.x, x)
    put(at.x_error, x_error)
    put(at.z, z)
    on_surface, sides, orders, floors = work.on_surface, work.sides, work.orders, work.floors
    fill(on_surface, False)
    k = find_modes(tapes, z)
    if k < 0:
        return False
    is_known = tapes.active_start[k + 1] - tapes.active_start[k] > 1
    if is_known:
        guard_series(tapes, inputs, lin, k, at, x, x_error, work)
        if not is_alone(tapes, lin, k, fired, x, x_error, work):
            return False
    c = automata.owner[fired]
    for i in range(automata.cluster_start[c], automata.cluster_start[c + 1]):
        if automata.is_unilateral[automata.cluster[i]]:
            return False
    if automata.hold[c] >= 0:
        if z[c] != automata.hold[c] and automata.place[fired] > 0:
            return False  # a guard on the load does not move the contact onto its surface
        number = choose_surface_modes(automata, tapes, inputs, lin, state, work, fired, k, is_known)
        if number < 0:
            return False
        # if the cluster has all components, `choose_surface_modes` has judged all guards
        if automata.cluster_start[c + 1] - automata.cluster_start[c] == z.shape[0]:
            put(work.all_sides[number], sides)
            put(work.all_orders[number], orders)
            put(work.all_floors[number], floors)
            return True
        continuous = is_continuous(functions, automata, at, x, z, work.everything, fired, work.jumps)
        is_on, vector = z[c] == at.z[c], at.p
    else:
        put(at.p, p)
        if not take_choice(functions, automata, at, fired, x, x_error, z, p, work):
            return False
        if is_linear(lin):
            functions_of_time(lin, at.s, p, work.factors, work.w)
            errors_of_time(lin, at.s_error, work.factors, work.w_error)
        continuous, is_on, vector = False, automata.is_corner[c], p
    k = find_modes(tapes, z)
    if k < 0:
        return False
    after = LocatedEvent(at.s, at.s_error, x, x_error, vector, at.z)
    guard_series(tapes, inputs, lin, k, after, x, x_error, work)
    verdict = call_noinline(
        members_verdict,
        (automata, lin, k, at, x, x_error, z, work.everything, fired, is_on, continuous, work, sides, orders, floors),
    )  # fmt: skip
    return verdict == FINE


def resolve_event(automata: Any, tapes: Any, inputs: Any, lin: Any, state: Any, work: Any) -> int:
    """Resolve the event in the work space and replace the state. Return 1, or 0 if it is not ordinary.

    If no guard fired, only the series of the active guards are written to the work space. lin: tables of linear modes,
    empty for others. state: `hybridsim.engine.events.compiled.after_segment.State`.
    """
    if work.int_slots[FIRED] == NOBODY:
        at, k = located(state, work), find_modes(tapes, state.z)
        guard_series(tapes, inputs, lin, k, at, at.x, at.x_error, work)
        return 1
    if is_linear(lin) and resolve_clear(automata, tapes, lin, state, work):
        return 1
    if not resolve_ordinary(automata, tapes, inputs, lin, state, work):
        return 0
    put(work.x_after, state.x)
    put(work.slopes, state.x_error)
    put(work.z_after, state.z)
    if automata.hold[automata.owner[work.int_slots[FIRED]]] < 0:
        put(work.p_after, state.p)
    put(work.sides, state.sides)
    put(work.orders, state.orders)
    put(work.floors, state.floors)
    return 1
