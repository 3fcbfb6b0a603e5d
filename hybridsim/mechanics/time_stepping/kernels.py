"""This module holds the kernels of time stepping: impulses of a step by projected Gauss-Seidel, and the steps."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.simd.vectors import WIDTH, whole_vectors
from hybridsim.mechanics.series_loop.simd_series import advance_simd_series, clear_constants, lane_place

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


class SteppedState(NamedTuple):
    """The state of a run: positions q and velocities v (n,), modes and impulses (m,), works of forces, and counts."""

    q: np.ndarray
    v: np.ndarray
    mode: np.ndarray
    impulse: np.ndarray
    work: np.ndarray
    counts: np.ndarray
    residual: np.ndarray


class SteppedScratch(NamedTuple):
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


class SteppedRecord(NamedTuple):
    """The record of a run: states (k, 2n), forces (k, m), and events (step, contact, mode before, after)."""

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
def solve_step(arrays: Any, x: Any, work: Any) -> None:
    """Replace x by the solution A^-1 x of a linear system."""
    n = x.shape[0]
    for i in range(n):
        work[arrays.row[i]] = x[i]
    for j in range(n):
        value = work[j]
        for e in range(arrays.l_ptr[j], arrays.l_ptr[j + 1]):
            work[arrays.l_row[e]] -= arrays.l_val[e] * value
    for j in range(n - 1, -1, -1):
        last = arrays.u_ptr[j + 1] - 1
        value = work[j] / arrays.u_val[last]
        work[j] = value
        for e in range(arrays.u_ptr[j], last):
            work[arrays.u_row[e]] -= arrays.u_val[e] * value
    for i in range(n):
        x[i] = work[arrays.column[i]]


@kernel
def forces_at(arrays: Any, t: float, out: Any) -> None:
    """Compute the external forces at a given time."""
    for x in range(out.shape[0]):
        total = arrays.still[x]
        for e in range(arrays.h_ptr[x], arrays.h_ptr[x + 1]):
            angle = arrays.rates[arrays.h_rate[e]] * t
            total += arrays.h_val[e, 0] * math.sin(angle) + arrays.h_val[e, 1] * math.cos(angle)
        out[x] = total


@inlined
def base_at(arrays: Any, c: int, t: float) -> float:
    """Return the speed of a contact's base at a given time."""
    r = arrays.base_rate[c]
    if r < 0:
        return arrays.base[c, 0]
    return arrays.base[c, 1] * math.sin(arrays.rates[r] * t) + arrays.base[c, 2] * math.cos(
        arrays.rates[r] * t
    )


@kernel
def slip_forces(arrays: Any, laws: Any, scratch: Any) -> None:
    """Compute the slip forces in both directions; at zero velocity, the forces at the onset of slip."""
    nc = scratch.speed.shape[0]
    for c in range(nc):
        scratch.up[c], scratch.down[c] = arrays.onset[c, 0], arrays.onset[c, 1]
    for t in range(laws.registers.shape[0]):
        count = 0
        for c in range(nc):
            if scratch.speed[c] != 0.0 and arrays.tape[c, 0 if scratch.speed[c] > 0.0 else 1] == t:
                scratch.lane[count] = c
                count += 1
        if count == 0:
            continue
        block = laws.registers[t] * WIDTH
        size = whole_vectors(count) // WIDTH * block
        for at in range(0, size, block):
            clear_constants(laws, scratch.V, t, at, 1)
        for j in range(whole_vectors(count)):
            c = scratch.lane[min(j, count - 1)]
            for i in range(laws.par_ptr[t], laws.par_ptr[t + 1]):
                scratch.V[lane_place(0, block, laws.par_reg[i], 1, 0, j)] = arrays.par[c, i - laws.par_ptr[t]]
            scratch.V[lane_place(0, block, laws.speed[t], 1, 0, j)] = abs(scratch.speed[c])
        begin, end = laws.constant_ptr[t], laws.constant_ptr[t + 1]
        advance_simd_series(laws.constant_rows, begin, end, scratch.V, 0, size, block, 1, 0)
        advance_simd_series(laws.rows, laws.row_ptr[t], laws.row_ptr[t + 1], scratch.V, 0, size, block, 1, 0)
        for j in range(count):
            c, value = scratch.lane[j], scratch.V[lane_place(0, block, laws.out[t], 1, 0, j)]
            if scratch.speed[c] > 0.0:
                scratch.up[c] = value
            else:
                scratch.down[c] = value


@kernel
def sweep(arrays: Any, state: Any, scratch: Any, h: float, tolerance: float) -> bool:
    """Compute impulses for given slip forces by projected Gauss-Seidel; return whether the impulses converge.

    Only contacts with a changed neighbour are swept. A friction impulse is positive along its direction, so that a
    force f gives - h f.
    """
    nc, m = scratch.speed.shape[0], scratch.y.shape[0]
    scale = 0.0
    for k in range(m):
        scratch.dirty[k] = scratch.active[k]
        scale = max(scale, abs(state.impulse[k]))
    for c in range(nc):
        scale = max(scale, h * max(arrays.limits[c, 0], arrays.limits[c, 1]))
    for turn in range(_SWEEPS):
        largest = 0.0
        for i in range(m):
            k = i if turn % 2 == 0 else m - 1 - i
            if scratch.dirty[k] == 0:
                continue
            scratch.dirty[k] = 0
            rate, own, before = scratch.y[k], 0.0, state.impulse[k]
            for e in range(arrays.g_ptr[k], arrays.g_ptr[k + 1]):
                j = arrays.g_col[e]
                if j == k:
                    own = arrays.g_val[e]
                else:
                    rate += arrays.g_val[e] * state.impulse[j]
            impulse, mode = 0.0, HOLDS
            if k < nc:
                impulse = -rate / own
                up, down = scratch.up[k], scratch.down[k]
                most, least = arrays.limits[k, 0], arrays.limits[k, 1]
                if turn > _PATIENCE and scratch.next[k] != HOLDS:
                    most, least = min(most, up), min(least, down)
                if impulse < -h * most:
                    impulse, mode = -h * up, ABOVE
                elif impulse > h * least:
                    impulse, mode = h * down, BELOW
            else:
                impulse = max((scratch.rebound[k] - rate) / own, 0.0)
                mode = HOLDS if impulse > 0.0 and scratch.rebound[k] == 0.0 else ABOVE
            scratch.next[k], state.impulse[k] = mode, impulse
            change, scale = abs(impulse - before), max(scale, abs(impulse))
            if not change <= _NOTHING * tolerance * scale:
                largest = max(largest, change)
                if not change < math.inf:
                    return False
                for e in range(arrays.g_ptr[k], arrays.g_ptr[k + 1]):
                    j = arrays.g_col[e]
                    if j != k:
                        scratch.dirty[j] = scratch.active[j]
        state.counts[SWEEPS] += 1
        if largest <= tolerance * scale:
            if scale > 0.0:
                state.residual[0] = max(state.residual[0], largest / scale)
            return True
    return False


@kernel
def impulses(
    arrays: Any, laws: Any, state: Any, scratch: Any, h: float, tolerance: float, iterations: int
) -> bool:
    """Compute the impulses of a step, with slip forces at the end velocities; return whether the impulses converge."""
    nc = scratch.speed.shape[0]
    slip_forces(arrays, laws, scratch)
    for _ in range(iterations):
        settled = sweep(arrays, state, scratch, h, tolerance)
        change = scale = 0.0
        for c in range(nc):
            scratch.up_before[c], scratch.down_before[c] = scratch.up[c], scratch.down[c]
            scratch.speed[c] = 0.0
            if scratch.next[c] != HOLDS:
                scratch.speed[c] = scratch.y[c] + product(
                    arrays.g_ptr, arrays.g_col, arrays.g_val, c, state.impulse
                )
        slip_forces(arrays, laws, scratch)
        for c in range(nc):
            scale = max(scale, max(arrays.limits[c, 0], arrays.limits[c, 1]))
            if scratch.next[c] == ABOVE:
                change = max(change, abs(scratch.up[c] - scratch.up_before[c]))
            elif scratch.next[c] == BELOW:
                change = max(change, abs(scratch.down[c] - scratch.down_before[c]))
        if not change < math.inf:
            return False
        if settled and change <= tolerance * scale:
            return True
    return False


@kernel
def begin(arrays: Any, state: Any, scratch: Any, h: float, theta: float, t: float, t_after: float) -> None:
    """Prepare a step: compute velocities without impulses, and find the gaps that may exert a force."""
    n, nc = state.q.shape[0], scratch.speed.shape[0]
    forces_at(arrays, t_after, scratch.force_after)
    for x in range(n):
        total = theta * scratch.force_after[x] + (1.0 - theta) * scratch.force[x]
        total -= product(arrays.c_ptr, arrays.c_col, arrays.c_val, x, state.v)
        total -= product(arrays.k_ptr, arrays.k_col, arrays.k_val, x, state.q)
        total -= h * theta * product(arrays.k_ptr, arrays.k_col, arrays.k_val, x, state.v)
        scratch.b[x] = scratch.free[x] = h * total
    solve_step(arrays, scratch.free, scratch.solved)
    for x in range(n):
        scratch.free[x] += state.v[x]
    for k in range(scratch.y.shape[0]):
        scratch.y[k] = product(arrays.w_ptr, arrays.w_col, arrays.w_val, k, scratch.free)
        scratch.u[k] = product(arrays.w_ptr, arrays.w_col, arrays.w_val, k, state.v)
        scratch.active[k], scratch.rebound[k], scratch.next[k] = 1, 0.0, state.mode[k]
        if k < nc:
            scratch.base[k, 0], scratch.base[k, 1] = base_at(arrays, k, t), base_at(arrays, k, t_after)
            scratch.base[k, 2] = 0.5 * (scratch.base[k, 0] + scratch.base[k, 1])
            scratch.y[k] -= scratch.base[k, 1]
            scratch.speed[k] = scratch.u[k] - scratch.base[k, 0]
            continue
        is_closed = state.mode[k] == HOLDS
        gap = arrays.gap[k - nc] + product(arrays.w_ptr, arrays.w_col, arrays.w_val, k, state.q)
        if not is_closed and gap + 0.5 * h * scratch.u[k] > 0.0:
            scratch.active[k], state.impulse[k], scratch.next[k] = 0, 0.0, ABOVE
        elif not is_closed:
            scratch.rebound[k] = arrays.restitution[k - nc] * max(-scratch.u[k], 0.0)


@kernel
def finish(arrays: Any, state: Any, scratch: Any, h: float, theta: float) -> None:
    """Compute velocities and positions at the end of a step, and the work of each force in the step.

    An impulse does the work of the mean of the velocities before and after, whatever theta is.
    """
    n, nc = state.q.shape[0], scratch.speed.shape[0]
    change = scratch.free
    put_impulses(arrays, state, scratch)
    for x in range(n):
        change[x] = scratch.b[x]
    solve_step(arrays, change, scratch.solved)
    for x in range(n):
        change[x] += state.v[x]
    for c in range(nc):  # a sticking contact has exactly the velocity of its base
        first = arrays.w_ptr[c]
        if scratch.next[c] == HOLDS and arrays.w_ptr[c + 1] == first + 1:
            change[arrays.w_col[first]] = scratch.base[c, 1] / arrays.w_val[first]
    for x in range(n):
        after = change[x]
        state.q[x] += h * (theta * after + (1.0 - theta) * state.v[x])
        change[x] = 0.5 * (after + state.v[x])
        scratch.b[x] = after - change[x]
        state.v[x] = after
        force = theta * scratch.force_after[x] + (1.0 - theta) * scratch.force[x]
        state.work[FORCING] += h * force * change[x]
        scratch.force[x] = scratch.force_after[x]
    for x in range(n):
        for e in range(arrays.c_ptr[x], arrays.c_ptr[x + 1]):
            speed = change[arrays.c_col[e]] + (2.0 * theta - 1.0) * scratch.b[arrays.c_col[e]]
            state.work[DAMPING] -= h * change[x] * arrays.c_val[e] * speed
    for k in range(scratch.y.shape[0]):
        rate = product(arrays.w_ptr, arrays.w_col, arrays.w_val, k, change)
        if k < nc:
            state.work[FRICTION] += state.impulse[k] * (rate - scratch.base[k, 2])
            state.work[BASES] += state.impulse[k] * scratch.base[k, 2]
        else:
            state.work[IMPACTS] += state.impulse[k] * rate
            if state.impulse[k] > 0.0 and scratch.rebound[k] > 0.0:
                state.counts[BOUNCES] += 1


@kernel
def put_impulses(arrays: Any, state: Any, scratch: Any) -> None:
    """Add the effect of the contact impulses to the right-hand side b."""
    for k in range(scratch.y.shape[0]):
        for e in range(arrays.w_ptr[k], arrays.w_ptr[k + 1]):
            scratch.b[arrays.w_col[e]] += arrays.w_val[e] * state.impulse[k]


@kernel
def steps(
    arrays: Any,
    laws: Any,
    state: Any,
    scratch: Any,
    record: Any,
    settings: Any,
    t0: float,
    first: int,
    count: int,
) -> int:
    """Make up to `count` steps, fewer if the record is full or a state is NaN; return the number of steps.

    settings: step, theta, tolerance, iterations. record.used: numbers of rows of states and of events.
    """
    h, theta, tolerance, iterations = settings
    n, m = state.q.shape[0], scratch.y.shape[0]
    forces_at(arrays, t0 + first * h, scratch.force)
    for i in range(first, first + count):
        if record.event.shape[0] - record.used[1] < m:
            return i - first
        begin(arrays, state, scratch, h, theta, t0 + i * h, t0 + (i + 1) * h)
        if not impulses(arrays, laws, state, scratch, h, tolerance, iterations):
            state.counts[UNSETTLED] += 1
        finish(arrays, state, scratch, h, theta)
        for k in range(m):
            if scratch.next[k] != state.mode[k]:
                at = record.used[1]
                record.event[at, 0], record.event[at, 1] = i, k
                record.event[at, 2], record.event[at, 3] = state.mode[k], scratch.next[k]
                record.used[1] = at + 1
                state.mode[k] = scratch.next[k]
        is_finite = True
        for x in range(n):
            is_finite = is_finite and np.isfinite(state.q[x]) and np.isfinite(state.v[x])
        if not is_finite:
            return i - first
        state.counts[STEPS] += 1
        row = record.used[0]
        if row < record.states.shape[0]:
            for x in range(n):
                record.states[row, x], record.states[row, n + x] = state.q[x], state.v[x]
            for k in range(m):
                record.forces[row, k] = state.impulse[k] / h
            record.used[0] = row + 1
    return count
