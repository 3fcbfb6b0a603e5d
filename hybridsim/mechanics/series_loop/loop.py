"""This module is the compiled loop: all nodes step together, and an event restarts the nodes that it affects.

The series of a node far from an event does not change: a jump of an acceleration changes coefficient 2 + 2 r
of the positions r couplings away. Beyond half the order nothing changes, and nearer nodes soon change by less
than the tolerance. An event therefore expands only a patch around it again, with the existing series of the
surroundings. The patch grows until its effect on the outside is below a fraction of the tolerance.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.native.simd_vectors import WIDTH, load, store
from hybridsim.engine.system.instant import phase_of, two_sum
from hybridsim.mechanics.arrays import CASCADE, DONE, FULL, LOST, OPEN_END
from hybridsim.mechanics.polynomials import shift, states_at
from hybridsim.mechanics.series_loop.banded_series import gather_run
from hybridsim.mechanics.series_loop.clusters import project
from hybridsim.mechanics.series_loop.decision import decided
from hybridsim.mechanics.series_loop.expansion import expanded, gather, whole
from hybridsim.mechanics.series_loop.steps import first_leaf, set_time, stretched

# flags: a step must begin; it is the last; radius of patches; events at one instant; node of the last event
FRESH, LAST, RADIUS, ROUNDS, WHERE = range(5)
_SHARE = 0.1  # of the tolerance; the change that a patch may cause outside
_ROUNDS = 1000  # events of one node at one instant


@kernel
def _hold(plant: Any, state: Any, room: Any) -> None:
    """Compute the phases of bases and forcing at the clock, and make velocities satisfy the stick constraints."""
    for r in range(plant.rates.shape[0]):
        state.phase[r] = phase_of(state.clock[0], state.clock[1], plant.rates[r], 0.0)
    for j in range(plant.node_dof.shape[0] - 1):
        if state.holds[j] > 0:
            project(plant, state, room, j, 0.0, state.x[1])


@kernel
def _begin_step(plant: Any, laws: Any, state: Any, room: Any, record: Any, control: Any, left: float) -> bool:
    """Expand all nodes at the origin of a step, and set the length of the step."""
    rtol, longest, top, keep, _ = control
    _hold(plant, state, room)
    count = plant.node_dof.shape[0] - 1
    state.origin[:] = 0.0
    nd, nc = whole(plant, state, room, top)
    expanded(plant, laws, state, room, count, nd, nc, 0.0, top)
    limit = min(left, longest)
    h = stretched(plant, laws, state, room, limit, rtol)
    if not h > 0.0:
        return False
    state.flags[LAST] = 1 if h >= left else 0
    state.clock[2] = left if h >= left else h
    half = state.tree.shape[0] // 2
    for k in range(top + 1):
        for x in range(0, nd, WIDTH):
            store(state.series, k * state.series.shape[1] + x, load(room.Q, k * room.Q.shape[1] + x))
    for c in range(nc):
        state.until[c], state.guard[c] = room.exits[c], room.kinds[c]
        state.tree[half + c] = state.until[c]
    for i in range(half + nc, 2 * half):
        state.tree[i] = OPEN_END
    for i in range(half - 1, 0, -1):
        state.tree[i] = min(state.tree[2 * i], state.tree[2 * i + 1])
    if keep:
        _keep(plant, state, room, record, count, 0.0)
    state.counts[0] += 1
    return True


@kernel
def _keep(plant: Any, state: Any, room: Any, record: Any, count: int, tau: float) -> None:
    """Record the series of the nodes room.nodes[:count]."""
    for i in range(count):
        j, at, row = room.nodes[i], record.used[0], record.used[1]
        record.piece[at, 0], record.piece[at, 1] = j, row
        record.start[at, 0], record.start[at, 1], record.start[at, 2] = state.clock[0], state.clock[1], tau
        for x in range(plant.node_dof[j], plant.node_dof[j + 1]):
            for k in range(state.series.shape[0]):
                record.series[row, k] = state.series[k, x]
            row += 1
        record.used[0], record.used[1] = at + 1, row


@kernel
def _grow(plant: Any, room: Any, j: int, radius: int, most: int) -> tuple[int, int]:
    """Write the nodes within `radius` couplings of j to room.nodes; return their number and the first outer one.

    Returns (-1, 0) if there are more than `most`.
    """
    room.stamp[-1] += 1
    now, count, outer = room.stamp[-1], 1, 0
    room.nodes[0] = j
    room.stamp[j] = now
    for _ in range(radius):
        end = count
        for i in range(outer, end):
            a = room.nodes[i]
            for e in range(plant.near_ptr[a], plant.near_ptr[a + 1]):
                other = plant.near[e]
                if room.stamp[other] != now:
                    if count >= most:
                        return -1, 0
                    room.stamp[other] = now
                    room.nodes[count] = other
                    count += 1
        if end == count:
            return count, count  # the whole component: nothing is outside
        outer = end
    return count, outer


@kernel
def _changes_outside(
    plant: Any,
    state: Any,
    room: Any,
    count: int,
    outer: int,
    nd: int,
    tau: float,
    h: float,
    top: int,
    rtol: float,
) -> float:
    """Return the change that the new series of the outermost nodes cause outside over a time h, in tolerances."""
    worst = 0.0
    for i in range(outer, count):
        j = room.nodes[i]
        d = tau - state.origin[j]
        for x in range(plant.node_dof[j], plant.node_dof[j + 1]):
            shift(state.series, x, d, top, room.line)
            position, velocity, power = 0.0, 0.0, 1.0
            for k in range(2, top + 1):
                difference = abs(room.Q[k, room.loc[x]] - room.line[k])
                velocity += k * difference * power * h
                power *= h
                position += difference * power * h
            # effect on an outside coordinate y: |d a_y| <= |K_yx| position + |C_yx| velocity
            for e in range(plant.near_ptr[j], plant.near_ptr[j + 1]):
                other = plant.near[e]
                if room.loc[plant.node_dof[other]] < nd:
                    continue  # inside
                for y in range(plant.node_dof[other], plant.node_dof[other + 1]):
                    push = 0.0
                    for f in range(plant.k_ptr[y], plant.k_ptr[y + 1]):
                        if plant.k_col[f] == x:
                            push += abs(plant.k_val[f]) * position
                    for f in range(plant.c_ptr[y], plant.c_ptr[y + 1]):
                        if plant.c_col[f] == x:
                            push += abs(plant.c_val[f]) * velocity
                    value, slope = abs(state.series[0, y]), abs(state.series[1, y])
                    worst = max(worst, 0.5 * push * h * h / (state.tolerance[0, y] + rtol * value))
                    worst = max(worst, push * h / (state.tolerance[1, y] + rtol * slope))
    return worst


@kernel
def _restart(
    plant: Any, laws: Any, state: Any, room: Any, record: Any, control: Any, j: int, tau: float
) -> int:
    """Expand a patch around node j at tau; return 1 if done, 0 if it is too large, -1 without a series."""
    rtol, _, top, keep, _ = control
    nodes = plant.node_dof.shape[0] - 1
    left = state.clock[2] - tau
    radius = max(state.flags[RADIUS], 1)
    while True:
        count, outer = _grow(plant, room, j, radius, nodes // 2)
        if not (0 <= count <= nodes // 2 and left > 0.0):
            return 0
        nd = nc = count
        if not gather_run(plant, state, room, count, tau, top):
            nd, nc = gather(plant, state, room, count, tau, top)
        expanded(plant, laws, state, room, count, nd, nc, tau, top)
        outside = 0.0
        if outer < count and 2 * radius + 2 <= top:
            outside = _changes_outside(plant, state, room, count, outer, nd, tau, left, top, rtol)
            if not outside <= _SHARE:
                radius += 1
                state.flags[RADIUS] = radius
                continue
        break
    if outside < 1e-3 * _SHARE:
        state.flags[RADIUS] = max(radius - 1, 1)
    h = stretched(plant, laws, state, room, left, rtol)
    if not h > 0.0:
        return -1
    for k in range(top + 1):
        for a in range(nd):
            state.series[k, room.dofs[a]] = room.Q[k, a]
    for i in range(nc):
        c = room.cons[i]
        state.until[c], state.guard[c] = tau + room.exits[i], room.kinds[i]
        set_time(state.tree, c, state.until[c])
    for i in range(count):
        state.origin[room.nodes[i]] = tau
    if h < left:  # the step of all nodes ends where the first series ends
        state.clock[2], state.flags[LAST] = tau + h, 0
    if keep:
        _keep(plant, state, room, record, count, tau)
    state.counts[2] += 1
    state.counts[3] += count
    return 1


@kernel
def _note(plant: Any, state: Any, room: Any, record: Any, j: int, tau: float, fired: int, kind: int) -> None:
    """Record the changes of mode of a node."""
    for c in range(plant.node_con[j], plant.node_con[j + 1]):
        if state.mode[c] == room.before[c]:
            continue
        at = record.used[2]
        record.event[at, 0], record.event[at, 1], record.event[at, 2] = c, room.before[c], state.mode[c]
        record.event[at, 3] = kind if c == fired else -1
        record.when[at, 0], record.when[at, 1], record.when[at, 2] = state.clock[0], state.clock[1], tau
        record.used[2] = at + 1
        state.counts[1] += 1


@kernel
def _end_step(plant: Any, state: Any, room: Any, tau: float) -> None:
    """Move all positions and velocities to tau, which becomes the origin."""
    for x in range(plant.dof_node.shape[0]):
        room.acc[x] = tau - state.origin[plant.dof_node[x]]
    for x in range(0, plant.dof_node.shape[0], WIDTH):
        value, slope = states_at(state.series, x, load(room.acc, x))
        store(room.sums, x, value)
        store(room.sums, room.sums.shape[1] + x, slope)
    for x in range(plant.dof_node.shape[0]):
        state.x[0, x], state.x[1, x] = room.sums[0, x], room.sums[1, x]
    for c in range(plant.con_node.shape[0]):
        state.stamp[c] = 0.0 if state.stamp[c] == tau else -1.0  # exact zeros hold at this instant only
    high, error = two_sum(state.clock[0], tau)
    state.clock[0], state.clock[1] = two_sum(high, error + state.clock[1])
    state.clock[3] = 0.0
    state.flags[FRESH] = 1


@kernel
def run(plant: Any, laws: Any, state: Any, room: Any, record: Any, control: Any, target: Any) -> int:
    """Continue to the target (high, low), or until no continuation exists (see `arrays`).

    It returns FULL if the record is full, or after the largest number of steps and events of one call.
    """
    nodes, m, n = plant.node_dof.shape[0] - 1, plant.con_node.shape[0], plant.dof_node.shape[0]
    while True:
        room_left = record.piece.shape[0] - record.used[0] >= nodes
        room_left = room_left and record.series.shape[0] - record.used[1] >= n
        if (control[3] and not room_left) or record.event.shape[0] - record.used[2] < m:
            return FULL
        if state.counts[0] + state.counts[1] >= control[4]:
            return FULL
        if state.flags[FRESH]:
            left = (target[0] - state.clock[0]) + (target[1] - state.clock[1])
            if not left > 0.0:
                _hold(plant, state, room)  # the series of the last step satisfy them only to the tolerance
                return DONE
            if not _begin_step(plant, laws, state, room, record, control, left):
                return LOST
            state.flags[FRESH] = 0
        tau = state.tree[1]
        if tau > state.clock[2]:
            _end_step(plant, state, room, state.clock[2])
            if state.flags[LAST]:
                state.clock[0], state.clock[1] = target[0], target[1]
            continue
        fired = first_leaf(state.tree)
        j, kind = plant.con_node[fired], state.guard[fired]
        state.flags[ROUNDS] = state.flags[ROUNDS] + 1 if tau == state.clock[3] else 0
        state.flags[WHERE], state.clock[3] = j, tau
        code = decided(plant, laws, state, room, j, tau, fired)
        if code != 0:
            return code
        _note(plant, state, room, record, j, tau, fired, kind)
        if state.flags[ROUNDS] > _ROUNDS + m:
            return CASCADE
        done = _restart(plant, laws, state, room, record, control, j, tau)
        if done < 0:
            return LOST
        if done == 0:
            _end_step(plant, state, room, tau)
