"""This module holds the kernels of time stepping: impulses of a step by projected Gauss-Seidel, and the steps."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.simd_vectors import WIDTH, whole_vectors
from hybridsim.mechanics.series_loop.simd_series import advance_lanes, clear_constants, lane_place

HOLDS, ABOVE, BELOW = (
    0,
    1,
    -1,
)  # modes of a contact: stick, slip forward, slip backward; of an impact: closed, open
FORCING, DAMPING, FRICTION, BASES, IMPACTS = range(5)  # indices of works
SWEEPS, BOUNCES, UNSETTLED, STEPS = range(4)  # indices of counts
_PATIENCE = 50  # sweeps after which slipping contacts come to rest by kinetic friction only
_SWEEPS = 20_000
_NOTHING = 1e-2  # of the tolerance; a smaller change of an impulse is not passed on to its neighbours


class Stand(NamedTuple):
    """The state of a run: q, v (n,), mode, impulse (m,), works (5,), counts (4,), residual (1,)."""

    q: np.ndarray
    v: np.ndarray
    mode: np.ndarray
    impulse: np.ndarray
    work: np.ndarray
    counts: np.ndarray
    residual: np.ndarray


class Bench(NamedTuple):
    """Scratch arrays for n coordinates, nc contacts, and m contacts and impacts."""

    force: np.ndarray  # (n,) forcing at the start
    force_after: np.ndarray  # (n,) forcing at the end
    b: np.ndarray  # (n,) right-hand side
    free: np.ndarray  # (n,) change without impulses
    solved: np.ndarray  # (n,) scratch of `solve_step`
    y: np.ndarray  # (m,) rates at the end of the step without impulses
    u: np.ndarray  # (m,) rates at its start
    speed: np.ndarray  # (nc,) relative velocity
    base: np.ndarray  # (nc, 3) speed of the base at the start, at the end, and its mean
    up: np.ndarray  # (nc,) slip forces forward
    down: np.ndarray  # (nc,) slip forces backward
    up_before: np.ndarray  # (nc,) of the previous iteration
    down_before: np.ndarray
    active: np.ndarray  # (m,)
    dirty: np.ndarray  # (m,)
    next: np.ndarray  # (m,)
    rebound: np.ndarray  # (m,)
    lane: np.ndarray  # (nc,) lanes of the tapes
    V: np.ndarray  # registers of the tapes


class Kept(NamedTuple):
    """The record: states (k, 2n), forces (k, m), events (step, which, mode before, after), counts used."""

    states: np.ndarray
    forces: np.ndarray
    event: np.ndarray
    used: np.ndarray


@inlined
def product(ptr: Any, col: Any, val: Any, k: int, x: Any) -> float:
    """Return the product of row k of a sparse matrix and x."""
    total = 0.0
    for e in range(ptr[k], ptr[k + 1]):
        total += val[e] * x[col[e]]
    return total


@kernel
def solve_step(plant: Any, x: Any, work: Any) -> None:
    """Replace x by A^-1 x."""
    n = x.shape[0]
    for i in range(n):
        work[plant.row[i]] = x[i]
    for j in range(n):
        value = work[j]
        for e in range(plant.l_ptr[j], plant.l_ptr[j + 1]):
            work[plant.l_row[e]] -= plant.l_val[e] * value
    for j in range(n - 1, -1, -1):
        last = plant.u_ptr[j + 1] - 1
        value = work[j] / plant.u_val[last]
        work[j] = value
        for e in range(plant.u_ptr[j], last):
            work[plant.u_row[e]] -= plant.u_val[e] * value
    for i in range(n):
        x[i] = work[plant.column[i]]


@kernel
def forces_at(plant: Any, t: float, out: Any) -> None:
    """Compute the forcing at a time."""
    for x in range(out.shape[0]):
        total = plant.still[x]
        for e in range(plant.h_ptr[x], plant.h_ptr[x + 1]):
            angle = plant.rates[plant.h_rate[e]] * t
            total += plant.h_val[e, 0] * math.sin(angle) + plant.h_val[e, 1] * math.cos(angle)
        out[x] = total


@inlined
def base_at(plant: Any, c: int, t: float) -> float:
    """Return the speed of a contact's base."""
    r = plant.base_rate[c]
    if r < 0:
        return plant.base[c, 0]
    return plant.base[c, 1] * math.sin(plant.rates[r] * t) + plant.base[c, 2] * math.cos(plant.rates[r] * t)


@kernel
def slip_forces(plant: Any, laws: Any, room: Any) -> None:
    """Compute the slip forces, forward and backward, at the relative velocities; at v = 0 the forces at onset."""
    nc = room.speed.shape[0]
    for c in range(nc):
        room.up[c], room.down[c] = plant.onset[c, 0], plant.onset[c, 1]
    for t in range(laws.registers.shape[0]):
        count = 0
        for c in range(nc):
            if room.speed[c] != 0.0 and plant.tape[c, 0 if room.speed[c] > 0.0 else 1] == t:
                room.lane[count] = c
                count += 1
        if count == 0:
            continue
        block = laws.registers[t] * WIDTH
        size = whole_vectors(count) // WIDTH * block
        for at in range(0, size, block):
            clear_constants(laws, room.V, t, at, 1)
        for j in range(whole_vectors(count)):
            c = room.lane[min(j, count - 1)]
            for i in range(laws.par_ptr[t], laws.par_ptr[t + 1]):
                room.V[lane_place(0, block, laws.par_reg[i], 1, 0, j)] = plant.par[c, i - laws.par_ptr[t]]
            room.V[lane_place(0, block, laws.speed[t], 1, 0, j)] = abs(room.speed[c])
        begin, end = laws.constant_ptr[t], laws.constant_ptr[t + 1]
        advance_lanes(laws.constant_rows, begin, end, room.V, 0, size, block, 1, 0)
        advance_lanes(laws.rows, laws.row_ptr[t], laws.row_ptr[t + 1], room.V, 0, size, block, 1, 0)
        for j in range(count):
            c, value = room.lane[j], room.V[lane_place(0, block, laws.out[t], 1, 0, j)]
            if room.speed[c] > 0.0:
                room.up[c] = value
            else:
                room.down[c] = value


@kernel
def sweep(plant: Any, state: Any, room: Any, h: float, tolerance: float) -> bool:
    """Compute impulses for given slip forces by projected Gauss-Seidel sweeps; return whether they converged.

    Only contacts with a changed neighbour are swept. A friction impulse is positive along its direction, so that a
    force f gives - h f.
    """
    nc, m = room.speed.shape[0], room.y.shape[0]
    scale = 0.0
    for k in range(m):
        room.dirty[k] = room.active[k]
        scale = max(scale, abs(state.impulse[k]))
    for c in range(nc):
        scale = max(scale, h * max(plant.limits[c, 0], plant.limits[c, 1]))
    for turn in range(_SWEEPS):
        largest = 0.0
        for i in range(m):
            k = i if turn % 2 == 0 else m - 1 - i
            if room.dirty[k] == 0:
                continue
            room.dirty[k] = 0
            rate, own, before = room.y[k], 0.0, state.impulse[k]
            for e in range(plant.g_ptr[k], plant.g_ptr[k + 1]):
                j = plant.g_col[e]
                if j == k:
                    own = plant.g_val[e]
                else:
                    rate += plant.g_val[e] * state.impulse[j]
            impulse, mode = 0.0, HOLDS
            if k < nc:
                impulse = -rate / own
                up, down, most, least = room.up[k], room.down[k], plant.limits[k, 0], plant.limits[k, 1]
                if turn > _PATIENCE and room.next[k] != HOLDS:
                    most, least = min(most, up), min(least, down)
                if impulse < -h * most:
                    impulse, mode = -h * up, ABOVE
                elif impulse > h * least:
                    impulse, mode = h * down, BELOW
            else:
                impulse = max((room.rebound[k] - rate) / own, 0.0)
                mode = HOLDS if impulse > 0.0 and room.rebound[k] == 0.0 else ABOVE
            room.next[k], state.impulse[k] = mode, impulse
            change, scale = abs(impulse - before), max(scale, abs(impulse))
            if not change <= _NOTHING * tolerance * scale:
                largest = max(largest, change)
                if not change < math.inf:
                    return False
                for e in range(plant.g_ptr[k], plant.g_ptr[k + 1]):
                    j = plant.g_col[e]
                    if j != k:
                        room.dirty[j] = room.active[j]
        state.counts[SWEEPS] += 1
        if largest <= tolerance * scale:
            if scale > 0.0:
                state.residual[0] = max(state.residual[0], largest / scale)
            return True
    return False


@kernel
def impulses(
    plant: Any, laws: Any, state: Any, room: Any, h: float, tolerance: float, iterations: int
) -> bool:
    """Compute the impulses of a step, with slip forces at its end velocities; return whether they converged."""
    nc = room.speed.shape[0]
    slip_forces(plant, laws, room)
    for _ in range(iterations):
        settled = sweep(plant, state, room, h, tolerance)
        change = scale = 0.0
        for c in range(nc):
            room.up_before[c], room.down_before[c] = room.up[c], room.down[c]
            room.speed[c] = 0.0
            if room.next[c] != HOLDS:
                room.speed[c] = room.y[c] + product(plant.g_ptr, plant.g_col, plant.g_val, c, state.impulse)
        slip_forces(plant, laws, room)
        for c in range(nc):
            scale = max(scale, max(plant.limits[c, 0], plant.limits[c, 1]))
            if room.next[c] == ABOVE:
                change = max(change, abs(room.up[c] - room.up_before[c]))
            elif room.next[c] == BELOW:
                change = max(change, abs(room.down[c] - room.down_before[c]))
        if not change < math.inf:
            return False
        if settled and change <= tolerance * scale:
            return True
    return False


@kernel
def begin(plant: Any, state: Any, room: Any, h: float, theta: float, t: float, t_after: float) -> None:
    """Prepare a step: free velocities and rates, and the gaps that may exert a force."""
    n, nc = state.q.shape[0], room.speed.shape[0]
    forces_at(plant, t_after, room.force_after)
    for x in range(n):
        total = theta * room.force_after[x] + (1.0 - theta) * room.force[x]
        total -= product(plant.c_ptr, plant.c_col, plant.c_val, x, state.v)
        total -= product(plant.k_ptr, plant.k_col, plant.k_val, x, state.q)
        total -= h * theta * product(plant.k_ptr, plant.k_col, plant.k_val, x, state.v)
        room.b[x] = room.free[x] = h * total
    solve_step(plant, room.free, room.solved)
    for x in range(n):
        room.free[x] += state.v[x]
    for k in range(room.y.shape[0]):
        room.y[k] = product(plant.w_ptr, plant.w_col, plant.w_val, k, room.free)
        room.u[k] = product(plant.w_ptr, plant.w_col, plant.w_val, k, state.v)
        room.active[k], room.rebound[k], room.next[k] = 1, 0.0, state.mode[k]
        if k < nc:
            room.base[k, 0], room.base[k, 1] = base_at(plant, k, t), base_at(plant, k, t_after)
            room.base[k, 2] = 0.5 * (room.base[k, 0] + room.base[k, 1])
            room.y[k] -= room.base[k, 1]
            room.speed[k] = room.u[k] - room.base[k, 0]
            continue
        is_closed = state.mode[k] == HOLDS
        gap = plant.gap[k - nc] + product(plant.w_ptr, plant.w_col, plant.w_val, k, state.q)
        if not is_closed and gap + 0.5 * h * room.u[k] > 0.0:
            room.active[k], state.impulse[k], room.next[k] = 0, 0.0, ABOVE
        elif not is_closed:
            room.rebound[k] = plant.restitution[k - nc] * max(-room.u[k], 0.0)


@kernel
def finish(plant: Any, state: Any, room: Any, h: float, theta: float) -> None:
    """Compute velocities and positions at the end of a step from its impulses, and the works in it.

    An impulse does the work of the mean of the velocities before and after, whatever theta is.
    """
    n, nc = state.q.shape[0], room.speed.shape[0]
    change = room.free
    put_impulses(plant, state, room)
    for x in range(n):
        change[x] = room.b[x]
    solve_step(plant, change, room.solved)
    for x in range(n):
        change[x] += state.v[x]
    for c in range(nc):  # a sticking contact has exactly the velocity of its base
        first = plant.w_ptr[c]
        if room.next[c] == HOLDS and plant.w_ptr[c + 1] == first + 1:
            change[plant.w_col[first]] = room.base[c, 1] / plant.w_val[first]
    for x in range(n):
        after = change[x]
        state.q[x] += h * (theta * after + (1.0 - theta) * state.v[x])
        change[x] = 0.5 * (after + state.v[x])
        room.b[x] = after - change[x]
        state.v[x] = after
        force = theta * room.force_after[x] + (1.0 - theta) * room.force[x]
        state.work[FORCING] += h * force * change[x]
        room.force[x] = room.force_after[x]
    for x in range(n):
        for e in range(plant.c_ptr[x], plant.c_ptr[x + 1]):
            speed = change[plant.c_col[e]] + (2.0 * theta - 1.0) * room.b[plant.c_col[e]]
            state.work[DAMPING] -= h * change[x] * plant.c_val[e] * speed
    for k in range(room.y.shape[0]):
        rate = product(plant.w_ptr, plant.w_col, plant.w_val, k, change)
        if k < nc:
            state.work[FRICTION] += state.impulse[k] * (rate - room.base[k, 2])
            state.work[BASES] += state.impulse[k] * room.base[k, 2]
        else:
            state.work[IMPACTS] += state.impulse[k] * rate
            if state.impulse[k] > 0.0 and room.rebound[k] > 0.0:
                state.counts[BOUNCES] += 1


@kernel
def put_impulses(plant: Any, state: Any, room: Any) -> None:
    """Add the effect of the impulses to b."""
    for k in range(room.y.shape[0]):
        for e in range(plant.w_ptr[k], plant.w_ptr[k + 1]):
            room.b[plant.w_col[e]] += plant.w_val[e] * state.impulse[k]


@kernel
def steps(
    plant: Any, laws: Any, state: Any, room: Any, kept: Any, settings: Any, t0: float, first: int, count: int
) -> int:
    """Make `count` steps; return the number done, which is smaller if the record is full or a state is NaN.

    settings: step, theta, tolerance, iterations. kept.used: numbers of rows of states and of events.
    """
    h, theta, tolerance, iterations = settings
    n, m = state.q.shape[0], room.y.shape[0]
    forces_at(plant, t0 + first * h, room.force)
    for i in range(first, first + count):
        if kept.event.shape[0] - kept.used[1] < m:
            return i - first
        begin(plant, state, room, h, theta, t0 + i * h, t0 + (i + 1) * h)
        if not impulses(plant, laws, state, room, h, tolerance, iterations):
            state.counts[UNSETTLED] += 1
        finish(plant, state, room, h, theta)
        for k in range(m):
            if room.next[k] != state.mode[k]:
                at = kept.used[1]
                kept.event[at, 0], kept.event[at, 1] = i, k
                kept.event[at, 2], kept.event[at, 3] = state.mode[k], room.next[k]
                kept.used[1] = at + 1
                state.mode[k] = room.next[k]
        is_finite = True
        for x in range(n):
            is_finite = is_finite and np.isfinite(state.q[x]) and np.isfinite(state.v[x])
        if not is_finite:
            return i - first
        state.counts[STEPS] += 1
        row = kept.used[0]
        if row < kept.states.shape[0]:
            for x in range(n):
                kept.states[row, x], kept.states[row, n + x] = state.q[x], state.v[x]
            for k in range(m):
                kept.forces[row, k] = state.impulse[k] / h
            kept.used[0] = row + 1
    return count
