"""This module contains kernels of time stepping with impacts: closing gaps, rebounds, and loads."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import call, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.model.parts.impact import ROUNDING

UNILATERAL = 7  # column of the table: whether a surface is a gap
# bounds that grow with a normal force: slip forces above and below, limits of stick
UP, DOWN, MOST, LEAST = range(4)
_STEPPED = 6  # index of the function ``stepped`` among the functions of a step


@kernel
def add_impacts(functions: Any, table: Any, s: float, x: Any, p: Any, scratch: Any) -> None:
    """Compute the rates of the surfaces, the effects of unit forces, and the loads of friction.

    The loads are evaluated at the same point as the forces, see `take_apart`: `scratch.sides` are the modes at x
    with all gaps open, and `scratch.y1` are the surface functions.
    """
    n, m, sides, trial = x.shape[0], table.shape[0], scratch.sides, scratch.trial
    stepped = functions[_STEPPED]
    call(stepped, s, x, p, sides, scratch.rows)
    for k in range(m):
        scratch.u[k] = scratch.rows[k]
        for i in range(n):
            scratch.S[k, i] = scratch.rows[m + k * n + i]
            scratch.B[k, i] = scratch.rows[m + (m + k) * n + i]
        is_above = scratch.y1[k] >= 0.0
        _store_loads(scratch, n, m, k, UP if is_above else DOWN)
    for k in range(m):
        if table[k, UNILATERAL] != 0:
            continue
        c, is_above = table[k, 0], scratch.y1[k] >= 0.0
        put(sides, trial)
        trial[c] = table[k, 3]
        call(functions[4], s, x, p, trial, scratch.on)
        call(stepped, s, scratch.on, p, trial, scratch.rows)
        _store_loads(scratch, n, m, k, MOST)
        _store_loads(scratch, n, m, k, LEAST)
        trial[c] = table[k, 2 if is_above else 1]
        call(stepped, s, scratch.on, p, trial, scratch.rows)
        _store_loads(scratch, n, m, k, DOWN if is_above else UP)


@kernel
def _store_loads(scratch: Any, n: int, m: int, k: int, bound: int) -> None:
    first = m + 2 * m * n + (bound * m + k) * m
    for d in range(m):
        scratch.loads[bound, k, d] = scratch.rows[first + d]


@kernel
def approach(restitutions: Any, table: Any, s: float, h: float, x: Any, p: Any, z: Any, scratch: Any) -> bool:
    """Find the gaps that may exert a force in a step, and their rebound speeds; report an invalid restitution.

    A gap takes part if it is closed, or would be closed by the middle of the step at its present rate. A
    closed gap has no approach speed, because rounding must not make it rebound.
    """
    n = x.shape[0]
    for i in range(n):
        scratch.approach[i] = x[i]
    for k in range(table.shape[0]):
        is_gap, is_closed = table[k, UNILATERAL] != 0, z[table[k, 0]] == table[k, 3]
        speed = max(-scratch.u[k], 0.0) if is_gap and not is_closed else 0.0
        scratch.approach[n + k] = speed
        takes_part = is_gap and (is_closed or scratch.y1[k] + 0.5 * h * scratch.u[k] <= 0.0)
        scratch.active[k] = 1 if takes_part else 0
    call(restitutions, s, scratch.approach, p, scratch.sides, scratch.restitution)
    for k in range(table.shape[0]):
        scratch.rebound[k] = 0.0
        if scratch.active[k] != 0:
            e = scratch.restitution[k]
            if not -ROUNDING <= e <= 1.0 + ROUNDING:
                return False
            scratch.rebound[k] = min(max(e, 0.0), 1.0) * scratch.approach[n + k]
    return True


@kernel
def gap_rates(table: Any, X: Any, free: Any, scratch: Any) -> None:
    """Compute the rates of the surfaces without forces, and the effects of unit forces on the rates.

    The rates are linearised about X, the last iterate, and are exact when the iteration ends.
    """
    for k in range(table.shape[0]):
        total = scratch.u[k]
        for i in range(X.shape[0]):
            total += scratch.S[k, i] * (free[i] - X[i])
        scratch.y[k] = total
        for j in range(table.shape[0]):
            total = 0.0
            for i in range(X.shape[0]):
                total += scratch.S[k, i] * scratch.w[j, i]
            scratch.G[k, j] = total
