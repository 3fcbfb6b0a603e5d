"""Judge one combination of modes by the signs of its guards just after an event, without tolerances.

Each guard is given by Taylor coefficients along the flow of these modes, with running error bounds, and by the number
of leading coefficients that are zero by decree (the set Z of the event contract). The general loop and compiled loops
call the same kernel. It calls no model code.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.linear.guard_coefficients import linear_coefficient, linear_series
from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.loop_hints import index
from hybridsim.engine.series.bounded import ORDER

FINE, UNDECIDED, LEAVES = 1, 0, -1  # verdicts on a guard or a candidate
UNCHANGED, RELEASED, SWITCHED = range(3)  # how components changed their modes: `kind_of_change`
NO_SIDE = -1  # the component was not released at the event


class JudgedEvent(NamedTuple):
    """The data of an event that a verdict reads and writes; `EventScratch` has the same fields.

    Rows of all_sides, all_orders and all_floors belong to the candidates of a joint choice.
    """

    before: np.ndarray  # modes (C,) just before the event; -1 for a component without a mode
    now: np.ndarray  # modes (C,) that have been decided so far
    is_zero: np.ndarray  # mask (G,) of guards that were located at zero
    on_surface: np.ndarray  # mask (C,) of components whose surfaces are zero
    released_to: np.ndarray  # located release of each component (C,): 0 to above, 1 to below, or NO_SIDE
    judged: np.ndarray  # series of the guards and their bounds (2, G, 4)
    decreed: np.ndarray  # number (G,) of leading coefficients that are zero by decree
    all_sides: np.ndarray  # sides (., G) of the guards just after the event
    all_orders: np.ndarray  # their leading zeros
    all_floors: np.ndarray  # error bounds of guards that start from zero


@inlined
def side_after(series: Any, bounds: Any, decreed: int) -> tuple[int, int]:
    """Return the sign of a guard just after an instant, and the order of the derivative that decides it.

    The first coefficient beyond its bound decides. Coefficients before `decreed` are zero, whatever rounding made of
    them. The result is (0, number of coefficients) if no coefficient is beyond its bound, or if one before it is nan.
    The logarithm of a negative number, for example, is nan but has a finite slope.
    """
    for k in range(decreed, series.shape[0]):
        if math.isnan(series[k]):
            break
        if series[k] > bounds[k]:
            return 1, k
        if series[k] < -bounds[k]:
            return -1, k
    return 0, series.shape[0]


@kernel
def side_before(series: Any, bounds: Any, decreed: int) -> tuple[int, int]:
    """Return the sign of a guard just before an instant, by the first derivative that is not zero."""
    side, order = side_after(series, bounds, decreed)
    if order % 2 == 1:
        side = -side
    return side, order


@inlined
def open_question(series: Any, bounds: Any, decreed: int) -> bool:
    """Return whether rounding hides the sign of a guard that is not identically zero."""
    for k in range(decreed, series.shape[0]):
        if series[k] != 0.0 or bounds[k] != 0.0:
            return True
    return False


@inlined
def is_release(automata: Any, event: Any, z: Any, c: int) -> bool:
    """Return whether a component leaves its holding mode by a guard that was located at zero, in the modes `z`."""
    return z[c] != automata.hold[c] and event.released_to[c] == (0 if z[c] == automata.above[c] else 1)


@inlined
def kind_of_change(automata: Any, event: Any, z: Any, members: Any) -> int:
    """Return whether components changed their modes, and whether each of the changes is a release."""
    kind = UNCHANGED
    for i in range(members.shape[0]):
        c = index(members[i])
        if z[c] == event.before[c] or automata.is_corner[c]:
            continue
        if not is_release(automata, event, z, c):
            return SWITCHED
        kind = RELEASED
    return kind


@inlined
def is_smooth(automata: Any, event: Any, z: Any, members: Any, jumps: Any) -> bool:
    """Return whether a release leaves all unknowns continuous; `jumps` contains the jumps on release."""
    for i in range(members.shape[0]):
        c = index(members[i])
        jump = 2 * automata.surface[c] + (0 if z[c] == automata.above[c] else 1)
        if z[c] != event.before[c] and not automata.is_corner[c] and jumps[jump] != 0.0:
            return False
    return True


@inlined
def zeros_of_surface(automata: Any, event: Any, z: Any, c: int, continuous: bool) -> int:
    """Return how many leading Taylor coefficients of a component's surface the event makes exactly zero."""
    if not event.on_surface[c] or z[c] == automata.hold[c]:
        return 0
    is_rate_zero = continuous and is_release(automata, event, z, c)
    return (2 if is_rate_zero else 1) + (1 if automata.is_unilateral[c] else 0)


@inlined
def decreed_zeros(automata: Any, event: Any, z: Any, c: int, j: int, g: int, continuous: bool) -> int:
    """Return how many leading Taylor coefficients of a guard are exactly zero because of the event.

    g: number of the guard; c, j: its component, and its index in the mode.

    The first guard of a mode beside a surface is that surface. On the surface it is zero. So is its rate if the
    component is released and all unknowns stay unchanged (`continuous`). A gap counts as zero only if its rate is zero
    too; this adds one zero. Another guard that was located at zero is zero while its mode continues. Guards of a
    holding mode are limits of its unknown; a jump of another unknown may have moved it off the limit.
    """
    zeros = zeros_of_surface(automata, event, z, c, continuous) if j == 0 else 0
    if zeros > 0:
        return zeros
    is_located = event.is_zero[g] and z[c] == event.now[c]
    return 1 if is_located and (continuous or z[c] != automata.hold[c]) else 0


@inlined
def verdict_with(found: int, side: int, is_open: bool) -> int:
    """Combine the verdict on a candidate with the sign of one more guard."""
    if side < 0:
        return LEAVES
    return UNDECIDED if is_open and found == FINE else found


@kernel
def verdict(
    automata: Any,
    lin: Any,
    k: int,
    event: Any,
    z: Any,
    members: Any,
    continuous: bool,
    is_whole: bool,
    row: int,
) -> int:
    """Judge the guards in the modes `z`: LEAVES if any becomes negative, UNDECIDED if any sign is unknown.

    Otherwise the result is FINE. lin, k: tables of linear modes and the row of z in them; None if the series of all
    guards are in `judged`. continuous: whether all unknowns stay unchanged. is_whole: judge all guards even if one
    becomes negative. Sides, orders and floors of the judged guards are written to this row of the event.
    """
    sides, orders, floors = event.all_sides[row], event.all_orders[row], event.all_floors[row]
    found = FINE
    for i in range(members.shape[0]):
        c = index(members[i])
        for j in range(automata.guards_of.shape[2]):
            g = automata.guards_of[c, z[c], j]
            if g < 0:
                continue
            g = index(g)
            zeros = decreed_zeros(automata, event, z, c, j, g, continuous)
            if lin is not None:
                linear_series(lin, k, g, zeros, event)
            values, bounds = event.judged[0, g], event.judged[1, g]
            side, order = side_after(values, bounds, zeros)
            event.decreed[g], sides[g] = zeros, side
            found = verdict_with(found, side, side == 0 and open_question(values, bounds, zeros))
            if found == LEAVES and not is_whole:
                return LEAVES
            orders[g], floors[g] = order if order <= ORDER else 0, 0.0
            if order > 0:
                floors[g] = bounds[0] if zeros == 0 else value_of(lin, k, g, event)[1]
    return found


@inlined
def value_of(lin: Any, k: int, g: int, event: Any) -> tuple[float, float]:
    """Return the value of a guard and its error bound."""
    if lin is not None and lin.counts.shape[0] > 0:
        return linear_coefficient(lin, k, g, 0, event.x_after, event.slopes, event)
    return event.judged[0, g, 0], event.judged[1, g, 0]
