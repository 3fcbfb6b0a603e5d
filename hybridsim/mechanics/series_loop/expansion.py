"""This module computes Taylor series of a patch of nodes: coordinates, relative velocities, friction forces.

All nodes of a patch are expanded together; the nodes around it enter by their existing series. When q is
known to order k + 1, the relative velocities have their coefficient k and the laws give the slip forces. The
forces of sticking contacts follow from w . q'' = base'. This gives coefficient k + 2 of q.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import call_kernel, inlined, kernel
from hybridsim.engine.native.simd_vectors import WIDTH, whole_vectors
from hybridsim.mechanics.arrays import AT, CONS, COUNT, DOFS, EXPAND, FIRST, ORDER, STICK
from hybridsim.mechanics.polynomials import shift, state_at
from hybridsim.mechanics.series_loop.banded_series import clear_beside, expand_run
from hybridsim.mechanics.series_loop.simd_series import advance_lanes, clear_constants, lane_place


@kernel
def gather(plant: Any, state: Any, room: Any, count: int, tau: float, top: int) -> tuple[int, int]:
    """Number the coordinates and contacts of the nodes room.nodes[:count], and store their values at tau.

    The nodes around them get series about tau. Returns the numbers of coordinates and contacts of the patch.
    """
    state.whole[FIRST] = -1
    room.stamp[-1] += 1
    now, nd, nc = room.stamp[-1], 0, 0
    for i in range(count):
        j = room.nodes[i]
        room.stamp[j] = now
        d = tau - state.origin[j]
        for x in range(plant.node_dof[j], plant.node_dof[j + 1]):
            room.loc[x], room.dofs[nd] = nd, x
            value, slope = state_at(state.series, x, d)
            room.Q[0, nd], room.Q[1, nd] = value, slope
            nd += 1
        for c in range(plant.node_con[j], plant.node_con[j + 1]):
            room.lcon[c], room.cons[nc] = nc, c
            nc += 1
    lane = nd
    for i in range(count):
        j = room.nodes[i]
        for e in range(plant.near_ptr[j], plant.near_ptr[j + 1]):
            other = plant.near[e]
            if room.stamp[other] == now:
                continue
            room.stamp[other] = now
            d = tau - state.origin[other]
            for x in range(plant.node_dof[other], plant.node_dof[other + 1]):
                room.loc[x] = lane
                shift(state.series, x, d, top, room.line)
                for k in range(top + 1):
                    room.Q[k, lane] = room.line[k]
                lane += 1
    return nd, nc


@kernel
def whole(plant: Any, state: Any, room: Any, top: int) -> tuple[int, int]:
    """List all coordinates as one group to expand, from the start of the step."""
    state.whole[FIRST] = -1
    if plant.offsets.shape[0] > 0:
        state.whole[FIRST] = 0
        clear_beside(plant, room, plant.dof_node.shape[0], top)
    n, m = plant.dof_node.shape[0], plant.con_node.shape[0]
    for j in range(plant.node_dof.shape[0] - 1):
        room.nodes[j] = j
    for x in range(n):
        room.loc[x] = room.dofs[x] = x
        room.Q[0, x], room.Q[1, x] = state.x[0, x], state.x[1, x]
    for c in range(m):
        room.lcon[c] = room.cons[c] = c
    return n, m


@kernel
def _angles(plant: Any, state: Any, room: Any, tau: float, top: int) -> None:
    """Compute the series of sine and cosine of every angle about tau."""
    for r in range(plant.rates.shape[0]):
        rate = plant.rates[r]
        angle = state.phase[r] + rate * tau
        room.trig[r, 0, 0], room.trig[r, 1, 0] = math.sin(angle), math.cos(angle)
        for k in range(1, top + 1):
            room.trig[r, 0, k] = rate * room.trig[r, 1, k - 1] / k
            room.trig[r, 1, k] = -rate * room.trig[r, 0, k - 1] / k


@inlined
def base_coefficient(plant: Any, room: Any, c: int, k: int) -> float:
    """Return coefficient k of the speed of a contact's base."""
    r = plant.base_rate[c]
    if r >= 0:
        return plant.base[c, 1] * room.trig[r, 0, k] + plant.base[c, 2] * room.trig[r, 1, k]
    return plant.base[c, 0] if k == 0 else 0.0


@inlined
def base_speed(plant: Any, state: Any, c: int, tau: float) -> float:
    """Return the speed of a contact's base at a time within the step."""
    r = plant.base_rate[c]
    if r < 0:
        return plant.base[c, 0]
    angle = state.phase[r] + plant.rates[r] * tau
    return plant.base[c, 1] * math.sin(angle) + plant.base[c, 2] * math.cos(angle)


@kernel
def _lanes(plant: Any, laws: Any, state: Any, room: Any, nc: int, orders: int) -> None:
    """Sort the slipping contacts by tape, and put the constants of each into its registers."""
    tapes, used, at = laws.registers.shape[0], 0, 0
    for t in range(tapes):
        room.lane_ptr[t], room.place[t] = used, at
        for i in range(nc):
            c = room.cons[i]
            if state.mode[c] != STICK and plant.tape[c, 0 if state.mode[c] > 0 else 1] == t:
                room.lane[used] = i
                used += 1
        if used > room.lane_ptr[t]:
            at = constants(plant, laws, room, t, used, orders)
    room.lane_ptr[tapes], room.place[tapes] = used, at


@kernel
def constants(plant: Any, laws: Any, room: Any, t: int, last: int, orders: int) -> int:
    """Store the constants of lanes lane_ptr[t]..last - 1 in a tape's registers; return the end of these registers."""
    first, at, block = room.lane_ptr[t], room.place[t], laws.registers[t] * orders * WIDTH
    count, rows = last - first, laws.constant_rows
    end = at + whole_vectors(count) // WIDTH * block
    for i in range(at, end, block):
        clear_constants(laws, room.V, t, i, orders)
    for i in range(laws.par_ptr[t], laws.par_ptr[t + 1]):
        for j in range(whole_vectors(count)):
            c = room.cons[room.lane[first + min(j, count - 1)]]
            place = lane_place(at, block, laws.par_reg[i], orders, 0, j)
            room.V[place] = plant.par[c, i - laws.par_ptr[t]]
    advance_lanes(rows, laws.constant_ptr[t], laws.constant_ptr[t + 1], room.V, at, end, block, orders, 0)
    return end


@inlined
def _forces_of_slip(plant: Any, laws: Any, state: Any, room: Any, orders: int, k: int) -> None:
    """Compute coefficient k of all slip forces from that of the relative velocities."""
    for t in range(laws.registers.shape[0]):
        first, count, at = room.lane_ptr[t], room.lane_ptr[t + 1] - room.lane_ptr[t], room.place[t]
        block = laws.registers[t] * orders * WIDTH
        for j in range(whole_vectors(count)):
            i = room.lane[first + min(j, count - 1)]
            place = lane_place(at, block, laws.speed[t], orders, k, j)
            room.V[place] = state.mode[room.cons[i]] * room.R[k, i]
        rows, end = (laws.row_ptr[t], laws.row_ptr[t + 1]), at + whole_vectors(count) // WIDTH * block
        advance_lanes(laws.rows, rows[0], rows[1], room.V, at, end, block, orders, k)
        for j in range(count):
            i = room.lane[first + j]
            force = room.V[lane_place(at, block, laws.out[t], orders, k, j)]
            room.F[k, i] = state.mode[room.cons[i]] * force


@inlined
def _relative(plant: Any, state: Any, room: Any, nc: int, k: int) -> None:
    """Compute coefficient k of the relative velocities, exactly zero in stick."""
    cons, loc, mode, ptr, col, val = room.cons, room.loc, state.mode, plant.w_ptr, plant.w_col, plant.w_val
    q, r, f = room.Q[k + 1], room.R[k], room.F[k]
    for i in range(nc):
        c = cons[i]
        total = 0.0
        if mode[c] != STICK:
            for e in range(ptr[c], ptr[c + 1]):
                total += val[e] * q[loc[col[e]]]
            total = (k + 1) * total - base_coefficient(plant, room, c, k)
        r[i], f[i] = total, 0.0
        if k == 0 and state.held[c] != 0:
            f[i] = plant.limits[c, 0] if state.held[c] > 0 else -plant.limits[c, 1]


@inlined
def _accelerate(plant: Any, room: Any, nd: int, k: int) -> None:
    """Compute coefficient k of the accelerations, with slip forces but without those of sticking contacts."""
    dofs, loc, lcon, acc = room.dofs, room.loc, room.lcon, room.acc
    q, v, f = room.Q[k], room.Q[k + 1], room.F[k]
    k_ptr, k_col, k_val, b_ptr, b_col, b_val = (
        plant.k_ptr, plant.k_col, plant.k_val, plant.b_ptr, plant.b_col, plant.b_val,
    )  # fmt: skip
    for a in range(nd):
        x = dofs[a]
        total = plant.still[x] if k == 0 else 0.0
        for e in range(k_ptr[x], k_ptr[x + 1]):
            total -= k_val[e] * q[loc[k_col[e]]]
        for e in range(b_ptr[x], b_ptr[x + 1]):
            total -= b_val[e] * f[lcon[b_col[e]]]
        acc[a] = total
    if plant.c_col.shape[0] > 0:
        for a in range(nd):
            x, total = dofs[a], 0.0
            for e in range(plant.c_ptr[x], plant.c_ptr[x + 1]):
                total += plant.c_val[e] * v[loc[plant.c_col[e]]]
            acc[a] -= (k + 1) * total
    if plant.rates.shape[0] > 0:
        for a in range(nd):
            x = dofs[a]
            for e in range(plant.h_ptr[x], plant.h_ptr[x + 1]):
                r = plant.h_rate[e]
                acc[a] += plant.h_val[e, 0] * room.trig[r, 0, k] + plant.h_val[e, 1] * room.trig[r, 1, k]


@inlined
def _advance(plant: Any, state: Any, room: Any, nd: int, k: int) -> None:
    """Compute coefficient k + 2 of the positions from the accelerations, or from the base for a pinned coordinate."""
    dofs, acc, pin, q, divisor = room.dofs, room.acc, state.pin, room.Q[k + 2], float((k + 1) * (k + 2))
    for a in range(nd):
        c = pin[dofs[a]]
        if c < 0:
            q[a] = acc[a] / divisor
        elif plant.base_rate[c] < 0:
            q[a] = 0.0
        else:
            q[a] = base_coefficient(plant, room, c, k + 1) / plant.w_val[plant.w_ptr[c]] / (k + 2)


@inlined
def _hold_one(plant: Any, state: Any, room: Any, j: int, k: int) -> None:
    """Do the work of `_hold` for a node whose only contact sticks."""
    c, total = plant.node_con[j], 0.0
    for e in range(plant.w_ptr[c], plant.w_ptr[c + 1]):
        total += plant.w_val[e] * room.acc[room.loc[plant.w_col[e]]]
    force = state.pinv[plant.g_ptr[j]] * (total - (k + 1) * base_coefficient(plant, room, c, k + 1))
    room.F[k, room.lcon[c]] = force
    for x in range(plant.node_dof[j], plant.node_dof[j + 1]):
        if plant.b_ptr[x] < plant.b_ptr[x + 1]:
            room.acc[room.loc[x]] -= plant.b_val[plant.b_ptr[x]] * force


@kernel
def _hold(plant: Any, state: Any, room: Any, j: int, k: int) -> None:
    """Compute the forces of sticking contacts of a node, f = (W M^-1 W^T)^+ (W a - base'), and add their effect."""
    first, last = plant.node_con[j], plant.node_con[j + 1]
    m = last - first
    for c in range(first, last):
        room.tall[c - first, 0] = 0.0
        if state.mode[c] == STICK and state.held[c] == 0:
            total = -(k + 1) * base_coefficient(plant, room, c, k + 1)
            for e in range(plant.w_ptr[c], plant.w_ptr[c + 1]):
                total += plant.w_val[e] * room.acc[room.loc[plant.w_col[e]]]
            room.tall[c - first, 0] = total
    for c in range(first, last):
        if state.mode[c] == STICK and state.held[c] == 0:
            total, row = 0.0, plant.g_ptr[j] + (c - first) * m
            for i in range(m):
                total += state.pinv[row + i] * room.tall[i, 0]
            room.F[k, room.lcon[c]] = total
    for x in range(plant.node_dof[j], plant.node_dof[j + 1]):
        for e in range(plant.b_ptr[x], plant.b_ptr[x + 1]):
            c = plant.b_col[e]
            if state.mode[c] == STICK and state.held[c] == 0:
                room.acc[room.loc[x]] -= plant.b_val[e] * room.F[k, room.lcon[c]]


def expand(plant: Any, laws: Any, state: Any, room: Any) -> int:
    """Compute the series of the gathered patch, Q, R and F; see `expanded`."""
    count, nd, nc, top = state.whole[COUNT], state.whole[DOFS], state.whole[CONS], state.whole[ORDER]
    tau = state.real[AT]
    if state.whole[FIRST] >= 0:
        expand_run(plant, laws, state, room, count, top)
        return 0
    _angles(plant, state, room, tau, top)
    _lanes(plant, laws, state, room, nc, top + 1)
    for k in range(top - 1):
        _relative(plant, state, room, nc, k)
        _forces_of_slip(plant, laws, state, room, top + 1, k)
        _accelerate(plant, room, nd, k)
        for i in range(count):
            j = room.nodes[i]
            if state.holds[j] > 0:
                if plant.node_con[j + 1] - plant.node_con[j] == 1:
                    _hold_one(plant, state, room, j, k)
                else:
                    _hold(plant, state, room, j, k)
        _advance(plant, state, room, nd, k)
    _relative(plant, state, room, nc, top - 1)
    return 0


@inlined
def expanded(
    plant: Any, laws: Any, state: Any, room: Any, count: int, nd: int, nc: int, tau: float, top: int
) -> None:
    """Expand the patch with these counts of nodes, coordinates and contacts about tau, to order `top`."""
    state.whole[COUNT], state.whole[DOFS], state.whole[CONS], state.whole[ORDER] = count, nd, nc, top
    state.real[AT] = tau
    call_kernel(state.kernels[EXPAND], (plant, laws, state, room))
