"""Judge modes in compiled loops: whether the guards of a candidate become negative just after an event."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.choice.verdict import (
    FINE,
    LEAVES,
    UNDECIDED,
    decreed_zeros,
    is_decreed,
    open_question,
    side_after,
)
from hybridsim.engine.events.compiled.scratch import SERIES, called_by, located
from hybridsim.engine.linear.motion import linear_coefficient, linear_side
from hybridsim.engine.native.kernels import (
    array_at,
    call,
    call_kernel,
    call_noinline,
    call_series,
    inline_always,
    inlined,
    kernel,
)
from hybridsim.engine.series.bounded import ORDER, run_series
from hybridsim.engine.system.programs.modes_index import find_modes

UNKNOWN = -2  # there are no tables for the modes, so no verdict


def interpreted_series(
    tapes: Any, inputs: Any, k: int, s: float, s_error: float, x: Any, x_error: Any, p: Any, work: Any
) -> int:
    """Compute `guard_series` with the tape interpreter. This kernel is called by address."""
    judged, V, E = work.judged, work.V, work.E
    constant = tapes.constant[tapes.constant_start[k] : tapes.constant_start[k + 1]]
    rows = tapes.optimised[tapes.optimised_start[k] : tapes.optimised_start[k + 1]]
    n, size = work.y.shape[0], work.p_after.shape[0]
    state, bounds, vector = array_at(x, n), array_at(x_error, n), array_at(p, size)
    run_series(constant, rows, inputs, tapes.derivatives[k], s, s_error, state, bounds, vector, V, E)
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        g = tapes.active[i]
        r = tapes.guards[k, g]
        for j in range(judged.shape[2]):
            judged[0, g, j], judged[1, g, j] = V[r, j], E[r, j]
    return 0


@inlined
def guard_series(tapes: Any, inputs: Any, lin: Any, k: int, at: Any, x: Any, x_error: Any, work: Any) -> None:
    """Write coefficients to third order of the active guards, with bounds, along the flow of the modes in row k.

    For linear modes these are rows over states and functions of time, and only those that decide are computed, by
    `sides_of`.
    """
    if is_linear(lin):
        return
    if tapes.bounds[k] != 0:
        call_series(tapes.bounds[k], at.s, at.s_error, x, x_error, at.p, work.judged)
        return
    tapes.lacked[k] += 1
    call_kernel(work.entry_points[SERIES], (tapes, inputs, k, at.s, at.s_error, x, x_error, at.p, work))


@inlined
def is_linear(lin: Any) -> bool:
    """Return whether there are tables of linear modes."""
    return lin.counts.shape[0] > 0


@inlined
def guard_side(
    lin: Any, k: int, g: int, decreed: int, x: Any, x_error: Any, work: Any
) -> tuple[int, int, bool]:
    """Return the sign of a guard just after, the order that decides it, and whether rounding leaves it open.

    k: the row of the modes whose `guard_series` were computed last.
    """
    if is_linear(lin):
        return call_noinline(linear_side, (lin, k, g, decreed, x, x_error, work))
    values, bounds = work.judged[0, g], work.judged[1, g]
    side, order = side_after(values, bounds, decreed)
    return side, order, side == 0 and open_question(values, bounds, decreed)


@inlined
def size_at(lin: Any, k: int, g: int, x: Any, x_error: Any, work: Any) -> tuple[float, float]:
    """Return the value of a guard and its error bound."""
    if is_linear(lin):
        return linear_coefficient(lin, k, g, 0, x, x_error, work)
    return work.judged[0, g, 0], work.judged[1, g, 0]


@inlined
def is_release(automata: Any, before: Any, z: Any, c: int, fired: int) -> bool:
    """Return whether a component leaves its holding mode through the located guard."""
    if automata.hold[c] < 0 or before[c] != automata.hold[c] or z[c] == automata.hold[c]:
        return False
    side = 0 if z[c] == automata.above[c] else 1
    return automata.owner[fired] == c and automata.place[fired] == side


@inlined
def is_continuous(
    functions: Any, automata: Any, at: Any, x: Any, z: Any, members: Any, fired: int, jumps: Any
) -> bool:
    """Return whether every change among some components is a release without a jump."""
    asked = False
    for i in range(members.shape[0]):
        c = members[i]
        if z[c] == at.z[c]:
            continue
        if not is_release(automata, at.z, z, c, fired):
            return False
        if not asked:
            call(functions.jumps, at.s, x, at.p, z, jumps)
            asked = True
        side = 0 if z[c] == automata.above[c] else 1
        if jumps[2 * automata.surface[c] + side] != 0.0:
            return False
    return True


@kernel
def members_verdict(
    automata: Any,
    lin: Any,
    k: int,
    at: Any,
    x: Any,
    x_error: Any,
    z: Any,
    members: Any,
    fired: int,
    is_on: bool,
    continuous: bool,
    work: Any,
    sides: Any,
    orders: Any,
    floors: Any,
) -> int:
    """Return the verdict on the guards of some components in the candidate z of row k.

    sides, orders, floors: of all guards, with bounds of their values; valid unless the verdict is LEAVES. is_on:
    whether the located guard is still to be crossed; a corner is at zero on both sides. continuous: whether all
    unknowns stay unchanged.
    """
    on_surface, guards_of, hold = work.on_surface, automata.guards_of, automata.hold
    verdict = FINE
    for g in range(sides.shape[0]):
        sides[g], orders[g], floors[g] = 1, 0, 0.0
    for i in range(members.shape[0]):
        c = members[i]
        is_holding = hold[c] >= 0 and z[c] == hold[c]
        is_smooth = continuous and is_release(automata, at.z, z, c, fired)
        for j in range(guards_of.shape[2]):
            g = guards_of[c, z[c], j]
            if g < 0:
                continue
            is_fired = is_on and g == fired and (z[c] == at.z[c] or automata.is_corner[c])
            is_fired = is_fired and is_decreed(is_holding, continuous)
            zeros = decreed_zeros(
                j == 0, on_surface[c], is_holding, is_smooth, is_fired, automata.is_unilateral[c]
            )
            side, order, is_open = guard_side(lin, k, g, zeros, x, x_error, work)
            if side < 0:
                return LEAVES
            sides[g], orders[g] = side, order if order <= ORDER else 0
            if order > 0:
                floors[g] = size_at(lin, k, g, x, x_error, work)[1]
            if is_open:
                verdict = UNDECIDED
    return verdict


@inlined
def certainly_leaves(
    automata: Any, lin: Any, k: int, z: Any, fired: int, is_known: bool, x: Any, x_error: Any, work: Any
) -> bool:
    """Return whether the located guard certainly becomes negative in the modes z in row k.

    The verdict on these modes is then LEAVES. is_known: whether the series of their guards are in the work space.
    """
    if not (is_known or is_linear(lin)):
        return False
    c = automata.owner[fired]
    zeros = decreed_zeros(automata.place[fired] == 0, True, z[c] == automata.hold[c], False, True, False)
    return guard_side(lin, k, fired, zeros, x, x_error, work)[0] < 0


@inline_always
def cluster_of(automata: Any, c: int) -> Any:
    """Return the components whose modes are chosen together with the mode of component c."""
    return automata.cluster[automata.cluster_start[c] : automata.cluster_start[c + 1]]


@kernel
def candidate_verdict(
    automata: Any,
    tapes: Any,
    inputs: Any,
    lin: Any,
    state: Any,
    work: Any,
    fired: int,
    is_known: bool,
    c: int,
    number: int,
) -> int:
    """Return the verdict on the modes in `work.trial`, and write its details to the rows of that number.

    state: before the event; the states after it are `work.x_after` with error bounds `work.slopes`. c: one of the
    decided components. The result is UNKNOWN if there are no tables for these modes. is_known: whether the series of
    their guards are in the work space.
    """
    k = find_modes(tapes, work.trial)
    if k < 0:
        return UNKNOWN
    at, cluster = located(state, work), cluster_of(automata, c)
    x, x_error = work.x_after, work.slopes
    if not is_known:
        guard_series(tapes, inputs, lin, k, at, x, x_error, work)
    continuous = is_continuous(called_by(work), automata, at, x, work.trial, cluster, fired, work.jumps)
    work.smooth[number] = continuous
    return call_noinline(
        members_verdict,
        (
            automata, lin, k, at, x, x_error, work.trial, cluster, fired, True, continuous, work,
            work.all_sides[number], work.all_orders[number], work.all_floors[number],
        ),
    )  # fmt: skip
