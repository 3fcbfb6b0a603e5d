"""This module computes Taylor series of a run of neighbouring blocks, eight at a time.

It does the work of `hybridsim.mechanics.series_loop.expansion` for blocks in a row. Coordinate and contact a of the
patch have number first + a in the system. The lanes before and after the run hold the series of its neighbours, or
zeros.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.simd_vectors import (
    WIDTH,
    choose,
    larger,
    load,
    put,
    size,
    splat,
    store,
    whole_vectors,
)
from hybridsim.mechanics.arrays import FIRST
from hybridsim.mechanics.polynomials import shift, state_at
from hybridsim.mechanics.series_loop.bands import BASE, HOLDING, MOBILITY, STILL, VALUES, WEIGHT
from hybridsim.mechanics.series_loop.simd_series import advance_lanes, clear

# Rows of a strip: direction of slip inside the run; series of the neighbours; sign of the velocity and the
# base; effect of a force; holding; constant acceleration; diagonals.
_SLIP, _BESIDE, _FORWARD, _BASE, _MOBILITY, _HOLDING, _STILL, _DIAGONALS = range(8)


@kernel
def gather_run(plant: Any, state: Any, room: Any, count: int, tau: float, top: int) -> bool:
    """Store the values of a patch at tau as `gather` does, if it is a run of neighbours."""
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
        room.Q[0, a], room.Q[1, a] = state_at(state.series, x, tau - state.origin[x])
    for x in range(first, last + 1):
        for e in range(plant.near_ptr[x], plant.near_ptr[x + 1]):
            other = plant.near[e]
            if room.stamp[other] != now:
                room.stamp[other], room.loc[other] = now, count
                shift(state.series, other, tau - state.origin[other], top, room.line)
                for k in range(top + 1):
                    put(room.Q, k * wide + other - first, room.line[k])
    return True


@kernel
def clear_beside(plant: Any, room: Any, count: int, top: int) -> None:
    """Write zeros into the lanes around a run, as far as coupling reaches."""
    wide, offsets = room.Q.shape[1], plant.offsets
    before, after = -min(offsets[0], 0), max(offsets[-1], WIDTH)  # including the rest of the last vector
    for k in range(top + 1):
        clear(room.Q, k * wide - whole_vectors(before), before)
        clear(room.Q, k * wide + count, after)


@inlined
def _height(plant: Any) -> int:
    return (plant.bands.shape[0] - VALUES - plant.par.shape[1] + _DIAGONALS) * WIDTH


@kernel
def _lay_out(plant: Any, laws: Any, state: Any, room: Any, first: int, count: int, orders: int) -> None:
    """Lay out strips and law constants for each eight of the run.

    Every contact is a lane. Higher coefficients of constants are zero from the start, and the layout of the
    same eight is reused.
    """
    length, block, height = plant.bands.shape[1], laws.registers[0] * orders * WIDTH, _height(plant)
    strips, bands, W = room.strips, plant.bands, room.W
    diagonals, parameters = VALUES + plant.par.shape[1], laws.par_reg.shape[0]
    for g in range(whole_vectors(count) // WIDTH):
        s, x = g * height, first + g * WIDTH
        for i in range(WIDTH):
            inside = g * WIDTH + i < count
            strips[s + _SLIP * WIDTH + i] = float(state.mode[x + i]) if inside else 0.0
            strips[s + _BESIDE * WIDTH + i] = 0.0 if inside else 1.0
        slip, weight = load(strips, s + _SLIP * WIDTH), load(bands, WEIGHT * length + x)
        store(strips, s + _FORWARD * WIDTH, slip * weight)
        store(strips, s + _BASE * WIDTH, slip * load(bands, BASE * length + x))
        if room.laid[g] == x + 1:
            continue
        room.laid[g] = x + 1
        store(strips, s + _MOBILITY * WIDTH, load(bands, MOBILITY * length + x))
        store(strips, s + _HOLDING * WIDTH, load(bands, HOLDING * length + x) * weight)
        store(strips, s + _STILL * WIDTH, load(bands, STILL * length + x))
        for i in range(diagonals, bands.shape[0]):
            store(strips, s + (_DIAGONALS + i - diagonals) * WIDTH, load(bands, i * length + x))
        for i in range(parameters):
            store(W, g * block + laws.par_reg[i] * orders * WIDTH, load(bands, (VALUES + i) * length + x))
        for i in range(laws.number_reg.shape[0]):
            store(W, g * block + laws.number_reg[i] * orders * WIDTH, splat(laws.number_val[i]))
        begin, rows = g * block, laws.constant_rows
        advance_lanes(rows, 0, rows.shape[0], W, begin, begin + block, block, orders, 0)


@kernel
def expand_run(plant: Any, laws: Any, state: Any, room: Any, count: int, top: int) -> None:
    """Compute the series of the gathered run: Q (positions), R (relative velocities), F (forces)."""
    orders = room.Q.shape[0]  # the same for every request, so that the layout remains valid
    _lay_out(plant, laws, state, room, state.whole[FIRST], count, orders)
    Q, R, F, W, strips, offsets = room.Q, room.R, room.F, room.W, room.strips, plant.offsets
    wide, zero, shifts, law = Q.shape[1], splat(0.0), offsets.shape[0], laws.rows.shape[0]
    height, block = _height(plant), laws.registers[0] * orders * WIDTH
    groups, damped = (
        whole_vectors(count) // WIDTH,
        plant.bands.shape[0] > VALUES + plant.par.shape[1] + shifts,
    )
    speed, out = laws.speed[0] * orders * WIDTH, laws.out[0] * orders * WIDTH
    for k in range(top - 1):
        step, share = splat(k + 1.0), splat(1.0 / ((k + 1.0) * (k + 2.0)))
        for g in range(groups):
            s, row = g * height, k * wide + g * WIDTH
            forward = load(strips, s + _FORWARD * WIDTH) * step * load(Q, row + wide)
            if k == 0:
                forward = forward - load(strips, s + _BASE * WIDTH)
            store(W, g * block + speed + k * WIDTH, forward)
            store(R, row, load(strips, s + _SLIP * WIDTH) * forward)
        advance_lanes(laws.rows, 0, law, W, 0, groups * block, block, orders, k)
        for g in range(groups):
            s, row = g * height, k * wide + g * WIDTH
            slip, change = (
                load(strips, s + _SLIP * WIDTH),
                load(strips, s + _STILL * WIDTH) if k == 0 else zero,
            )
            place = s + _DIAGONALS * WIDTH
            for i in range(shifts):
                change = change - load(strips, place + i * WIDTH) * load(Q, row + offsets[i])
            if damped:
                total = zero
                for i in range(shifts):
                    total = total + load(strips, place + (shifts + i) * WIDTH) * load(
                        Q, row + wide + offsets[i]
                    )
                change = change - step * total
            force = slip * load(W, g * block + out + k * WIDTH)
            change = change - load(strips, s + _MOBILITY * WIDTH) * choose(slip, force, zero)
            store(F, row, choose(slip, force, load(strips, s + _HOLDING * WIDTH) * change))
            kept = choose(load(strips, s + _BESIDE * WIDTH), load(Q, row + 2 * wide), zero)
            store(Q, row + 2 * wide, choose(slip, change * share, kept))
    for g in range(groups):
        row = (top - 1) * wide + g * WIDTH
        forward = load(strips, g * height + _FORWARD * WIDTH) * splat(float(top)) * load(Q, row + wide)
        store(R, row, load(strips, g * height + _SLIP * WIDTH) * forward)


@kernel
def law_holds_in_run(plant: Any, laws: Any, room: Any, count: int, share: float) -> bool:
    """Return whether the forces in room.sums agree with the law at the velocities there, relative to their terms."""
    sums, W, strips = room.sums, room.W, room.strips
    orders, wide, height = room.Q.shape[0], sums.shape[1], _height(plant)
    block = laws.registers[0] * orders * WIDTH
    speed, out, zero, worst = (
        laws.speed[0] * orders * WIDTH,
        laws.out[0] * orders * WIDTH,
        splat(0.0),
        splat(0.0),
    )
    for g in range(whole_vectors(count) // WIDTH):
        a, slip = g * WIDTH, load(strips, g * height + _SLIP * WIDTH)
        store(W, g * block + speed, larger(slip * load(sums, a), zero))
    end = whole_vectors(count) // WIDTH * block
    advance_lanes(laws.rows, 0, laws.rows.shape[0], W, 0, end, block, orders, 0)
    for g in range(whole_vectors(count) // WIDTH):
        a, slip = g * WIDTH, load(strips, g * height + _SLIP * WIDTH)
        off = size(load(sums, wide + a) - slip * load(W, g * block + out))
        beyond = off - splat(share) * load(sums, 2 * wide + a)
        # NaN if a value is NaN
        worst = worst + choose(slip, larger(beyond, zero) + zero * beyond, zero)
    store(sums, 0, worst)
    for i in range(WIDTH):
        if not sums[0, i] <= 0.0:
            return False
    return True
