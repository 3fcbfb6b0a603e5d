"""Resolve events of linear modes with a clear outcome: one contact changes its mode, no other guard is near zero.

The first coefficient of each guard after its decreed zeros decides. If all of these are far beyond their rounding
errors, the outcome is that of `hybridsim.engine.events.compiled.resolve_surface`, at a fraction of the cost. Otherwise
nothing is decided.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.events.choice.verdict import decreed_zeros
from hybridsim.engine.events.compiled.scratch import FIRED, ROW, called_by, located
from hybridsim.engine.events.compiled.verdicts import is_continuous
from hybridsim.engine.linear.motion import clear_sign, linear_coefficient, size_of_point
from hybridsim.engine.native.kernels import call, inlined, kernel
from hybridsim.engine.native.loop_hints import put, short_loop
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.programs.modes_index import find_modes

_UNCLEAR = 0


@inlined
def _zeros_of(automata: Any, z: Any, c: int, g: int, is_smooth: bool) -> int:
    """Return how many leading coefficients of a guard are exactly zero when component c enters modes z."""
    is_its = automata.owner[g] == c
    is_holding = z[c] == automata.hold[c]
    return decreed_zeros(automata.place[g] == 0, is_its, is_holding, is_smooth, False, False)


@inlined
def _verdict(
    automata: Any, tapes: Any, lin: Any, k: int, c: int, is_smooth: bool, size: float, work: Any
) -> int:
    """Return 1 if the trial modes of row k certainly persist, -1 if c leaves them, else _UNCLEAR."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        short_loop()
        g = tapes.active[i]
        zeros = _zeros_of(automata, work.trial, c, g, is_smooth)
        sign = clear_sign(lin, k, g, zeros, work.x_after, work.w, size)
        if sign <= 0:
            return sign if automata.owner[g] == c else _UNCLEAR
    return 1


@inlined
def _is_alone(tapes: Any, lin: Any, k: int, fired: int, size: float, work: Any) -> bool:
    """Return whether the fired guard certainly becomes negative and no other guard in row k is near zero."""
    for i in range(tapes.active_start[k], tapes.active_start[k + 1]):
        short_loop()
        g = tapes.active[i]
        sign = clear_sign(lin, k, g, 1 if g == fired else 0, work.x_after, work.w, size)
        if sign == _UNCLEAR or (g == fired and sign > 0):
            return False
    return True


@kernel
def resolve_clear(automata: Any, tapes: Any, lin: Any, state: Any, work: Any) -> bool:
    """Resolve the event in the work space if its outcome is clear; return whether the event was resolved.

    `ROW` of the work space is the row of the modes before the event, and then of those after it. If the event is not
    clear, other parts of the work space may have been overwritten.
    """
    fired, at = work.int_slots[FIRED], located(state, work)
    c = automata.owner[fired]
    hold, now = automata.hold[c], at.z[c]
    if hold < 0 or automata.is_corner[c] or (now != hold and automata.place[fired] > 0):
        return False  # a guard on the load does not move the contact onto its surface
    for i in range(automata.cluster_start[c], automata.cluster_start[c + 1]):
        short_loop()
        d = automata.cluster[i]
        if automata.is_unilateral[d] or (d != c and at.z[d] == automata.hold[d]):
            return False  # such components are decided together
    before = work.int_slots[ROW]
    x, x_error, trial = work.x_after, work.slopes, work.trial
    put(at.x_error, x_error)
    put(at.z, trial)
    trial[c] = hold
    call(called_by(work).project, at.s, at.x, at.p, trial, x)
    size = size_of_point(x, x_error, work.w, work.w_error)
    if not _is_alone(tapes, lin, before, fired, size, work):
        return False
    pin = automata.pin[c, 0]
    if pin >= 0:
        x_error[pin] = UNIT * abs(x[pin])
    found, after, is_smooth = -1, -1, False
    for turn in range(3):
        mode = (hold + turn) % 3  # the holding mode is preferred to the other two
        if mode == now:
            continue
        trial[c] = mode
        k = find_modes(tapes, trial)
        if k < 0:
            return False
        smooth = False
        if now == hold:
            smooth = is_continuous(
                called_by(work), automata, at, x, trial, work.everything, fired, work.jumps
            )
        verdict = _verdict(automata, tapes, lin, k, c, smooth, size, work)
        if verdict == _UNCLEAR or (verdict > 0 and found >= 0):
            return False
        if verdict > 0:
            found, after, is_smooth = mode, k, smooth
            if now != hold:
                break
    if found < 0:
        return False
    state.z[c] = trial[c] = found
    work.int_slots[ROW] = after
    put(x, state.x)
    put(x_error, state.x_error)
    sides, orders, floors = state.sides, state.orders, state.floors
    for i in range(tapes.active_start[before], tapes.active_start[before + 1]):
        short_loop()
        g = tapes.active[i]
        sides[g], orders[g], floors[g] = 1, 0, 0.0
    for i in range(tapes.active_start[after], tapes.active_start[after + 1]):
        short_loop()
        g = tapes.active[i]
        zeros = _zeros_of(automata, trial, c, g, is_smooth)
        sides[g], orders[g], floors[g] = 1, zeros, 0.0
        if zeros > 0:
            floors[g] = linear_coefficient(lin, after, g, 0, x, x_error, work)[1]
    return True
