"""This module finds the first zero of all guards of a mode in one Taylor step."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.roots.first_exit import FOUND, NEVER, OPEN, first_exit
from hybridsim.engine.series.bounded import UNIT


@inlined
def parts_for_exit(scratch: Any) -> Any:
    """Return the scratch arrays of `earliest_exit`."""
    return (scratch.sides, scratch.orders, scratch.floors), (scratch.a, scratch.b, scratch.stack)


@kernel
def earliest_exit(
    tapes: Any, k: int, order: int, h: float, U: Any, monitored: Any, powers: Any, totals: Any, parts: Any,
    bernstein: Any,
) -> tuple[int, int, float]:  # fmt: skip
    """Find the guard that becomes negative first in a step; return FOUND or NEVER, guard and time.

    monitored: rows of U with the series of the mode's guards. powers (order + 1,): h**k. totals: see `reach`.
    parts: see `parts_for_exit`. bernstein: functions for `first_exit`, by the number of leading zeros.
    """
    (sides, orders, floors), (a, b, stack) = parts
    found, best, begin = -1, 1.0, tapes.active_start[k]
    for i in range(monitored.shape[0]):
        g = tapes.active[begin + i]
        r = monitored[i]
        total, first = totals[i], U[r, 0]
        if not total < math.inf:
            return OPEN, g, 0.0
        if total == 0.0 and sides[g] >= 0:
            continue  # identically zero: no side and no change of side
        if sides[g] <= 0:
            return OPEN, g, 0.0
        last = abs(U[r, order]) * powers[order] + abs(U[r, order - 1]) * powers[order - 1]
        error, floor = 2.0 * last + 8.0 * UNIT * total, floors[g]
        if not error + floor < math.inf:  # comparisons with NaN are false, and halving would not end
            return OPEN, g, 0.0
        if orders[g] == 0 and first - (total - abs(first)) > error + floor + 64.0 * UNIT * total:
            continue  # the first term is larger than the sum of the others
        for j in range(order + 1):
            a[j] = U[r, j] * powers[j]
        code = bernstein[orders[g]] if orders[g] < bernstein.shape[0] else 0
        outcome, theta = first_exit(a[: order + 1], error, floor, orders[g], b, stack, code)
        if outcome == OPEN:
            return OPEN, g, theta * h
        if outcome == FOUND and (found < 0 or theta < best):
            found, best = g, theta
    return (FOUND, found, best * h) if found >= 0 else (NEVER, -1, h)
