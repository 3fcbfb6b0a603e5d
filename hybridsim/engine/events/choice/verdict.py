"""The event decisions as pure functions of arrays, without model code and without tolerances.

Each guard is given by Taylor coefficients along the flow of a candidate mode, with running error bounds, and by the
number of leading coefficients that are zero by decree (the set Z of the event contract). Compiled loops and the Python
driver share these functions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel

FINE, UNDECIDED, LEAVES = 1, 0, -1  # verdicts on a guard or a candidate
NONUNIQUE, NONE = -1, -2  # outcomes of a choice that names no candidate


@inlined
def side_after(series: Any, bounds: Any, decreed: int) -> tuple[int, int]:
    """Return the sign of a guard just after the instant, and the order that decides it.

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
    """Return the sign of a guard just before the instant: odd orders count with the opposite sign."""
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
def verdict_with(verdict: int, series: Any, bounds: Any, decreed: int, side: int) -> int:
    """Combine the verdict on a candidate with the sign of one more of its guards just after the event."""
    if side < 0:
        return LEAVES
    if side == 0 and verdict == FINE and open_question(series, bounds, decreed):
        return UNDECIDED
    return verdict


@inlined
def guard_verdict(
    series: Any, bounds: Any, decreed: Any, active: Any, backward: bool, sides: Any, orders: Any
) -> int:
    """Judge the guards of one candidate: LEAVES if any becomes negative, UNDECIDED if any is open, else FINE.

    series, bounds (guards, orders); decreed, active, sides, orders (guards,). The sides and orders found are written
    for the root search that follows.
    """
    verdict = FINE
    for g in range(series.shape[0]):
        if not active[g]:
            sides[g], orders[g] = 1, 0
            continue
        if backward:
            side, order = side_before(series[g], bounds[g], decreed[g])
        else:
            side, order = side_after(series[g], bounds[g], decreed[g])
        sides[g], orders[g] = side, order
        verdict = verdict_with(verdict, series[g], bounds[g], decreed[g], side)
    return verdict


@inlined
def preference(modes: Any, current: Any, holds: Any, n: int) -> int:
    """Return the rank of a joint candidate: unchanged modes, then holding ones; >= n*(n + 1) if none changes."""
    unchanged, held = 0, 0
    for i in range(n):
        unchanged += modes[i] == current[i]
        held += modes[i] == holds[i]
    return held + (n + 1) * unchanged


@inlined
def choose(modes: Any, verdicts: Any, current: Any, holds: Any) -> int:
    """Choose among joint candidates, given as rows of `modes` with one column for each component of the cluster.

    The current modes stay if they are admissible or undecided. Otherwise the certainly admissible candidate with the
    highest `preference` is chosen, and a tie is NONUNIQUE. Undecided candidates are chosen only if no candidate is
    certain. The result is NONE if no candidate is left.
    """
    best, best_score, equal_best = -1, -1, 0
    n = modes.shape[1]
    for c in range(modes.shape[0]):
        if verdicts[c] == LEAVES:
            continue
        rank = preference(modes[c], current, holds, n)
        if rank >= n * (n + 1):
            return c
        score = rank + (n + 1) * (n + 1) * (verdicts[c] == FINE)
        if score > best_score:
            best, best_score, equal_best = c, score, 0
        elif score == best_score:
            equal_best += 1
    if best < 0:
        return NONE
    return NONUNIQUE if equal_best > 0 else best


@inlined
def decreed_zeros(
    is_first: bool, is_on: bool, is_holding: bool, is_smooth: bool, is_fired: bool, is_gap: bool
) -> int:
    """Return the number of leading coefficients of a guard that the event decrees to be zero in a candidate mode.

    is_first: the guard is the first of a mode beside a surface, which is that surface. is_on: the surface is zero.
    is_holding: the candidate holds the surface. is_smooth: the component is released and all unknowns stay unchanged,
    so that the rate of the surface is zero as well. is_gap: the surface is a gap, which is on only if its rate is zero
    too; this adds one zero. is_fired: the guard was located at zero, its mode continues, and `is_decreed` is true.
    """
    if is_first and is_on and not is_holding:
        return (2 if is_smooth else 1) + (1 if is_gap else 0)
    return 1 if is_fired else 0


@inlined
def is_decreed(is_holding: bool, continuous: bool) -> bool:
    """Return whether a guard that was located at zero is zero in a candidate in which its mode continues.

    Guards of a holding mode are limits of its unknown. A jump of another unknown may have moved it off the limit.
    """
    return continuous or not is_holding


@kernel
def decree_orders(
    guards_of: Any,
    holding: Any,
    on_surface: Any,
    released: Any,
    continuous: bool,
    fired: Any,
    gaps: Any,
    decreed: Any,
) -> None:
    """Count the leading zeros that the event decrees for the guards of one candidate; see `decreed_zeros`.

    guards_of (components, widest): active guard numbers, -1 for none. holding[c]: component c holds its surface in this
    candidate. on_surface[c]: its surface is zero. released[c]: c leaves its holding mode here. continuous: every change
    of this candidate leaves the unknowns unchanged. fired[g]: guard g was located at zero and its mode continues.
    gaps[c]: the surface of c is a gap.
    """
    for c in range(guards_of.shape[0]):
        for j in range(guards_of.shape[1]):
            g = guards_of[c, j]
            if g >= 0:
                smooth, is_zero = released[c] and continuous, fired[g] and is_decreed(holding[c], continuous)
                decreed[g] = decreed_zeros(j == 0, on_surface[c], holding[c], smooth, is_zero, gaps[c])


def joint_candidates(sizes: Iterable[int]) -> np.ndarray:
    """Return all combinations of modes of a cluster, one row each. The array must not be modified."""
    return _joint(tuple(sizes))


@cache
def _joint(sizes: tuple[int, ...]) -> np.ndarray:
    grid = np.indices(sizes).reshape(len(sizes), -1).T
    return np.ascontiguousarray(grid, dtype=np.int64)
