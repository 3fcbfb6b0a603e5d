"""The event decisions, as pure functions of arrays: they call no model code and know no tolerance.

Each guard comes as Taylor coefficients along the flow of a candidate mode, with running error bounds, and with
the number of leading coefficients that are zero by decree (the set Z of the event contract). A compiled loop
and the Python driver share these functions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.jit import inlined, kernel

FINE, UNDECIDED, LEAVES = 1, 0, -1  # verdicts on a guard or a candidate
NONUNIQUE, NONE = -1, -2  # outcomes of a choice that names no candidate


@inlined
def side_after(series: Any, bounds: Any, decreed: int) -> tuple[int, int]:
    """Sign of a guard just after the instant, and the order that decides it.

    The first coefficient that is beyond its bound decides; those before `decreed` are zero whatever rounding
    made of them. (0, number of coefficients) where none is beyond its bound.
    """
    for k in range(decreed, series.shape[0]):
        if series[k] > bounds[k]:
            return 1, k
        if series[k] < -bounds[k]:
            return -1, k
    return 0, series.shape[0]


@kernel
def side_before(series: Any, bounds: Any, decreed: int) -> tuple[int, int]:
    """Sign of a guard just before the instant: odd orders count with the opposite sign."""
    side, order = side_after(series, bounds, decreed)
    if order % 2 == 1:
        side = -side
    return side, order


@inlined
def open_question(series: Any, bounds: Any, decreed: int) -> bool:
    """Whether a guard without a side is a question of rounding (and not zero identically)."""
    for k in range(decreed, series.shape[0]):
        if series[k] != 0.0 or bounds[k] != 0.0:
            return True
    return False


@inlined
def judge(
    series: Any, bounds: Any, decreed: Any, active: Any, backward: bool, sides: Any, orders: Any
) -> int:
    """Judge the guards of one candidate: LEAVES if any goes negative, UNDECIDED if any is open, else FINE.

    series, bounds (guards, orders); decreed, active, sides, orders (guards,). The sides and orders found are
    written for the root search that follows.
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
        if side < 0:
            verdict = LEAVES
        elif side == 0 and verdict == FINE and open_question(series[g], bounds[g], decreed[g]):
            verdict = UNDECIDED
    return verdict


@kernel
def choose(modes: Any, verdicts: Any, current: Any, holds: Any) -> int:
    """Choose among joint candidates: rows of `modes`, one column for each component of the cluster.

    The current modes stay if admissible (undecided counts: what is open keeps its mode); else, among the
    certainly admissible, most components keep their mode and then most hold; a tie is NONUNIQUE. Candidates
    that are merely undecided are taken only where none is certain. NONE if there is none at all.
    """
    best, best_score, ties = -1, -1, 0
    n = modes.shape[1]
    for c in range(modes.shape[0]):
        if verdicts[c] == LEAVES:
            continue
        kept, held = 0, 0
        for i in range(n):
            kept += modes[c, i] == current[i]
            held += modes[c, i] == holds[i]
        if kept == n:
            return c
        score = held + (n + 1) * (kept + (n + 1) * (verdicts[c] == FINE))
        if score > best_score:
            best, best_score, ties = c, score, 0
        elif score == best_score:
            ties += 1
    if best < 0:
        return NONE
    return NONUNIQUE if ties > 0 else best


@inlined
def decree_orders(
    guards_of: Any, holding: Any, on_surface: Any, released: Any, continuous: bool, fired: Any, decreed: Any
) -> None:
    """Count the leading zeros that the event decrees for the guards of one candidate.

    guards_of (components, widest): active guard numbers, -1 where none; holding[c]: component c holds its surface
    in this candidate; on_surface[c]: its surface is zero; released[c]: c leaves its holding mode here;
    continuous: every change of this candidate leaves the unknowns as they were, so that a released surface starts
    with a zero rate as well; fired[g]: guard g was located at zero and its mode goes on.
    The first guard of a mode beside a surface is that surface.
    """
    for c in range(guards_of.shape[0]):
        for j in range(guards_of.shape[1]):
            g = guards_of[c, j]
            if g < 0:
                continue
            decreed[g] = 1 if fired[g] else 0
            if on_surface[c] and not holding[c] and j == 0:
                decreed[g] = 2 if released[c] and continuous else 1


def joint_candidates(sizes: list[int]) -> np.ndarray:
    """All combinations of modes of a cluster, one row each."""
    grid = np.indices(sizes).reshape(len(sizes), -1).T
    return np.ascontiguousarray(grid, dtype=np.int64)
