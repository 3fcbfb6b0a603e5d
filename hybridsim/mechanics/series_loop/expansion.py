"""This module computes the Taylor series of coordinates, relative velocities and forces of some nodes.

All nodes of a patch are expanded together; the nodes around it enter by their existing series. When q is
known to order k + 1, the relative velocities have their coefficient k and the laws give the slip forces. The
forces of sticking contacts follow from w . q'' = base'. This gives coefficient k + 2 of q.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import call_kernel, inlined, kernel
from hybridsim.engine.native.simd.vectors import WIDTH, whole_vectors
from hybridsim.mechanics.codes import AT, CONS, COUNT, DOFS, EXPAND, FIRST, ORDER, STICK
from hybridsim.mechanics.polynomials import shift, state_at
from hybridsim.mechanics.series_loop.banded_series import clear_beside, expand_run
from hybridsim.mechanics.series_loop.simd_series import advance_simd_series, clear_constants, lane_place


@kernel
def gather(arrays: Any, state: Any, scratch: Any, count: int, tau: float, top: int) -> tuple[int, int]:
    """Number the coordinates and contacts of the nodes in scratch.nodes, and store their values at time tau.

    The nodes around them get series about tau. Returns the numbers of coordinates and contacts of the patch.
    """
    state.whole[FIRST] = -1
    scratch.stamp[-1] += 1
    now, nd, nc = scratch.stamp[-1], 0, 0
    for i in range(count):
        j = scratch.nodes[i]
        scratch.stamp[j] = now
        d = tau - state.origin[j]
        for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
            scratch.loc[x], scratch.dofs[nd] = nd, x
            value, slope = state_at(state.series, x, d)
            scratch.Q[0, nd], scratch.Q[1, nd] = value, slope
            nd += 1
        for c in range(arrays.node_con[j], arrays.node_con[j + 1]):
            scratch.lcon[c], scratch.cons[nc] = nc, c
            nc += 1
    lane = nd
    for i in range(count):
        j = scratch.nodes[i]
        for e in range(arrays.near_ptr[j], arrays.near_ptr[j + 1]):
            other = arrays.near[e]
            if scratch.stamp[other] == now:
                continue
            scratch.stamp[other] = now
            d = tau - state.origin[other]
            for x in range(arrays.node_dof[other], arrays.node_dof[other + 1]):
                scratch.loc[x] = lane
                shift(state.series, x, d, top, scratch.line)
                for k in range(top + 1):
                    scratch.Q[k, lane] = scratch.line[k]
                lane += 1
    return nd, nc


@kernel
def whole(arrays: Any, state: Any, scratch: Any, top: int) -> tuple[int, int]:
    """Select all coordinates as one patch, which starts at the beginning of the step."""
    state.whole[FIRST] = -1
    if arrays.offsets.shape[0] > 0:
        state.whole[FIRST] = 0
        clear_beside(arrays, scratch, arrays.dof_node.shape[0], top)
    n, m = arrays.dof_node.shape[0], arrays.con_node.shape[0]
    for j in range(arrays.node_dof.shape[0] - 1):
        scratch.nodes[j] = j
    for x in range(n):
        scratch.loc[x] = scratch.dofs[x] = x
        scratch.Q[0, x], scratch.Q[1, x] = state.x[0, x], state.x[1, x]
    for c in range(m):
        scratch.lcon[c] = scratch.cons[c] = c
    return n, m


@kernel
def _angles(arrays: Any, state: Any, scratch: Any, tau: float, top: int) -> None:
    """Compute the Taylor series of the sine and cosine of every angle about time tau."""
    for r in range(arrays.rates.shape[0]):
        rate = arrays.rates[r]
        angle = state.phase[r] + rate * tau
        scratch.trig[r, 0, 0], scratch.trig[r, 1, 0] = math.sin(angle), math.cos(angle)
        for k in range(1, top + 1):
            scratch.trig[r, 0, k] = rate * scratch.trig[r, 1, k - 1] / k
            scratch.trig[r, 1, k] = -rate * scratch.trig[r, 0, k - 1] / k


@inlined
def base_coefficient(arrays: Any, scratch: Any, c: int, k: int) -> float:
    """Return Taylor coefficient k of the speed of a contact's base."""
    r = arrays.base_rate[c]
    if r >= 0:
        return arrays.base[c, 1] * scratch.trig[r, 0, k] + arrays.base[c, 2] * scratch.trig[r, 1, k]
    return arrays.base[c, 0] if k == 0 else 0.0


@inlined
def base_speed(arrays: Any, state: Any, c: int, tau: float) -> float:
    """Return the speed of a contact's base at a time within the step."""
    r = arrays.base_rate[c]
    if r < 0:
        return arrays.base[c, 0]
    angle = state.phase[r] + arrays.rates[r] * tau
    return arrays.base[c, 1] * math.sin(angle) + arrays.base[c, 2] * math.cos(angle)


@kernel
def _fill_registers(arrays: Any, laws: Any, state: Any, scratch: Any, nc: int, orders: int) -> None:
    """Sort the slipping contacts by their law, and store the constants of each law in the registers."""
    tapes, used, at = laws.registers.shape[0], 0, 0
    for t in range(tapes):
        scratch.lane_ptr[t], scratch.place[t] = used, at
        for i in range(nc):
            c = scratch.cons[i]
            if state.mode[c] != STICK and arrays.tape[c, 0 if state.mode[c] > 0 else 1] == t:
                scratch.lane[used] = i
                used += 1
        if used > scratch.lane_ptr[t]:
            at = constants(arrays, laws, scratch, t, used, orders)
    scratch.lane_ptr[tapes], scratch.place[tapes] = used, at


@kernel
def constants(arrays: Any, laws: Any, scratch: Any, t: int, last: int, orders: int) -> int:
    """Store the constants of some contacts in the registers of an instruction tape; return the end of the registers."""
    first, at, block = scratch.lane_ptr[t], scratch.place[t], laws.registers[t] * orders * WIDTH
    count, rows = last - first, laws.constant_rows
    end = at + whole_vectors(count) // WIDTH * block
    for i in range(at, end, block):
        clear_constants(laws, scratch.V, t, i, orders)
    for i in range(laws.par_ptr[t], laws.par_ptr[t + 1]):
        for j in range(whole_vectors(count)):
            c = scratch.cons[scratch.lane[first + min(j, count - 1)]]
            place = lane_place(at, block, laws.par_reg[i], orders, 0, j)
            scratch.V[place] = arrays.par[c, i - laws.par_ptr[t]]
    advance_simd_series(
        rows, laws.constant_ptr[t], laws.constant_ptr[t + 1], scratch.V, at, end, block, orders, 0
    )
    return end


@inlined
def _forces_of_slip(arrays: Any, laws: Any, state: Any, scratch: Any, orders: int, k: int) -> None:
    """Compute coefficient k of all friction forces in slip from coefficients of the relative velocities."""
    for t in range(laws.registers.shape[0]):
        first = scratch.lane_ptr[t]
        count, at = scratch.lane_ptr[t + 1] - scratch.lane_ptr[t], scratch.place[t]
        block = laws.registers[t] * orders * WIDTH
        for j in range(whole_vectors(count)):
            i = scratch.lane[first + min(j, count - 1)]
            place = lane_place(at, block, laws.speed[t], orders, k, j)
            scratch.V[place] = state.mode[scratch.cons[i]] * scratch.R[k, i]
        rows, end = (laws.row_ptr[t], laws.row_ptr[t + 1]), at + whole_vectors(count) // WIDTH * block
        advance_simd_series(laws.rows, rows[0], rows[1], scratch.V, at, end, block, orders, k)
        for j in range(count):
            i = scratch.lane[first + j]
            force = scratch.V[lane_place(at, block, laws.out[t], orders, k, j)]
            scratch.F[k, i] = state.mode[scratch.cons[i]] * force


@inlined
def _relative(arrays: Any, state: Any, scratch: Any, nc: int, k: int) -> None:
    """Compute coefficient k of the relative velocities, which are exactly zero in stick."""
    cons, loc, mode = scratch.cons, scratch.loc, state.mode
    ptr, col, val = arrays.w_ptr, arrays.w_col, arrays.w_val
    q, r, f = scratch.Q[k + 1], scratch.R[k], scratch.F[k]
    for i in range(nc):
        c = cons[i]
        total = 0.0
        if mode[c] != STICK:
            for e in range(ptr[c], ptr[c + 1]):
                total += val[e] * q[loc[col[e]]]
            total = (k + 1) * total - base_coefficient(arrays, scratch, c, k)
        r[i], f[i] = total, 0.0
        if k == 0 and state.held[c] != 0:
            f[i] = arrays.limits[c, 0] if state.held[c] > 0 else -arrays.limits[c, 1]


@inlined
def _accelerate(arrays: Any, scratch: Any, nd: int, k: int) -> None:
    """Compute coefficient k of the accelerations without the forces of sticking contacts."""
    dofs, loc, lcon, acc = scratch.dofs, scratch.loc, scratch.lcon, scratch.acc
    q, v, f = scratch.Q[k], scratch.Q[k + 1], scratch.F[k]
    k_ptr, k_col, k_val, b_ptr, b_col, b_val = (
        arrays.k_ptr, arrays.k_col, arrays.k_val, arrays.b_ptr, arrays.b_col, arrays.b_val,
    )  # fmt: skip
    for a in range(nd):
        x = dofs[a]
        total = arrays.still[x] if k == 0 else 0.0
        for e in range(k_ptr[x], k_ptr[x + 1]):
            total -= k_val[e] * q[loc[k_col[e]]]
        for e in range(b_ptr[x], b_ptr[x + 1]):
            total -= b_val[e] * f[lcon[b_col[e]]]
        acc[a] = total
    if arrays.c_col.shape[0] > 0:
        for a in range(nd):
            x, total = dofs[a], 0.0
            for e in range(arrays.c_ptr[x], arrays.c_ptr[x + 1]):
                total += arrays.c_val[e] * v[loc[arrays.c_col[e]]]
            acc[a] -= (k + 1) * total
    if arrays.rates.shape[0] > 0:
        for a in range(nd):
            x = dofs[a]
            for e in range(arrays.h_ptr[x], arrays.h_ptr[x + 1]):
                r = arrays.h_rate[e]
                acc[a] += (
                    arrays.h_val[e, 0] * scratch.trig[r, 0, k] + arrays.h_val[e, 1] * scratch.trig[r, 1, k]
                )


@inlined
def _advance(arrays: Any, state: Any, scratch: Any, nd: int, k: int) -> None:
    """Compute coefficient k + 2 of the positions from the accelerations or, in stick, from the base."""
    dofs, acc = scratch.dofs, scratch.acc
    pin, q, divisor = state.pin, scratch.Q[k + 2], float((k + 1) * (k + 2))
    for a in range(nd):
        c = pin[dofs[a]]
        if c < 0:
            q[a] = acc[a] / divisor
        elif arrays.base_rate[c] < 0:
            q[a] = 0.0
        else:
            q[a] = base_coefficient(arrays, scratch, c, k + 1) / arrays.w_val[arrays.w_ptr[c]] / (k + 2)


@inlined
def _hold_one(arrays: Any, state: Any, scratch: Any, j: int, k: int) -> None:
    """Compute the holding force of a node if its only contact sticks; `_hold` is the general case."""
    c, total = arrays.node_con[j], 0.0
    for e in range(arrays.w_ptr[c], arrays.w_ptr[c + 1]):
        total += arrays.w_val[e] * scratch.acc[scratch.loc[arrays.w_col[e]]]
    force = state.pinv[arrays.g_ptr[j]] * (total - (k + 1) * base_coefficient(arrays, scratch, c, k + 1))
    scratch.F[k, scratch.lcon[c]] = force
    for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
        if arrays.b_ptr[x] < arrays.b_ptr[x + 1]:
            scratch.acc[scratch.loc[x]] -= arrays.b_val[arrays.b_ptr[x]] * force


@kernel
def _hold(arrays: Any, state: Any, scratch: Any, j: int, k: int) -> None:
    """Compute the forces of the sticking contacts of a node, and add their effect to the accelerations."""
    first, last = arrays.node_con[j], arrays.node_con[j + 1]
    m = last - first
    for c in range(first, last):
        scratch.tall[c - first, 0] = 0.0
        if state.mode[c] == STICK and state.held[c] == 0:
            total = -(k + 1) * base_coefficient(arrays, scratch, c, k + 1)
            for e in range(arrays.w_ptr[c], arrays.w_ptr[c + 1]):
                total += arrays.w_val[e] * scratch.acc[scratch.loc[arrays.w_col[e]]]
            scratch.tall[c - first, 0] = total
    for c in range(first, last):
        if state.mode[c] == STICK and state.held[c] == 0:
            total, row = 0.0, arrays.g_ptr[j] + (c - first) * m
            for i in range(m):
                total += state.pinv[row + i] * scratch.tall[i, 0]
            scratch.F[k, scratch.lcon[c]] = total
    for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
        for e in range(arrays.b_ptr[x], arrays.b_ptr[x + 1]):
            c = arrays.b_col[e]
            if state.mode[c] == STICK and state.held[c] == 0:
                scratch.acc[scratch.loc[x]] -= arrays.b_val[e] * scratch.F[k, scratch.lcon[c]]


def expand(arrays: Any, laws: Any, state: Any, scratch: Any) -> int:
    """Compute the Taylor series of the gathered patch: positions, relative velocities, friction forces."""
    count, nd, nc, top = state.whole[COUNT], state.whole[DOFS], state.whole[CONS], state.whole[ORDER]
    tau = state.real[AT]
    if state.whole[FIRST] >= 0:
        expand_run(arrays, laws, state, scratch, count, top)
        return 0
    _angles(arrays, state, scratch, tau, top)
    _fill_registers(arrays, laws, state, scratch, nc, top + 1)
    for k in range(top - 1):
        _relative(arrays, state, scratch, nc, k)
        _forces_of_slip(arrays, laws, state, scratch, top + 1, k)
        _accelerate(arrays, scratch, nd, k)
        for i in range(count):
            j = scratch.nodes[i]
            if state.holds[j] > 0:
                if arrays.node_con[j + 1] - arrays.node_con[j] == 1:
                    _hold_one(arrays, state, scratch, j, k)
                else:
                    _hold(arrays, state, scratch, j, k)
        _advance(arrays, state, scratch, nd, k)
    _relative(arrays, state, scratch, nc, top - 1)
    return 0


@inlined
def expanded(
    arrays: Any, laws: Any, state: Any, scratch: Any, count: int, nd: int, nc: int, tau: float, top: int
) -> None:
    """Expand a patch with the given numbers of nodes, coordinates and contacts about tau, to order `top`."""
    state.whole[COUNT], state.whole[DOFS], state.whole[CONS], state.whole[ORDER] = count, nd, nc, top
    state.real[AT] = tau
    call_kernel(state.kernels[EXPAND], (arrays, laws, state, scratch))
