"""This module contains kernels of time stepping: one implicit step and its contact forces."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import call, inlined, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.system.system import System
from hybridsim.integrators.fixed_step.kernels import (
    BOUND,
    CONTINUES,
    FULL,
    NOT_FINITE,
    RESTED,
    RESTITUTION,
    brought_to_zero,
    passed,
)
from hybridsim.integrators.fixed_step.moreau_impacts import (
    DOWN,
    LEAST,
    MOST,
    UNILATERAL,
    UP,
    add_impacts,
    approach,
    gap_rates,
)
from hybridsim.integrators.rosenbrock.step import factor, solve

_NUDGE = 2.0**-26  # relative step of a difference quotient: half of the digits
_RENEWED = 4  # iterations after which Newton's method gets a new matrix
# Sweeps after which only kinetic friction can stop a slipping contact, because contacts with larger static friction
# might alternate indefinitely.
_PATIENCE = 50
_SWEEPS = 10_000  # most projected Gauss-Seidel sweeps; a single contact needs one
_HOLD, _ABOVE, _BELOW = 0, 1, 2  # meanings of a force
_CONVERGED, _UNSETTLED, _AMISS = range(3)  # how a step ended


class Scratch(NamedTuple):
    """Scratch arrays for n states, m surfaces, C components, Q monitored quantities and G guards."""

    sides: np.ndarray
    trial: np.ndarray
    a: np.ndarray  # (n,) rates without the forces, at the end of the step
    a_old: np.ndarray  # (n,) rates without the forces, at the start of the step
    on: np.ndarray
    rates: np.ndarray
    nudged: np.ndarray
    B: np.ndarray  # (m, n) effect of unit forces on the rates
    w: np.ndarray  # (m, n) effect of unit forces on the state at the end of the step
    quantities: np.ndarray
    guards: np.ndarray
    up: np.ndarray  # (m,) slip force above
    down: np.ndarray  # (m,) slip force below (negative)
    most: np.ndarray  # (m,) upper limit of the holding force
    least: np.ndarray  # (m,) lower limit of the holding force
    M: np.ndarray
    pivots: np.ndarray
    X: np.ndarray
    free: np.ndarray
    y: np.ndarray  # (m,) surface functions at the end of the step, without forces
    y1: np.ndarray
    G: np.ndarray  # (m, m) effect of unit forces on the surface functions at the end of the step
    force: np.ndarray  # (m,) solution
    meaning: np.ndarray  # (m,) hold, above or below
    sizes: np.ndarray
    monitors: np.ndarray
    monitors_after: np.ndarray
    u: np.ndarray  # (m,) rates of gaps and relative velocities
    S: np.ndarray  # (m, n) gradients of u
    rows: np.ndarray  # results of the function ``stepped``
    loads: np.ndarray  # (4, m, m) growth of the bounds with normal forces
    active: np.ndarray  # (m,) gaps that may push
    rebound: np.ndarray  # (m,) least rate of separation
    approach: np.ndarray  # (n + m,) arguments of the restitutions: states and approach speeds
    restitution: np.ndarray
    evaluated: np.ndarray  # (m, n) states that a closed gap evaluates


def scratch_for(system: System, surfaces: int, sizes: np.ndarray, evaluated: np.ndarray) -> Any:
    """Allocate the scratch arrays of one run.

    sizes (n,): sizes of the states, for difference quotients and convergence tests. evaluated (m, n): see
    `Scratch`.
    """
    n, components, quantities = system.n, len(system.automata), len(system.quantities)
    guards, monitors = system.guard_count, len(system.monitor_names)
    none = max(surfaces, 1)  # compiled functions write at least one element
    of_components = {name: np.zeros(components, dtype=np.int64) for name in ("sides", "trial")}
    of_states = {name: np.zeros(n) for name in ("a", "a_old", "on", "rates", "nudged", "X", "free")}
    names = ("up", "down", "most", "least", "y", "y1", "force", "u", "rebound", "restitution")
    of_surfaces = {name: np.zeros(none) for name in names}
    return packed(
        Scratch(
            **of_components, **of_states, **of_surfaces, B=np.zeros((none, n)), w=np.zeros((none, n)),
            quantities=np.zeros(max(quantities, 1)), guards=np.zeros(max(guards, 1)), M=np.zeros((n, n)),
            pivots=np.zeros(n, dtype=np.int64), G=np.zeros((none, none)), meaning=np.zeros(none, dtype=np.int64),
            sizes=np.array(sizes, dtype=float), monitors=np.zeros(max(monitors, 1)),
            monitors_after=np.zeros(max(monitors, 1)), S=np.zeros((none, n)), loads=np.zeros((4, none, none)),
            rows=np.zeros(none * (1 + 2 * n + 4 * none)), active=np.zeros(none, dtype=np.int64),
            approach=np.zeros(n + none), evaluated=np.array(evaluated, dtype=np.int64).reshape(len(evaluated), n),
        )
    )  # fmt: skip


@kernel
def take_apart(
    functions: Any, table: Any, s: float, x: Any, p: Any, z: Any, scratch: Any, counts: Any, has_impacts: bool
) -> None:
    """Compute the rates without contact forces, the effect of each unit force, and the force limits.

    The rates are linear in the forces: the difference of the rates above and below a surface is the effect of
    its force times the difference of the two forces. A slip force is evaluated at x if the surface is on its
    side, else on the surface, because a law may be undefined beyond it. functions: see `moreau_step`. table:
    as in `surface_table`, plus the quantity and whether it is a gap. `scratch.sides` receives the modes at x
    with all gaps open: normal forces are separated, too.
    """
    sides, trial, a = scratch.sides, scratch.trial, scratch.a
    on, rates, q = scratch.on, scratch.rates, scratch.quantities
    put(z, sides)
    for k in range(table.shape[0]):
        sides[table[k, 0]] = table[k, _ABOVE]
    if table.shape[0] > 0:
        call(functions[3], s, x, p, sides, scratch.y1)
    for k in range(table.shape[0]):
        is_above = scratch.y1[k] >= 0.0 or table[k, UNILATERAL] != 0
        sides[table[k, 0]] = table[k, _ABOVE if is_above else _BELOW]
    counts[0] += 1 + 2 * table.shape[0]
    counts[1] += table.shape[0]
    for k in range(table.shape[0]):
        if table[k, UNILATERAL] != 0:
            continue
        c, force = table[k, 0], table[k, 6]
        put(sides, trial)
        trial[c] = table[k, 3]
        call(functions[4], s, x, p, trial, on)
        call(functions[2], s, on, p, trial, q)
        call(functions[1], s, on, p, trial, scratch.guards)
        scratch.most[k] = scratch.guards[table[k, 4]] + q[force]
        scratch.least[k] = q[force] - scratch.guards[table[k, 5]]
        trial[c] = table[k, _ABOVE]
        call(functions[0], s, on, p, trial, a)
        call(functions[2], s, on, p, trial, q)
        scratch.up[k] = q[force]
        trial[c] = table[k, _BELOW]
        call(functions[0], s, on, p, trial, rates)
        call(functions[2], s, on, p, trial, q)
        scratch.down[k] = q[force]
        difference = scratch.up[k] - scratch.down[k]
        for i in range(x.shape[0]):
            scratch.B[k, i] = (a[i] - rates[i]) / difference if difference != 0.0 else 0.0
    if has_impacts:
        add_impacts(functions, table, s, x, p, scratch)
    call(functions[0], s, x, p, sides, a)
    if table.shape[0] > 0:
        call(functions[2], s, x, p, sides, q)
    for k in range(table.shape[0]):
        if scratch.y1[k] >= 0.0:
            scratch.up[k] = q[table[k, 6]]
        else:
            scratch.down[k] = q[table[k, 6]]
        for i in range(x.shape[0]):
            a[i] -= scratch.B[k, i] * q[table[k, 6]]


@inlined
def implicit_matrix(
    flow: Any, theta: float, h: float, s: float, x: Any, p: Any, scratch: Any, counts: Any
) -> bool:
    """Factorise the matrix I - h theta da/dx, with difference quotients for the derivatives."""
    n = x.shape[0]
    put(x, scratch.nudged)
    call(flow, s, x, p, scratch.sides, scratch.rates)
    for i in range(n):
        scratch.free[i] = scratch.rates[i]
    for j in range(n):
        nudge = _NUDGE * max(abs(x[j]), scratch.sizes[j])
        for way in (1.0, -1.0):  # a law may be undefined on the other side of rest
            scratch.nudged[j] = x[j] + way * nudge
            step = scratch.nudged[j] - x[j]
            call(flow, s, scratch.nudged, p, scratch.sides, scratch.rates)
            if math.isfinite(np.sum(scratch.rates)):
                break
        for i in range(n):
            scratch.M[i, j] = -h * theta * (scratch.rates[i] - scratch.free[i]) / step
        scratch.M[j, j] += 1.0
        scratch.nudged[j] = x[j]
    counts[0] += n + 1
    return factor(scratch.M, scratch.pivots)


@inlined
def forces(table: Any, scratch: Any, m: int, tolerance: float, has_impacts: bool) -> bool:
    """Compute the forces at the end of a step by projected Gauss-Seidel; return whether the forces converged.

    Each force holds its surface at zero if its limits allow; otherwise it is the slip force. The force of a
    gap is the smallest one with the required rebound.
    """
    for sweep in range(_SWEEPS):
        change = scale = 0.0
        for k in range(m):
            y = scratch.y[k]
            for j in range(m):
                if j != k:
                    y += scratch.G[k, j] * scratch.force[j]
            own, meaning = scratch.G[k, k], _HOLD
            up, down, most, least = scratch.up[k], scratch.down[k], scratch.most[k], scratch.least[k]
            if has_impacts:
                for d in range(m):
                    up += scratch.loads[UP, k, d] * scratch.force[d]
                    down += scratch.loads[DOWN, k, d] * scratch.force[d]
                    most += scratch.loads[MOST, k, d] * scratch.force[d]
                    least += scratch.loads[LEAST, k, d] * scratch.force[d]
            if has_impacts and table[k, UNILATERAL] != 0:
                force = (scratch.rebound[k] - y) / own if scratch.active[k] != 0 and own > 0.0 else 0.0
                force = max(force, 0.0)
                meaning = _HOLD if force > 0.0 and scratch.rebound[k] == 0.0 else _ABOVE
                up = force
            else:
                force = -y / own if own < 0.0 else 0.0
                if sweep > _PATIENCE and scratch.meaning[k] != _HOLD:
                    most, least = min(most, up), max(least, down)
                if force > most or (own >= 0.0 and y > 0.0):
                    force, meaning = up, _ABOVE
                elif force < least or (own >= 0.0 and y < 0.0):
                    force, meaning = down, _BELOW
            scratch.meaning[k] = meaning
            change = max(change, abs(force - scratch.force[k]))
            scale = max(scale, max(abs(up), abs(down)))
            scratch.force[k] = force
        if not change > tolerance * scale:
            return True
        if not change < math.inf:
            return False
    return False


@kernel
def moreau_step(
    functions: Any,
    settings: Any,
    table: Any,
    s: float,
    h: float,
    x: Any,
    p: Any,
    z: Any,
    out: Any,
    scratch: Any,
    counts: Any,
) -> int:
    """Take one step of the theta scheme, implicit in the forces; write the modes and return the outcome.

            X = x + h (theta a(s + h, X) + (1 - theta) a(s, x)) + h sum_k B_k f_k,   f_k in the law of k at
            y_k(X)

    and for gaps f_k >= 0, y_k(X) >= rebound_k, one of the two with equality. functions: flow, guards,
    quantities, surfaces, project, monitors; with impacts stepped and restitutions. settings: theta,
    tolerance, iterations, whether there are impacts. counts: rates, guards.
    """
    theta, tolerance, iterations, has_impacts = settings
    n, m, X, free = x.shape[0], table.shape[0], scratch.X, scratch.free
    take_apart(functions, table, s, x, p, z, scratch, counts, has_impacts)
    put(scratch.a, scratch.a_old)
    if has_impacts and not approach(functions[7], table, s, h, x, p, z, scratch):
        return _AMISS
    if not implicit_matrix(functions[0], theta, h, s, x, p, scratch, counts):
        out[:] = math.nan
        return _UNSETTLED
    put(x, X)
    is_done = False
    for iteration in range(iterations):
        take_apart(functions, table, s + h, X, p, z, scratch, counts, has_impacts)
        if iteration % _RENEWED == _RENEWED - 1:
            implicit_matrix(functions[0], theta, h, s + h, X, p, scratch, counts)
        for i in range(n):
            free[i] = X[i] - x[i] - h * (theta * scratch.a[i] + (1.0 - theta) * scratch.a_old[i])
        solve(scratch.M, scratch.pivots, free)
        for i in range(n):
            free[i] = X[i] - free[i]
        if m > 0 and not has_impacts:
            call(functions[3], s + h, free, p, scratch.sides, scratch.y)
        for k in range(m):
            for i in range(n):
                scratch.w[k, i] = h * scratch.B[k, i]
            solve(scratch.M, scratch.pivots, scratch.w[k])
            if has_impacts:
                continue
            size = max(abs(scratch.up[k]), abs(scratch.down[k]))
            for i in range(n):
                scratch.nudged[i] = free[i] + size * scratch.w[k, i]
            call(functions[3], s + h, scratch.nudged, p, scratch.sides, scratch.y1)
            for j in range(m):
                scratch.G[j, k] = (scratch.y1[j] - scratch.y[j]) / size if size > 0.0 else 0.0
        if has_impacts:
            gap_rates(table, X, free, scratch)
        settled = forces(table, scratch, m, tolerance, has_impacts)
        change, is_number = 0.0, True
        for i in range(n):
            moved = free[i]
            for k in range(m):
                moved += scratch.w[k, i] * scratch.force[k]
            change = max(change, abs(moved - X[i]) / max(abs(moved), scratch.sizes[i]))
            X[i] = moved
            is_number = is_number and math.isfinite(moved)
        if not is_number:  # held states are set exactly below, which would hide it
            put(X, out)
            return _UNSETTLED
        if iteration > 0 and change <= tolerance and settled:
            is_done = True
            break
    is_held, is_closed = False, False
    for k in range(m):
        meaning = scratch.meaning[k]
        z[table[k, 0]] = table[k, 3] if meaning == _HOLD else table[k, meaning]
        is_held = is_held or meaning == _HOLD
        is_closed = is_closed or (meaning == _HOLD and table[k, UNILATERAL] != 0)
    if not is_held:
        put(X, out)
        return _CONVERGED if is_done else _UNSETTLED
    call(functions[4], s + h, X, p, z, out)
    # rates without forces, at unchanged held states, so that states at rest stay exactly constant
    call(functions[0], s + h, out, p, z, scratch.rates)
    for i in range(n):
        is_free = True
        for k in range(m):
            is_free = is_free and scratch.B[k, i] == 0.0
            is_free = is_free and not (scratch.meaning[k] == _HOLD and scratch.evaluated[k, i] != 0)
        if is_free:
            out[i] = x[i] + h * (theta * scratch.rates[i] + (1.0 - theta) * scratch.a_old[i])
    if is_closed:  # the gap may depend on states that have just been set
        put(out, X)
        call(functions[4], s + h, X, p, z, out)
    return _CONVERGED if is_done else _UNSETTLED


@kernel
def moreau_steps(
    functions: Any,
    settings: Any,
    step: float,
    table: Any,
    guard_numbers: Any,
    bound: float,
    p: Any,
    x: Any,
    z: Any,
    fresh: Any,
    times: Any,
    states: Any,
    modes: Any,
    scratch: Any,
    out: Any,
    counts: Any,
) -> tuple[int, int]:
    """Take steps of Moreau-Jean time stepping from local time 0 up to the bound.

    counts: rates, guards, steps that did not converge. out (n,): scratch space.
    """
    n, s, planned, row = x.shape[0], 0.0, step, 0
    for k in range(table.shape[0]):  # a run that continues from here has no other values to begin with
        scratch.force[k], scratch.meaning[k] = 0.0, _HOLD
    while True:
        times[row] = s
        put(x, states[row])
        put(z, modes[row])
        row += 1
        if brought_to_zero(
            functions[5], s, x, p, z, fresh, row == 1, scratch.monitors, scratch.monitors_after
        ):
            return row, RESTED
        if s == bound:
            return row, BOUND
        if row >= times.shape[0]:
            return row, FULL
        is_last = bound - s <= planned * (1.0 + 1e-12)
        h = bound - s if is_last else planned
        ended = moreau_step(functions, settings, table, s, h, x, p, z, out, scratch, counts)
        if ended == _AMISS:
            return row, RESTITUTION
        if ended == _UNSETTLED:
            for i in range(n):
                if not np.isfinite(out[i]):
                    return row, NOT_FINITE
            counts[2] += 1
        put(z, modes[row - 1])
        why = passed(
            (functions[1], functions[5]), s + h, out, p, z, guard_numbers, fresh, row == 1, scratch.guards,
            scratch.monitors, scratch.monitors_after, counts,
        )  # fmt: skip
        if why != CONTINUES:
            return row, why
        s = bound if is_last else s + h
        put(out, x)
