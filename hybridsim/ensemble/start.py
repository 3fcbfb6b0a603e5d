"""This module starts a run in compiled code, if the modes of the contacts are certain.

The rules are those of `hybridsim.engine.events.resolve`, which resolves the other cases and reports problems.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.events.choice.joint_choice import is_below_limit
from hybridsim.engine.events.choice.verdict import FINE
from hybridsim.engine.events.compiled.guard_series import guard_series
from hybridsim.engine.events.compiled.resolve_surface import choose_modes, cluster_of, row_verdict
from hybridsim.engine.events.compiled.scratch import AT, AT_ERROR, LocatedEvent, called_by, located
from hybridsim.engine.linear.motion import functions_of_time, to_modal
from hybridsim.engine.native.kernels import call, inline_always, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.simd_products import LANES
from hybridsim.engine.run.event_loop import set_origin
from hybridsim.engine.series.bounded import UNIT, run_series
from hybridsim.engine.system.programs.modes_index import find_modes

_UNKNOWN = -1  # mode not determined yet


@kernel
def plain_start(
    automata: Any,
    tapes: Any,
    inputs: Any,
    none: Any,
    vector_positions: Any,
    surfaces: Any,
    t0: float,
    state: Any,
    work: Any,
) -> bool:
    """Choose all modes at `t0`; return False if the outcome is uncertain.

    none: empty tables, so that guards are judged by the tape. vector_positions: rates, and the positions of the origin,
    the phases and the pin in p. surfaces: from the tape of the first modes, the constant rows, the rows, the
    registers of the rates and of the surfaces, and the component of each surface.
    """
    rates, origin_at, phases_at, pin_at = vector_positions
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    set_origin((origin_at, phases_at), rates, t0, 0.0, p)
    for i in range(x.shape[0]):
        x_error[i] = (
            0.0 if x[i] == round(x[i]) else 2.0 * UNIT * abs(x[i])
        )  # as `engine.events.start.start_errors`
    if not _take_sides(automata, inputs, surfaces, pin_at, state, work):
        return False
    for c in range(z.shape[0]):
        if z[c] == _UNKNOWN and not _choose_cluster(automata, tapes, inputs, none, state, c, work):
            return False
    k = find_modes(tapes, z)
    if k < 0:
        return False
    at = LocatedEvent(0.0, 0.0, x, x_error, p, z)
    guard_series(tapes, inputs, none, k, at, x, x_error, work)
    verdict = row_verdict(automata, none, k, z, work.everything, False, 0, work)
    put(work.all_sides[0], state.sides)
    put(work.all_orders[0], state.orders)
    put(work.all_floors[0], state.floors)
    return verdict == FINE


@inline_always
def _take_sides(automata: Any, inputs: Any, surfaces: Any, pin_at: int, state: Any, work: Any) -> bool:
    """Set each mode by the side of the component's surface; return False if a value is NaN."""
    constant, rows, derivatives, registers, owners = surfaces
    V, E, z, p = work.V, work.E, state.z, state.p
    p[pin_at] = 0.0  # the states as they are, not projected by a holding mode
    run_series(constant, rows, inputs, derivatives, 0.0, 0.0, state.x, state.x_error, p, V, E)
    p[pin_at] = 1.0
    for j in range(registers.shape[0]):
        c, value = owners[j], V[registers[j], 0]
        if not abs(value) < math.inf:
            return False
        work.on_surface[c] = abs(value) <= E[registers[j], 0]
        if work.on_surface[c]:
            z[c] = _UNKNOWN
        else:
            z[c] = automata.above[c] if value > 0.0 else 3 - automata.hold[c] - automata.above[c]
    return True


@inline_always
def _choose_cluster(
    automata: Any, tapes: Any, inputs: Any, none: Any, state: Any, first: int, work: Any
) -> bool:
    """Choose the modes of a cluster's components on their surfaces; return whether they are certain."""
    x, x_error, z, p = state.x, state.x_error, state.z, state.p
    members, current, holds, trial, y = work.members, work.current, work.holds, work.trial, work.y
    cluster = cluster_of(automata, first)
    count = 0
    for i in range(cluster.shape[0]):
        c = cluster[i]
        if z[c] == _UNKNOWN:
            if count == members.shape[0]:
                return False
            members[count], current[count], holds[count] = c, automata.hold[c], automata.hold[c]
            count += 1
    for c in range(z.shape[0]):
        trial[c] = max(z[c], 0)
    for i in range(count):
        trial[members[i]] = holds[i]
    call(called_by(work).project, 0.0, x, p, trial, y)
    put(y, x)
    for i in range(count):
        for j in range(automata.pin.shape[1]):
            held = automata.pin[members[i], j]
            if held >= 0:
                x_error[held] = UNIT * abs(x[held])
    work.float_slots[AT] = work.float_slots[AT_ERROR] = 0.0
    put(x, work.x_after)
    put(x_error, work.slopes)
    put(z, work.before)
    put(z, work.now)
    at, k = located(state, work), find_modes(tapes, trial)
    if k < 0:
        return False
    guard_series(tapes, inputs, none, k, at, work.x_after, work.slopes, work)
    for i in range(count):
        work.keeps[i] = count > 1 and is_below_limit(automata, work, members[i])
    if choose_modes(automata, tapes, inputs, none, at, k, True, count, work) < 0:
        return False
    for i in range(count):
        z[members[i]] = trial[members[i]]
    return True


@kernel
def keeps_holding(tapes: Any, lin: Any, state: Any, work: Any, c: Any) -> bool:
    """Return whether nothing moves any more: all states are constant, and no guard passes zero.

    A guard that reaches zero and turns back there, within its rounding, leaves the mode unchanged. Functions of time
    are taken at the origin of the state. c: scratch for modal coordinates.
    """
    x, z, p = state.x, state.z, state.p
    k = find_modes(tapes, z)
    if k < 0:
        return False
    functions_of_time(lin, 0.0, p, work.factors, work.w)
    for m in range(lin.slopes.shape[2]):
        for q in range(lin.slopes.shape[1]):
            for i in range(LANES):
                if lin.slopes[k, q, m, i] != 0.0 and (m >= x.shape[0] or x[m] != 0.0):
                    return False  # the state moves or is forced
    to_modal(lin, k, x, work.w, c)
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        turning = lin.waves[k, g]
        level = size = 0.0
        for j in range(lin.counts[k]):
            size += lin.sizes[k, g, j] * (abs(c[j].real) + abs(c[j].imag))
            if j != turning:
                if lin.sizes[k, g, j] != 0.0 and lin.values[k, j] != 0.0:
                    return False  # neither constant nor one sine wave
                level += lin.terms[k, g, j, 0, 0] * c[j].real - lin.terms[k, g, j, 1, 0] * c[j].imag
        radius = 0.0
        if turning >= 0:
            u, v = lin.terms[k, g, turning, 0, 0], lin.terms[k, g, turning, 1, 0]
            radius = math.hypot(
                u * c[turning].real - v * c[turning].imag, u * c[turning].imag + v * c[turning].real
            )
        if not level - radius >= -(16.0 + 2.0 * lin.counts[k]) * UNIT * size or not level > 0.0:
            return False
    return True


@kernel
def opposing(effects: Any, x: Any, p: Any, z: Any, scratch: Any, out: Any) -> None:
    """Write to `out` (N,) whether every contact opposes its own velocity at the starts of N runs."""
    for i in range(x.shape[0]):
        call(effects, 0.0, x[i], p[i], z, scratch)
        out[i] = True
        for c in range(scratch.shape[0]):
            out[i] = out[i] and scratch[c] < 0.0
