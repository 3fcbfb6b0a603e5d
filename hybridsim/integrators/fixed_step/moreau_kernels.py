"""Kernels of time stepping: forces taken apart from a flow, one implicit step, and the forces that belong to it."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import call, inlined, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.native.struct_pack import packed
from hybridsim.integrators.fixed_step.kernels import (
    BOUND,
    FULL,
    GOES_ON,
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

_NUDGE = 2.0**-26  # a difference quotient's step, relative: half of the digits
_RENEWED = 4  # iterations after which Newton's method gets a new matrix
# Sweeps after which what slips comes to rest by kinetic friction alone: contacts whose static friction is larger might
# take turns for ever.
_PATIENCE = 50
_SWEEPS = 10_000  # of the projected Gauss-Seidel iteration; a lone contact needs one
_HOLD, _ABOVE, _BELOW = 0, 1, 2  # what a force means
_CONVERGED, _UNSETTLED, _AMISS = range(3)  # how a step ended


class Room(NamedTuple):
    """Scratch arrays for n states, m surfaces, C components, Q quantities, G guards.

    a, a_old (n,): rates without the forces. B, w (m, n): what a unit of each force does to the rates, to the end of a
    step. up, down, most, least (m,): force of slip above, below (negative), limits of the holding force. G (m, m): what
    a unit of force does to the surfaces at the end; y (m,): these without forces. force, meaning (m,): what was found.

    With impacts: u (m,), S (m, n): rates of gaps and relative velocities, and their slopes, from `rows`, the results of
    the function ``stepped``. loads (4, m, m): what normal forces let grow. active, rebound (m,): gaps that may push,
    and their least speed of separation, from `approach` (n + m,) and `restitution`. evaluated (m, n): states that a
    closed gap evaluates.
    """

    sides: np.ndarray
    trial: np.ndarray
    a: np.ndarray
    a_old: np.ndarray
    on: np.ndarray
    rates: np.ndarray
    nudged: np.ndarray
    B: np.ndarray
    w: np.ndarray
    quantities: np.ndarray
    guards: np.ndarray
    up: np.ndarray
    down: np.ndarray
    most: np.ndarray
    least: np.ndarray
    M: np.ndarray
    pivots: np.ndarray
    X: np.ndarray
    free: np.ndarray
    y: np.ndarray
    y1: np.ndarray
    G: np.ndarray
    force: np.ndarray
    meaning: np.ndarray
    sizes: np.ndarray
    monitors: np.ndarray
    monitors_after: np.ndarray
    u: np.ndarray
    S: np.ndarray
    rows: np.ndarray
    loads: np.ndarray
    active: np.ndarray
    rebound: np.ndarray
    approach: np.ndarray
    restitution: np.ndarray
    evaluated: np.ndarray


def room_for(
    n: int,
    surfaces: int,
    components: int,
    quantities: int,
    guards: int,
    monitors: int,
    sizes: Any,
    evaluated: Any,
) -> Any:
    """Room for one run; sizes (n,): of the states, for difference quotients and for the end of iterations.

    evaluated (m, n): see `Room`.
    """
    none = max(surfaces, 1)  # a compiled function writes at least there
    of_components = {name: np.zeros(components, dtype=np.int64) for name in ("sides", "trial")}
    of_states = {name: np.zeros(n) for name in ("a", "a_old", "on", "rates", "nudged", "X", "free")}
    names = ("up", "down", "most", "least", "y", "y1", "force", "u", "rebound", "restitution")
    of_surfaces = {name: np.zeros(none) for name in names}
    return packed(
        Room(
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
    functions: Any, table: Any, s: float, x: Any, p: Any, z: Any, room: Any, counts: Any, has_impacts: bool
) -> None:
    """Rates without the forces, what a unit of each force adds, and the bounds of each force, at (s, x).

    The rates are linear in the forces: at a surface those above it less those below it are the force's share, times the
    difference of the two forces. A force of slip is taken where the surface is on its side, else on the surface: a law
    need not mean anything beyond. functions: see `moreau_step`. table: as of `surface_table`, the quantity, and whether
    it is a gap. `room.sides` gets the modes that x is in, all gaps open: normal forces are among those taken apart.
    """
    sides, trial, a, on, rates, q = room.sides, room.trial, room.a, room.on, room.rates, room.quantities
    put(z, sides)
    for k in range(table.shape[0]):
        sides[table[k, 0]] = table[k, _ABOVE]
    if table.shape[0] > 0:
        call(functions[3], s, x, p, sides, room.y1)
    for k in range(table.shape[0]):
        is_above = room.y1[k] >= 0.0 or table[k, UNILATERAL] != 0
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
        call(functions[1], s, on, p, trial, room.guards)
        room.most[k] = room.guards[table[k, 4]] + q[force]
        room.least[k] = q[force] - room.guards[table[k, 5]]
        trial[c] = table[k, _ABOVE]
        call(functions[0], s, on, p, trial, a)
        call(functions[2], s, on, p, trial, q)
        room.up[k] = q[force]
        trial[c] = table[k, _BELOW]
        call(functions[0], s, on, p, trial, rates)
        call(functions[2], s, on, p, trial, q)
        room.down[k] = q[force]
        difference = room.up[k] - room.down[k]
        for i in range(x.shape[0]):
            room.B[k, i] = (a[i] - rates[i]) / difference if difference != 0.0 else 0.0
    if has_impacts:
        add_impacts(functions, table, s, x, p, room)
    call(functions[0], s, x, p, sides, a)
    if table.shape[0] > 0:
        call(functions[2], s, x, p, sides, q)
    for k in range(table.shape[0]):
        if room.y1[k] >= 0.0:
            room.up[k] = q[table[k, 6]]
        else:
            room.down[k] = q[table[k, 6]]
        for i in range(x.shape[0]):
            a[i] -= room.B[k, i] * q[table[k, 6]]


@inlined
def implicit_matrix(
    flow: Any, theta: float, h: float, s: float, x: Any, p: Any, room: Any, counts: Any
) -> bool:
    """LU factors of I - h theta da/dx, by differences; `room.a` and `room.sides` are at (s, x)."""
    n = x.shape[0]
    put(x, room.nudged)
    call(flow, s, x, p, room.sides, room.rates)
    for i in range(n):
        room.free[i] = room.rates[i]
    for j in range(n):
        nudge = _NUDGE * max(abs(x[j]), room.sizes[j])
        for way in (1.0, -1.0):  # a law need not have a value on the other side of rest
            room.nudged[j] = x[j] + way * nudge
            step = room.nudged[j] - x[j]
            call(flow, s, room.nudged, p, room.sides, room.rates)
            if math.isfinite(np.sum(room.rates)):
                break
        for i in range(n):
            room.M[i, j] = -h * theta * (room.rates[i] - room.free[i]) / step
        room.M[j, j] += 1.0
        room.nudged[j] = x[j]
    counts[0] += n + 1
    return factor(room.M, room.pivots)


@inlined
def forces(table: Any, room: Any, m: int, tolerance: float, has_impacts: bool) -> bool:
    """Forces at the end of a step by projected Gauss-Seidel sweeps; whether they settled.

    Each force is what holds its surface at zero, as far as its limits allow; else that of slip. That of a gap is the
    least that makes it rebound.
    """
    for sweep in range(_SWEEPS):
        change = scale = 0.0
        for k in range(m):
            y = room.y[k]
            for j in range(m):
                if j != k:
                    y += room.G[k, j] * room.force[j]
            own, meaning = room.G[k, k], _HOLD
            up, down, most, least = room.up[k], room.down[k], room.most[k], room.least[k]
            if has_impacts:
                for d in range(m):
                    up += room.loads[UP, k, d] * room.force[d]
                    down += room.loads[DOWN, k, d] * room.force[d]
                    most += room.loads[MOST, k, d] * room.force[d]
                    least += room.loads[LEAST, k, d] * room.force[d]
            if has_impacts and table[k, UNILATERAL] != 0:
                force = (room.rebound[k] - y) / own if room.active[k] != 0 and own > 0.0 else 0.0
                force = max(force, 0.0)
                meaning = _HOLD if force > 0.0 and room.rebound[k] == 0.0 else _ABOVE
                up = force
            else:
                force = -y / own if own < 0.0 else 0.0
                if sweep > _PATIENCE and room.meaning[k] != _HOLD:
                    most, least = min(most, up), max(least, down)
                if force > most or (own >= 0.0 and y > 0.0):
                    force, meaning = up, _ABOVE
                elif force < least or (own >= 0.0 and y < 0.0):
                    force, meaning = down, _BELOW
            room.meaning[k] = meaning
            change = max(change, abs(force - room.force[k]))
            scale = max(scale, max(abs(up), abs(down)))
            room.force[k] = force
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
    room: Any,
    counts: Any,
) -> int:
    """One step of the theta scheme, implicit in the forces; the modes that they mean go to z. How it ended.

        X = x + h (theta a(s + h, X) + (1 - theta) a(s, x)) + h sum_k B_k f_k,   f_k in the law of k at y_k(X)

    and for gaps f_k >= 0, y_k(X) >= rebound_k, one of the two with equality. functions: flow, guards, quantities,
    surfaces, project, monitors; with impacts stepped and restitutions. settings: theta, tolerance, iterations, whether
    there are impacts. counts: rates, guards.
    """
    theta, tolerance, iterations, has_impacts = settings
    n, m, X, free = x.shape[0], table.shape[0], room.X, room.free
    take_apart(functions, table, s, x, p, z, room, counts, has_impacts)
    put(room.a, room.a_old)
    if has_impacts and not approach(functions[7], table, s, h, x, p, z, room):
        return _AMISS
    if not implicit_matrix(functions[0], theta, h, s, x, p, room, counts):
        out[:] = math.nan
        return _UNSETTLED
    put(x, X)
    is_done = False
    for iteration in range(iterations):
        take_apart(functions, table, s + h, X, p, z, room, counts, has_impacts)
        if iteration % _RENEWED == _RENEWED - 1:
            implicit_matrix(functions[0], theta, h, s + h, X, p, room, counts)
        for i in range(n):
            free[i] = X[i] - x[i] - h * (theta * room.a[i] + (1.0 - theta) * room.a_old[i])
        solve(room.M, room.pivots, free)
        for i in range(n):
            free[i] = X[i] - free[i]
        if m > 0 and not has_impacts:
            call(functions[3], s + h, free, p, room.sides, room.y)
        for k in range(m):
            for i in range(n):
                room.w[k, i] = h * room.B[k, i]
            solve(room.M, room.pivots, room.w[k])
            if has_impacts:
                continue
            size = max(abs(room.up[k]), abs(room.down[k]))
            for i in range(n):
                room.nudged[i] = free[i] + size * room.w[k, i]
            call(functions[3], s + h, room.nudged, p, room.sides, room.y1)
            for j in range(m):
                room.G[j, k] = (room.y1[j] - room.y[j]) / size if size > 0.0 else 0.0
        if has_impacts:
            gap_rates(table, X, free, room)
        settled = forces(table, room, m, tolerance, has_impacts)
        change, is_number = 0.0, True
        for i in range(n):
            moved = free[i]
            for k in range(m):
                moved += room.w[k, i] * room.force[k]
            change = max(change, abs(moved - X[i]) / max(abs(moved), room.sizes[i]))
            X[i] = moved
            is_number = is_number and math.isfinite(moved)
        if not is_number:  # what holds is set exactly below, and would hide it
            put(X, out)
            return _UNSETTLED
        if iteration > 0 and change <= tolerance and settled:
            is_done = True
            break
    is_held, is_closed = False, False
    for k in range(m):
        meaning = room.meaning[k]
        z[table[k, 0]] = table[k, 3] if meaning == _HOLD else table[k, meaning]
        is_held = is_held or meaning == _HOLD
        is_closed = is_closed or (meaning == _HOLD and table[k, UNILATERAL] != 0)
    if not is_held:
        put(X, out)
        return _CONVERGED if is_done else _UNSETTLED
    call(functions[4], s + h, X, p, z, out)
    # rates that no force enters, with held states as they are: what should not move does not move by a bit
    call(functions[0], s + h, out, p, z, room.rates)
    for i in range(n):
        is_free = True
        for k in range(m):
            is_free = is_free and room.B[k, i] == 0.0
            is_free = is_free and not (room.meaning[k] == _HOLD and room.evaluated[k, i] != 0)
        if is_free:
            out[i] = x[i] + h * (theta * room.rates[i] + (1.0 - theta) * room.a_old[i])
    if is_closed:  # the gap may depend on what has just been set
        put(out, X)
        call(functions[4], s + h, X, p, z, out)
    return _CONVERGED if is_done else _UNSETTLED


@kernel
def moreau_steps(
    functions: Any,
    settings: Any,
    step: float,
    table: Any,
    watched: Any,
    bound: float,
    p: Any,
    x: Any,
    z: Any,
    fresh: Any,
    times: Any,
    states: Any,
    modes: Any,
    room: Any,
    out: Any,
    counts: Any,
) -> tuple[int, int]:
    """Steps from local time 0 in (x, z) up to the bound; see `hybridsim.integrators.fixed_step.run.March`.

    counts: rates, guards, steps that did not converge. out (n,): room.
    """
    n, s, planned, row = x.shape[0], 0.0, step, 0
    for k in range(table.shape[0]):  # a run that goes on from here has no others to begin with
        room.force[k], room.meaning[k] = 0.0, _HOLD
    while True:
        times[row] = s
        put(x, states[row])
        put(z, modes[row])
        row += 1
        if brought_to_zero(functions[5], s, x, p, z, fresh, row == 1, room.monitors, room.monitors_after):
            return row, RESTED
        if s == bound:
            return row, BOUND
        if row >= times.shape[0]:
            return row, FULL
        is_last = bound - s <= planned * (1.0 + 1e-12)
        h = bound - s if is_last else planned
        ended = moreau_step(functions, settings, table, s, h, x, p, z, out, room, counts)
        if ended == _AMISS:
            return row, RESTITUTION
        if ended == _UNSETTLED:
            for i in range(n):
                if not np.isfinite(out[i]):
                    return row, NOT_FINITE
            counts[2] += 1
        put(z, modes[row - 1])
        why = passed(
            (functions[1], functions[5]), s + h, out, p, z, watched, fresh, row == 1, room.guards, room.monitors,
            room.monitors_after, counts,
        )  # fmt: skip
        if why != GOES_ON:
            return row, why
        s = bound if is_last else s + h
        put(out, x)
