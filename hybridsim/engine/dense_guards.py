"""Guards along a polynomial dense output: each gets its own series, stretch by stretch, and its first exit."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.first_exit import FOUND, NEVER, OPEN
from hybridsim.engine.jit import kernel
from hybridsim.engine.leap import earliest_exit, holds
from hybridsim.engine.taylor import advance, reach

_SHORTER = 0.25
_LONGER = 4.0
_SHORTEST = 2.0**-40  # of a step: a stretch on which a guard's series says nothing


@kernel
def shifted(coefficients: Any, q: float, states: Any, order: int, V: Any) -> None:
    """Polynomials about a point q of theirs into the registers of the states; (n, m) coefficients, zeros above."""
    n, m = coefficients.shape
    for i in range(n):
        r = states[i]
        for j in range(m):
            V[r, j] = coefficients[i, j]
        for j in range(m, order + 1):
            V[r, j] = 0.0
        if q != 0.0:
            for j in range(m - 1):
                for k in range(m - 2, j - 1, -1):
                    V[r, k] += q * V[r, k + 1]


@kernel
def likely_reach(V: Any, watched: Any, order: int, rtol: float) -> float:
    """A length beyond that over which the series of some functions hold, to look for that from."""
    longest = math.inf
    for j in range(watched.shape[0]):
        r = watched[j]
        for k in (0, 1):
            if V[r, k] != 0.0 and V[r, order] != 0.0:
                w = (rtol * abs(V[r, k] / V[r, order])) ** (1.0 / (order - k))
                longest = min(longest, _LONGER * w)
    return longest


@kernel
def first_guard(
    tapes: Any,
    k: int,
    rows: Any,
    inputs: Any,
    is_linear: bool,
    order: int,
    rtol: float,
    s: float,
    d: float,
    polynomial: Any,
    watched: Any,
    atol: Any,
    sides: Any,
    orders: Any,
    floors: Any,
    V: Any,
    W: Any,
    x: Any,
    a: Any,
    b: Any,
    stack: Any,
) -> tuple[int, int, float]:
    """The guard of mode row k that first goes negative on a step: (FOUND, guard, time from s), (NEVER, -1, d), OPEN.

    polynomial (n, m): the states in powers of the time from s. rows: what the guards need of the tape, whose constants
    are in V and W; is_linear: guards are linear in states and time, so that their series are exact. sides, orders,
    floors: of the guards just after s, as in `earliest_exit`; moved on. The series of a guard serves as far as its last
    terms stay below rtol of its largest and it meets the guard at its end; there the next stretch begins.
    """
    time, states = inputs.time[0], inputs.states
    none = states[:0]
    q = 0.0
    while q < d:
        shifted(polynomial, q, states, order, V)
        if time >= 0:
            V[time, 0], V[time, 1] = s + q, 1.0
        for j in range(order + 1):
            advance(rows, V, j)
        left = d - q
        w = left
        if not is_linear:
            w = reach(V, none, watched, order, rtol, atol, min(left, likely_reach(V, watched, order, rtol)))
        if not w > _SHORTEST * d:
            return OPEN, -1, q
        outcome, g, at = earliest_exit(tapes, k, order, w, sides, orders, floors, V, a, b, stack)
        if outcome == OPEN:
            return OPEN, g, q + at
        while not is_linear:
            for i in range(states.shape[0]):
                W[states[i], 0] = V[states[i], order]
                for j in range(order - 1, -1, -1):
                    W[states[i], 0] = W[states[i], 0] * at + V[states[i], j]
            if holds(rows, (time, none, none), order, s + q, x, x, at, rtol, atol, watched, V, W):
                break
            at, outcome = _SHORTER * at, NEVER
            if not at > _SHORTEST * d:
                return OPEN, g, q
        if outcome == FOUND:
            return FOUND, g, q + at
        q = d if at >= left else q + at
        sides[:], orders[:], floors[:] = 1, 0, 0.0
    return NEVER, -1, d
