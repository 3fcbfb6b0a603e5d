"""This module contains the compiled loop, in which all nodes step together and an event restarts nearby nodes.

The series of a node far from an event does not change: a jump of an acceleration changes coefficient 2 + 2 r
of the positions r couplings away. Beyond half the order nothing changes, and nearer nodes soon change by less
than the tolerance. An event therefore expands only a patch around it again, with the existing series of the
surroundings. The patch grows until its effect on the outside is below a fraction of the tolerance.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.native.simd.vectors import WIDTH, load, store
from hybridsim.engine.system.instant import phase_of, two_sum
from hybridsim.mechanics.codes import CASCADE, DONE, FULL, LOST, OPEN_END
from hybridsim.mechanics.polynomials import shift, states_at
from hybridsim.mechanics.series_loop.banded_series import gather_neighbours
from hybridsim.mechanics.series_loop.clusters import project
from hybridsim.mechanics.series_loop.decision import joint_choice
from hybridsim.mechanics.series_loop.expansion import expanded, gather, whole
from hybridsim.mechanics.series_loop.steps import first_leaf, set_time, step_length

# flags: a step must begin; it is the last; radius of patches; events at one instant; node of the last event
FRESH, LAST, RADIUS, ROUNDS, WHERE = range(5)
_SHARE = 0.1  # of the tolerance; the change that a patch may cause outside
_ROUNDS = 1000  # events of one node at one instant


@kernel
def _hold(arrays: Any, state: Any, scratch: Any) -> None:
    """Compute the phases of bases and forcing, and make the velocities satisfy the stick constraints."""
    for r in range(arrays.rates.shape[0]):
        state.phase[r] = phase_of(state.clock[0], state.clock[1], arrays.rates[r], 0.0)
    for j in range(arrays.node_dof.shape[0] - 1):
        if state.holds[j] > 0:
            project(arrays, state, scratch, j, 0.0, state.x[1])


@kernel
def _begin_step(
    arrays: Any, laws: Any, state: Any, scratch: Any, record: Any, control: Any, left: float
) -> bool:
    """Expand the series of all nodes at the beginning of a step, and choose the length of the step."""
    rtol, longest, top, is_recorded, _ = control
    _hold(arrays, state, scratch)
    count = arrays.node_dof.shape[0] - 1
    state.origin[:] = 0.0
    nd, nc = whole(arrays, state, scratch, top)
    expanded(arrays, laws, state, scratch, count, nd, nc, 0.0, top)
    limit = min(left, longest)
    h = step_length(arrays, laws, state, scratch, limit, rtol)
    if not h > 0.0:
        return False
    state.flags[LAST] = 1 if h >= left else 0
    state.clock[2] = left if h >= left else h
    half = state.tree.shape[0] // 2
    for k in range(top + 1):
        for x in range(0, nd, WIDTH):
            store(state.series, k * state.series.shape[1] + x, load(scratch.Q, k * scratch.Q.shape[1] + x))
    for c in range(nc):
        state.until[c], state.guard[c] = scratch.exits[c], scratch.kinds[c]
        state.tree[half + c] = state.until[c]
    for i in range(half + nc, 2 * half):
        state.tree[i] = OPEN_END
    for i in range(half - 1, 0, -1):
        state.tree[i] = min(state.tree[2 * i], state.tree[2 * i + 1])
    if is_recorded:
        _record_series(arrays, state, scratch, record, count, 0.0)
    state.counts[0] += 1
    return True


@kernel
def _record_series(arrays: Any, state: Any, scratch: Any, record: Any, count: int, tau: float) -> None:
    """Record the Taylor series of the nodes in scratch.nodes[:count]."""
    for i in range(count):
        j, at, row = scratch.nodes[i], record.used[0], record.used[1]
        record.segment[at, 0], record.segment[at, 1] = j, row
        record.start[at, 0], record.start[at, 1], record.start[at, 2] = state.clock[0], state.clock[1], tau
        for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
            for k in range(state.series.shape[0]):
                record.series[row, k] = state.series[k, x]
            row += 1
        record.used[0], record.used[1] = at + 1, row


@kernel
def _grow(arrays: Any, scratch: Any, j: int, radius: int, most: int) -> tuple[int, int]:
    """Write the nodes within `radius` couplings of node j to scratch.nodes; return (count, first outer node).

    Returns (-1, 0) if there are more than `most`.
    """
    scratch.stamp[-1] += 1
    now, count, outer = scratch.stamp[-1], 1, 0
    scratch.nodes[0] = j
    scratch.stamp[j] = now
    for _ in range(radius):
        end = count
        for i in range(outer, end):
            a = scratch.nodes[i]
            for e in range(arrays.near_ptr[a], arrays.near_ptr[a + 1]):
                other = arrays.near[e]
                if scratch.stamp[other] != now:
                    if count >= most:
                        return -1, 0
                    scratch.stamp[other] = now
                    scratch.nodes[count] = other
                    count += 1
        if end == count:
            return count, count  # the whole component: nothing is outside
        outer = end
    return count, outer


@kernel
def _changes_outside(
    arrays: Any,
    state: Any,
    scratch: Any,
    count: int,
    outer: int,
    nd: int,
    tau: float,
    h: float,
    top: int,
    rtol: float,
) -> float:
    """Return how much nodes outside a patch change, relatively, over time h if its outermost nodes get new series."""
    worst = 0.0
    for i in range(outer, count):
        j = scratch.nodes[i]
        d = tau - state.origin[j]
        for x in range(arrays.node_dof[j], arrays.node_dof[j + 1]):
            shift(state.series, x, d, top, scratch.line)
            position, velocity, power = 0.0, 0.0, 1.0
            for k in range(2, top + 1):
                difference = abs(scratch.Q[k, scratch.loc[x]] - scratch.line[k])
                velocity += k * difference * power * h
                power *= h
                position += difference * power * h
            # effect on an outside coordinate y: |d a_y| <= |K_yx| position + |C_yx| velocity
            for e in range(arrays.near_ptr[j], arrays.near_ptr[j + 1]):
                other = arrays.near[e]
                if scratch.loc[arrays.node_dof[other]] < nd:
                    continue  # inside
                for y in range(arrays.node_dof[other], arrays.node_dof[other + 1]):
                    push = 0.0
                    for f in range(arrays.k_ptr[y], arrays.k_ptr[y + 1]):
                        if arrays.k_col[f] == x:
                            push += abs(arrays.k_val[f]) * position
                    for f in range(arrays.c_ptr[y], arrays.c_ptr[y + 1]):
                        if arrays.c_col[f] == x:
                            push += abs(arrays.c_val[f]) * velocity
                    value, slope = abs(state.series[0, y]), abs(state.series[1, y])
                    worst = max(worst, 0.5 * push * h * h / (state.tolerance[0, y] + rtol * value))
                    worst = max(worst, push * h / (state.tolerance[1, y] + rtol * slope))
    return worst


@kernel
def _restart(
    arrays: Any, laws: Any, state: Any, scratch: Any, record: Any, control: Any, j: int, tau: float
) -> int:
    """Restart a patch around node j at tau; return 1 for success, 0 for a patch that is too large, -1 for no series."""
    rtol, _, top, is_recorded, _ = control
    nodes = arrays.node_dof.shape[0] - 1
    left = state.clock[2] - tau
    radius = max(state.flags[RADIUS], 1)
    while True:
        count, outer = _grow(arrays, scratch, j, radius, nodes // 2)
        if not (0 <= count <= nodes // 2 and left > 0.0):
            return 0
        nd = nc = count
        if not gather_neighbours(arrays, state, scratch, count, tau, top):
            nd, nc = gather(arrays, state, scratch, count, tau, top)
        expanded(arrays, laws, state, scratch, count, nd, nc, tau, top)
        outside = 0.0
        if outer < count and 2 * radius + 2 <= top:
            outside = _changes_outside(arrays, state, scratch, count, outer, nd, tau, left, top, rtol)
            if not outside <= _SHARE:
                radius += 1
                state.flags[RADIUS] = radius
                continue
        break
    if outside < 1e-3 * _SHARE:
        state.flags[RADIUS] = max(radius - 1, 1)
    h = step_length(arrays, laws, state, scratch, left, rtol)
    if not h > 0.0:
        return -1
    for k in range(top + 1):
        for a in range(nd):
            state.series[k, scratch.dofs[a]] = scratch.Q[k, a]
    for i in range(nc):
        c = scratch.cons[i]
        state.until[c], state.guard[c] = tau + scratch.exits[i], scratch.kinds[i]
        set_time(state.tree, c, state.until[c])
    for i in range(count):
        state.origin[scratch.nodes[i]] = tau
    if h < left:  # the step of all nodes ends where the first series ends
        state.clock[2], state.flags[LAST] = tau + h, 0
    if is_recorded:
        _record_series(arrays, state, scratch, record, count, tau)
    state.counts[2] += 1
    state.counts[3] += count
    return 1


@kernel
def _record_events(
    arrays: Any, state: Any, scratch: Any, record: Any, j: int, tau: float, fired: int, kind: int
) -> None:
    """Record the changes of mode of a node."""
    for c in range(arrays.node_con[j], arrays.node_con[j + 1]):
        if state.mode[c] == scratch.before[c]:
            continue
        at = record.used[2]
        record.event[at, 0], record.event[at, 1], record.event[at, 2] = c, scratch.before[c], state.mode[c]
        record.event[at, 3] = kind if c == fired else -1
        record.when[at, 0], record.when[at, 1], record.when[at, 2] = state.clock[0], state.clock[1], tau
        record.used[2] = at + 1
        state.counts[1] += 1


@kernel
def _end_step(arrays: Any, state: Any, scratch: Any, tau: float) -> None:
    """Evaluate all positions and velocities at tau, and begin the next step at tau."""
    for x in range(arrays.dof_node.shape[0]):
        scratch.acc[x] = tau - state.origin[arrays.dof_node[x]]
    for x in range(0, arrays.dof_node.shape[0], WIDTH):
        value, slope = states_at(state.series, x, load(scratch.acc, x))
        store(scratch.sums, x, value)
        store(scratch.sums, scratch.sums.shape[1] + x, slope)
    for x in range(arrays.dof_node.shape[0]):
        state.x[0, x], state.x[1, x] = scratch.sums[0, x], scratch.sums[1, x]
    for c in range(arrays.con_node.shape[0]):
        state.stamp[c] = 0.0 if state.stamp[c] == tau else -1.0  # exact zeros hold at this instant only
    high, error = two_sum(state.clock[0], tau)
    state.clock[0], state.clock[1] = two_sum(high, error + state.clock[1])
    state.clock[3] = 0.0
    state.flags[FRESH] = 1


@kernel
def run(arrays: Any, laws: Any, state: Any, scratch: Any, record: Any, control: Any, target: Any) -> int:
    """Advance the run to a time, which is the sum of two doubles, or until no combination of modes is admissible.

    It returns FULL if the record is full, or after the largest number of steps and events of one call.
    """
    nodes, m, n = arrays.node_dof.shape[0] - 1, arrays.con_node.shape[0], arrays.dof_node.shape[0]
    while True:
        has_space = record.segment.shape[0] - record.used[0] >= nodes
        has_space = has_space and record.series.shape[0] - record.used[1] >= n
        if (control[3] and not has_space) or record.event.shape[0] - record.used[2] < m:
            return FULL
        if state.counts[0] + state.counts[1] >= control[4]:
            return FULL
        if state.flags[FRESH]:
            left = (target[0] - state.clock[0]) + (target[1] - state.clock[1])
            if not left > 0.0:
                _hold(
                    arrays, state, scratch
                )  # the series of the last step satisfy them only to the tolerance
                return DONE
            if not _begin_step(arrays, laws, state, scratch, record, control, left):
                return LOST
            state.flags[FRESH] = 0
        tau = state.tree[1]
        if tau > state.clock[2]:
            _end_step(arrays, state, scratch, state.clock[2])
            if state.flags[LAST]:
                state.clock[0], state.clock[1] = target[0], target[1]
            continue
        fired = first_leaf(state.tree)
        j, kind = arrays.con_node[fired], state.guard[fired]
        state.flags[ROUNDS] = state.flags[ROUNDS] + 1 if tau == state.clock[3] else 0
        state.flags[WHERE], state.clock[3] = j, tau
        code = joint_choice(arrays, laws, state, scratch, j, tau, fired)
        if code != 0:
            return code
        _record_events(arrays, state, scratch, record, j, tau, fired, kind)
        if state.flags[ROUNDS] > _ROUNDS + m:
            return CASCADE
        done = _restart(arrays, laws, state, scratch, record, control, j, tau)
        if done < 0:
            return LOST
        if done == 0:
            _end_step(arrays, state, scratch, tau)
