"""Taylor series of a run of neighbours, eight at once: `hybridsim.mechanics.expansion` for blocks that stand in a row.

Coordinate and contact a of the patch are number first + a of the system. The series of what is beside the run stand in
the lanes before the first and after the last; what acts on nothing is zero there.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.eight import WIDTH, choose, load, put, splat, store, whole_vectors
from hybridsim.engine.jit import kernel
from hybridsim.mechanics.arrays import FIRST, STICK
from hybridsim.mechanics.bands import BASE, HOLDING, MOBILITY, STILL, VALUES, WEIGHT
from hybridsim.mechanics.lanes import advance_lanes, clear
from hybridsim.mechanics.polynomials import shift, value_and_slope

_SLIP, _BESIDE = 0, 1  # rows of masks: direction of slip of what is in the run, and what stands beside it


@kernel
def gather_run(plant: Any, state: Any, room: Any, count: int, tau: float, top: int) -> bool:
    """Put the values at tau of a patch in place, as `gather` does, if it is a run of neighbours."""
    first, last = room.nodes[0], room.nodes[0]
    for i in range(count):
        first, last = min(first, room.nodes[i]), max(last, room.nodes[i])
    if plant.offsets.shape[0] == 0 or last - first + 1 != count:
        return False
    state.whole[FIRST] = first
    clear_beside(plant, room, count, top)
    now, wide = room.stamp[-1], room.Q.shape[1]
    for a in range(count):
        x = first + a
        room.loc[x], room.dofs[a], room.lcon[x], room.cons[a] = a, x, a, x
        room.stamp[x] = now
        value, slope = value_and_slope(state.series[x], tau - state.origin[x])
        room.Q[0, a], room.Q[1, a] = value, slope
    for x in range(first, last + 1):
        for e in range(plant.near_ptr[x], plant.near_ptr[x + 1]):
            other = plant.near[e]
            if room.stamp[other] != now:
                room.stamp[other], room.loc[other] = now, count
                shift(state.series[other], tau - state.origin[other], top, room.line)
                for k in range(top + 1):
                    put(room.Q, k * wide + other - first, room.line[k])
    return True


@kernel
def clear_beside(plant: Any, room: Any, count: int, top: int) -> None:
    """Zeros in the lanes around a run, as far as anything acts."""
    wide, offsets = room.Q.shape[1], plant.offsets
    before, after = -min(offsets[0], 0), max(offsets[-1], 0)
    for k in range(top + 1):
        clear(room.Q, k * wide - whole_vectors(before), before)
        clear(room.Q, k * wide + count, after)


@kernel
def _masks(plant: Any, laws: Any, state: Any, room: Any, first: int, count: int, orders: int) -> None:
    """Who slips which way; and the constants of the law, in lanes that are all contacts."""
    n, wide, size = whole_vectors(count), room.Q.shape[1], plant.bands.shape[1]
    length = orders * n
    for a in range(n):
        room.masks[_SLIP, a] = float(state.mode[first + a]) if a < count else 0.0
        room.masks[_BESIDE, a] = 0.0 if a < count else 1.0
    for a in range(count):
        room.lane[a] = a
    room.lane_ptr[0], room.lane_ptr[1], room.place[0], room.place[1] = 0, count, 0, laws.registers[0] * length
    for i in range(laws.constant_rows.shape[0]):
        clear(room.V, laws.constant_rows[i, 4] * length, length)
    for i in range(laws.par_reg.shape[0]):
        spot = laws.par_reg[i] * length
        clear(room.V, spot, length)
        for a in range(0, n, WIDTH):
            store(room.V, spot + a, load(plant.bands, (VALUES + i) * size + first + a))
    for i in range(laws.number_reg.shape[0]):
        spot = laws.number_reg[i] * length
        clear(room.V, spot, length)
        for a in range(0, n, WIDTH):
            store(room.V, spot + a, splat(laws.number_val[i]))
    advance_lanes(laws.constant_rows, room.V, 0, orders, n, 0)


@kernel
def expand_run(plant: Any, laws: Any, state: Any, room: Any, count: int, top: int) -> None:
    """Series of the run that was gathered: Q (positions), R (relative velocities), F (forces)."""
    first, n, orders = state.whole[FIRST], whole_vectors(count), top + 1
    _masks(plant, laws, state, room, first, count, orders)
    Q, R, F, V, bands, masks, offsets = room.Q, room.R, room.F, room.V, plant.bands, room.masks, plant.offsets
    wide, size, zero = Q.shape[1], bands.shape[1], splat(0.0)
    diagonals = VALUES + plant.par.shape[1]
    damped = bands.shape[0] > diagonals + offsets.shape[0]
    speed, out = laws.speed[0] * orders * n, laws.out[0] * orders * n
    for k in range(top):
        row, step = k * wide, splat(k + 1.0)
        for a in range(0, n, WIDTH):
            slip = load(masks, a)
            relative = load(bands, WEIGHT * size + first + a) * load(Q, row + wide + a) * step
            if k == 0:
                relative = relative - load(bands, BASE * size + first + a)
            relative = choose(slip, relative, zero)
            store(R, row + a, relative)
            store(V, speed + k * n + a, slip * relative)
        if k == top - 1:
            break
        advance_lanes(laws.rows, V, 0, orders, n, k)
        divisor = splat((k + 1.0) * (k + 2.0))
        for a in range(0, n, WIDTH):
            slip = load(masks, a)
            force = choose(slip, slip * load(V, out + k * n + a), zero)
            change = load(bands, STILL * size + first + a) if k == 0 else zero
            for s in range(offsets.shape[0]):
                place = (diagonals + s) * size + first + a
                change = change - load(bands, place) * load(Q, row + a + offsets[s])
            change = change - load(bands, MOBILITY * size + first + a) * force
            if damped:
                total = zero
                for s in range(offsets.shape[0]):
                    place = (diagonals + offsets.shape[0] + s) * size + first + a
                    total = total + load(bands, place) * load(Q, row + wide + a + offsets[s])
                change = change - step * total
            holding = load(bands, HOLDING * size + first + a) * (
                load(bands, WEIGHT * size + first + a) * change
            )
            store(F, row + a, choose(slip, force, holding))
            beside = load(masks, wide + a)
            kept = choose(beside, load(Q, row + 2 * wide + a), zero)
            store(Q, row + 2 * wide + a, choose(slip, change / divisor, kept))
