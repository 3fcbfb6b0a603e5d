"""Resolve clear events of linear modes: one contact changes its mode, and no other guard is near zero.

The first coefficient of each guard after its decreed zeros decides. If all of these are far beyond their rounding
errors, the outcome is that of `hybridsim.engine.events.compiled.resolve_surface`, at a fraction of the cost. Otherwise
nothing is decided.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.choice.joint_choice import NO_SCORE, NONE, is_settled, joint_choice, rank_of
from hybridsim.engine.events.choice.verdict import FINE, NO_SIDE, UNDECIDED, verdict_with, zeros_of_surface
from hybridsim.engine.events.compiled.guard_series import is_continuous
from hybridsim.engine.events.compiled.scratch import ROW, called_by, located, row_of
from hybridsim.engine.linear.guard_coefficients import linear_coefficient, measure_point, rough_side
from hybridsim.engine.native.kernels import call, inlined, kernel
from hybridsim.engine.native.loop_hints import index, put, short_loop
from hybridsim.engine.series.bounded import UNIT


@inlined
def _zeros_of(automata: Any, c: int, g: int, zeros: int) -> int:
    """Return the number of leading zero coefficients of a guard: `zeros` for the surface of component `c`, else 0."""
    return zeros if automata.place[g] == 0 and automata.owner[g] == c else 0


@inlined
def _clear_verdict(automata: Any, tapes: Any, lin: Any, k: int, c: int, zeros: int, work: Any) -> int:
    """Return the verdict on the trial modes of row `k` if the verdict is clear, otherwise UNDECIDED."""
    found = FINE
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        short_loop()
        g = index(tapes.active[i])
        side = rough_side(lin, k, g, _zeros_of(automata, c, g, zeros), work)
        found = verdict_with(found, side, side == 0)
        if found != FINE:
            return found if automata.owner[g] == c else UNDECIDED
    return found


@inlined
def _is_alone(tapes: Any, lin: Any, k: int, fired: int, work: Any) -> bool:
    """Return whether the fired guard certainly becomes negative and no other guard is near zero."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        short_loop()
        g = index(tapes.active[i])
        side = rough_side(lin, k, g, 1 if g == fired else 0, work)
        if side == 0 or (g == fired and side > 0):
            return False
    return True


@kernel
def resolve_clear(automata: Any, tapes: Any, lin: Any, state: Any, work: Any, fired: int) -> bool:
    """Resolve the event in the work space if its outcome is clear; return whether it was resolved.

    `ROW` of the work space is the row of the modes before the event, and then of those after it. If the event is not
    clear, other parts of the work space may have been overwritten.
    """
    fired = index(fired)
    at, c = located(state, work), index(automata.owner[fired])
    hold, now = automata.hold[c], at.z[c]
    if hold < 0 or automata.is_corner[c] or (now != hold and automata.place[fired] > 0):
        return False  # a guard on the load does not move the contact onto its surface
    for i in range(automata.cluster_start[c], automata.cluster_start[c + 1]):
        short_loop()
        d = index(automata.cluster[i])
        if (d == c and automata.is_unilateral[d]) or (d != c and at.z[d] == automata.hold[d]):
            return False  # such components are decided together
    before = index(work.int_slots[ROW])
    x, x_error, trial = work.x_after, work.slopes, work.trial
    put(at.x_error, x_error)
    put(at.z, trial)
    trial[c] = hold
    call(called_by(work).project, at.s, at.x, at.p, trial, x)
    measure_point(lin, work)
    if not _is_alone(tapes, lin, before, fired, work):
        return False
    pin = automata.pin[c, 0]
    if pin >= 0:
        x_error[index(pin)] = UNIT * abs(x[index(pin)])
    work.on_surface[c] = True
    if now == hold:
        put(at.z, work.before)
        work.released_to[c] = automata.place[fired]
    chosen, score, after, zeros_after = NONE, NO_SCORE, -1, 0
    for turn in range(3):
        mode = (hold + turn) % 3
        rank = rank_of(0, 1 if mode == hold else 0, 1)
        if mode == now or is_settled(score, rank, 1):
            continue
        trial[c] = mode
        k = row_of(tapes, trial, work)
        if k < 0:
            return False
        k = index(k)
        smooth = now == hold and is_continuous(automata, at, trial, work.everything, work)
        zeros = zeros_of_surface(automata, work, trial, c, smooth)
        verdict = _clear_verdict(automata, tapes, lin, k, c, zeros, work)
        if verdict == UNDECIDED:
            return False
        chosen, score = joint_choice(chosen, score, mode, rank, verdict, 1)
        if verdict == FINE:
            after, zeros_after = k, zeros
    if chosen < 0:
        return False
    after = index(after)
    state.z[c] = trial[c] = chosen
    work.int_slots[ROW] = after
    put(x, state.x)
    put(x_error, state.x_error)
    sides, orders, floors = state.sides, state.orders, state.floors
    for i in range(tapes.active_start[before], tapes.active_start[before + 1]):
        short_loop()
        g = index(tapes.active[i])
        sides[g], orders[g], floors[g] = 1, 0, 0.0
    for i in range(tapes.active_start[after], tapes.active_start[after + 1]):
        short_loop()
        g = index(tapes.active[i])
        zeros = _zeros_of(automata, c, g, zeros_after)
        sides[g], orders[g], floors[g] = 1, zeros, 0.0
        if zeros > 0:
            floors[g] = linear_coefficient(lin, after, g, 0, x, x_error, work)[1]
    work.released_to[c] = NO_SIDE
    return True
