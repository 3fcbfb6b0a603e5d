"""This module computes Taylor series of consecutive blocks of a chain, eight blocks at a time.

It does the work of `hybridsim.mechanics.series_loop.expansion` for blocks in a row. Coordinate and contact a of the
patch have number first + a in the system. The lanes before and after the run hold the series of its neighbours, or
zeros.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.simd.vectors import (
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
from hybridsim.mechanics.codes import FIRST
from hybridsim.mechanics.polynomials import shift, state_at
from hybridsim.mechanics.series_loop.bands import BASE, HOLDING, MOBILITY, STILL, VALUES, WEIGHT
from hybridsim.mechanics.series_loop.simd_series import advance_simd_series, clear

# Rows of `band_rows`: direction of slip inside the run; series of the neighbours; sign of the velocity and the
# base; effect of a force; holding; constant acceleration; diagonals.
_SLIP, _BESIDE, _FORWARD, _BASE, _MOBILITY, _HOLDING, _STILL, _DIAGONALS = range(8)


@kernel
def gather_neighbours(arrays: Any, state: Any, scratch: Any, count: int, tau: float, top: int) -> bool:
    """Copy the state of the patch at time tau if its nodes are consecutive; return whether they are."""
    first, last = scratch.nodes[0], scratch.nodes[0]
    for i in range(count):
        first, last = min(first, scratch.nodes[i]), max(last, scratch.nodes[i])
    if arrays.offsets.shape[0] == 0 or last - first + 1 != count:
        return False
    state.whole[FIRST] = first
    clear_beside(arrays, scratch, count, top)
    now, wide = scratch.stamp[-1], scratch.Q.shape[1]
    for a in range(count):
        x = first + a
        scratch.loc[x], scratch.dofs[a], scratch.lcon[x], scratch.cons[a] = a, x, a, x
        scratch.stamp[x] = now
        scratch.Q[0, a], scratch.Q[1, a] = state_at(state.series, x, tau - state.origin[x])
    for x in range(first, last + 1):
        for e in range(arrays.near_ptr[x], arrays.near_ptr[x + 1]):
            other = arrays.near[e]
            if scratch.stamp[other] != now:
                scratch.stamp[other], scratch.loc[other] = now, count
                shift(state.series, other, tau - state.origin[other], top, scratch.line)
                for k in range(top + 1):
                    put(scratch.Q, k * wide + other - first, scratch.line[k])
    return True


@kernel
def clear_beside(arrays: Any, scratch: Any, count: int, top: int) -> None:
    """Write zeros next to the values of consecutive nodes, as far as the coupling reaches."""
    wide, offsets = scratch.Q.shape[1], arrays.offsets
    before, after = -min(offsets[0], 0), max(offsets[-1], WIDTH)  # including padding of the last vector
    for k in range(top + 1):
        clear(scratch.Q, k * wide - whole_vectors(before), before)
        clear(scratch.Q, k * wide + count, after)


@inlined
def _height(arrays: Any) -> int:
    return (arrays.bands.shape[0] - VALUES - arrays.par.shape[1] + _DIAGONALS) * WIDTH


@kernel
def _lay_out(arrays: Any, laws: Any, state: Any, scratch: Any, first: int, count: int, orders: int) -> None:
    """Arrange the coefficients and the law constants of each group of eight nodes.

    Every contact is a lane. Higher coefficients of constants are zero from the start, and the layout of the
    same eight is reused.
    """
    length, block, height = arrays.bands.shape[1], laws.registers[0] * orders * WIDTH, _height(arrays)
    band_rows, bands, W = scratch.band_rows, arrays.bands, scratch.W
    diagonals, parameters = VALUES + arrays.par.shape[1], laws.par_reg.shape[0]
    for g in range(whole_vectors(count) // WIDTH):
        s, x = g * height, first + g * WIDTH
        for i in range(WIDTH):
            inside = g * WIDTH + i < count
            band_rows[s + _SLIP * WIDTH + i] = float(state.mode[x + i]) if inside else 0.0
            band_rows[s + _BESIDE * WIDTH + i] = 0.0 if inside else 1.0
        slip, weight = load(band_rows, s + _SLIP * WIDTH), load(bands, WEIGHT * length + x)
        store(band_rows, s + _FORWARD * WIDTH, slip * weight)
        store(band_rows, s + _BASE * WIDTH, slip * load(bands, BASE * length + x))
        if scratch.band_first[g] == x + 1:
            continue
        scratch.band_first[g] = x + 1
        store(band_rows, s + _MOBILITY * WIDTH, load(bands, MOBILITY * length + x))
        store(band_rows, s + _HOLDING * WIDTH, load(bands, HOLDING * length + x) * weight)
        store(band_rows, s + _STILL * WIDTH, load(bands, STILL * length + x))
        for i in range(diagonals, bands.shape[0]):
            store(band_rows, s + (_DIAGONALS + i - diagonals) * WIDTH, load(bands, i * length + x))
        for i in range(parameters):
            store(W, g * block + laws.par_reg[i] * orders * WIDTH, load(bands, (VALUES + i) * length + x))
        for i in range(laws.number_reg.shape[0]):
            store(W, g * block + laws.number_reg[i] * orders * WIDTH, splat(laws.number_val[i]))
        begin, rows = g * block, laws.constant_rows
        advance_simd_series(rows, 0, rows.shape[0], W, begin, begin + block, block, orders, 0)


@kernel
def expand_run(arrays: Any, laws: Any, state: Any, scratch: Any, count: int, top: int) -> None:
    """Compute the series of consecutive nodes: Q (positions), R (relative velocities), F (forces)."""
    orders = scratch.Q.shape[0]  # the same for every request, so that the layout remains valid
    _lay_out(arrays, laws, state, scratch, state.whole[FIRST], count, orders)
    Q, R, F = scratch.Q, scratch.R, scratch.F
    W, band_rows, offsets = scratch.W, scratch.band_rows, arrays.offsets
    wide, zero, shifts, law = Q.shape[1], splat(0.0), offsets.shape[0], laws.rows.shape[0]
    height, block = _height(arrays), laws.registers[0] * orders * WIDTH
    groups, damped = (
        whole_vectors(count) // WIDTH,
        arrays.bands.shape[0] > VALUES + arrays.par.shape[1] + shifts,
    )
    speed, out = laws.speed[0] * orders * WIDTH, laws.out[0] * orders * WIDTH
    for k in range(top - 1):
        step, share = splat(k + 1.0), splat(1.0 / ((k + 1.0) * (k + 2.0)))
        for g in range(groups):
            s, row = g * height, k * wide + g * WIDTH
            forward = load(band_rows, s + _FORWARD * WIDTH) * step * load(Q, row + wide)
            if k == 0:
                forward = forward - load(band_rows, s + _BASE * WIDTH)
            store(W, g * block + speed + k * WIDTH, forward)
            store(R, row, load(band_rows, s + _SLIP * WIDTH) * forward)
        advance_simd_series(laws.rows, 0, law, W, 0, groups * block, block, orders, k)
        for g in range(groups):
            s, row = g * height, k * wide + g * WIDTH
            slip, change = (
                load(band_rows, s + _SLIP * WIDTH),
                load(band_rows, s + _STILL * WIDTH) if k == 0 else zero,
            )
            place = s + _DIAGONALS * WIDTH
            for i in range(shifts):
                change = change - load(band_rows, place + i * WIDTH) * load(Q, row + offsets[i])
            if damped:
                total = zero
                for i in range(shifts):
                    total = total + load(band_rows, place + (shifts + i) * WIDTH) * load(
                        Q, row + wide + offsets[i]
                    )
                change = change - step * total
            force = slip * load(W, g * block + out + k * WIDTH)
            change = change - load(band_rows, s + _MOBILITY * WIDTH) * choose(slip, force, zero)
            store(F, row, choose(slip, force, load(band_rows, s + _HOLDING * WIDTH) * change))
            unchanged = choose(load(band_rows, s + _BESIDE * WIDTH), load(Q, row + 2 * wide), zero)
            store(Q, row + 2 * wide, choose(slip, change * share, unchanged))
    for g in range(groups):
        row = (top - 1) * wide + g * WIDTH
        forward = load(band_rows, g * height + _FORWARD * WIDTH) * splat(float(top)) * load(Q, row + wide)
        store(R, row, load(band_rows, g * height + _SLIP * WIDTH) * forward)


@kernel
def law_holds_in_run(arrays: Any, laws: Any, scratch: Any, count: int, share: float) -> bool:
    """Return whether the friction forces at the end agree with the friction law at the end velocities."""
    sums, W, band_rows = scratch.sums, scratch.W, scratch.band_rows
    orders, wide, height = scratch.Q.shape[0], sums.shape[1], _height(arrays)
    block = laws.registers[0] * orders * WIDTH
    speed, out = laws.speed[0] * orders * WIDTH, laws.out[0] * orders * WIDTH
    zero, worst = splat(0.0), splat(0.0)
    for g in range(whole_vectors(count) // WIDTH):
        a, slip = g * WIDTH, load(band_rows, g * height + _SLIP * WIDTH)
        store(W, g * block + speed, larger(slip * load(sums, a), zero))
    end = whole_vectors(count) // WIDTH * block
    advance_simd_series(laws.rows, 0, laws.rows.shape[0], W, 0, end, block, orders, 0)
    for g in range(whole_vectors(count) // WIDTH):
        a, slip = g * WIDTH, load(band_rows, g * height + _SLIP * WIDTH)
        off = size(load(sums, wide + a) - slip * load(W, g * block + out))
        beyond = off - splat(share) * load(sums, 2 * wide + a)
        # NaN if a value is NaN
        worst = worst + choose(slip, larger(beyond, zero) + zero * beyond, zero)
    store(sums, 0, worst)
    for i in range(WIDTH):
        if not sums[0, i] <= 0.0:
            return False
    return True
