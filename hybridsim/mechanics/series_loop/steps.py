"""This module computes step lengths, and finds the first contact that leaves its mode."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import call_kernel, inlined, kernel
from hybridsim.engine.native.simd.vectors import (
    WIDTH,
    choose,
    larger,
    load,
    size,
    splat,
    store,
    whole_vectors,
)
from hybridsim.engine.roots.first_exit import FOUND, NEVER, OPEN, first_exit
from hybridsim.mechanics import codes
from hybridsim.mechanics.series_loop.banded_series import law_holds_in_run
from hybridsim.mechanics.series_loop.expansion import base_coefficient
from hybridsim.mechanics.series_loop.simd_series import advance_simd_series, lane_place

_UNIT = 2.0**-53
_DEFECT = 100.0  # as in the taylor integrator: the permitted error of the law's series, in tolerances
_SHRINKS = 200  # halvings of a reach
_SHORT = 2.0**-12  # of the step; the interval after a touch that is checked for an exit
_CONVERGED = 2.0**-5  # of the sum of all terms; a series has converged if it omits less
_TINY = 2.0**-40  # of the step; an exit that is undecided on such a short interval is a touch


@kernel
def set_time(tree: Any, leaf: int, t: float) -> None:
    """Store a time in the tournament tree; tree[1] is the earliest of all times."""
    i = tree.shape[0] // 2 + leaf
    tree[i] = t
    i >>= 1
    while i >= 1:
        earliest = min(tree[2 * i], tree[2 * i + 1])
        if tree[i] == earliest:
            return
        tree[i] = earliest
        i >>= 1


@kernel
def first_leaf(tree: Any) -> int:
    """Return the leaf of the tournament tree with the earliest time."""
    i, half = 1, tree.shape[0] // 2
    while i < half:
        i = 2 * i if tree[2 * i] == tree[i] else 2 * i + 1
    return i - half


@inlined
def _largest(scratch: Any, first: Any, second: Any, total: Any) -> tuple[float, float, bool]:
    """Return the largest number of each of two vectors, and whether a third vector is finite."""
    wide = scratch.sums.shape[1]
    store(scratch.sums, 2 * wide, first)
    store(scratch.sums, 2 * wide + WIDTH, second)
    store(scratch.sums, 3 * wide, total)
    one, other, is_finite = 0.0, 0.0, True
    for i in range(WIDTH):
        one, other = max(one, scratch.sums[2, i]), max(other, scratch.sums[2, WIDTH + i])
        is_finite = is_finite and scratch.sums[3, i] < math.inf
    return one, other, is_finite


@kernel
def reach(
    arrays: Any, state: Any, scratch: Any, nd: int, nc: int, top: int, rtol: float, longest: float
) -> float:
    """Return the time over which the last two terms of each Taylor series are below the tolerance, or NaN."""
    h, Q, wide = longest, scratch.Q, scratch.Q.shape[1]
    for a in range(nd):
        x = scratch.dofs[a]
        scratch.sums[0, a] = 1.0 / (state.tolerance[0, x] + rtol * abs(Q[0, a]))
        scratch.sums[1, a] = 1.0 / (state.tolerance[1, x] + rtol * abs(Q[1, a]))
    for a in range(nd, whole_vectors(nd)):
        scratch.sums[0, a] = scratch.sums[1, a] = 0.0
    for k in range(top - 1, top + 1):
        largest, fastest, total = splat(0.0), splat(0.0), splat(0.0)
        for a in range(0, nd, WIDTH):
            term = size(load(Q, k * wide + a))
            at_q, at_v = term * load(scratch.sums, a), term * load(scratch.sums, wide + a)
            largest, fastest, total = larger(at_q, largest), larger(at_v, fastest), total + (at_q + at_v)
        largest_q, largest_v, is_finite = _largest(scratch, largest, fastest, total)
        largest_v *= k
        if not is_finite:
            return math.nan
        if largest_q * h**k > 1.0:
            h = largest_q ** (-1.0 / k)
        if largest_v * h ** (k - 1) > 1.0:
            h = largest_v ** (-1.0 / (k - 1))
    for i in range(whole_vectors(nc)):
        scratch.sums[0, i] = 0.0
    for i in range(nc):
        c = scratch.cons[i]
        if state.mode[c] == codes.STICK:
            most = max(arrays.limits[c, 0], arrays.limits[c, 1], abs(scratch.F[0, i]))
            scratch.sums[0, i] = 1.0 / (rtol * most) if most > 0.0 else 0.0
    for k in range(top - 3, top - 1):
        largest = splat(0.0)
        for i in range(0, nc, WIDTH):
            largest = larger(size(load(scratch.F, k * wide + i)) * load(scratch.sums, i), largest)
        most, _, _ = _largest(scratch, largest, largest, largest)
        if most * h**k > 1.0:
            h = most ** (-1.0 / k)
    return _reach_of_bases(arrays, state, scratch, nc, top, rtol, h) if arrays.rates.shape[0] > 0 else h


@kernel
def _reach_of_bases(
    arrays: Any, state: Any, scratch: Any, nc: int, top: int, rtol: float, longest: float
) -> float:
    """Return the time over which the Taylor series of the base speeds meet the tolerance.

    The velocity of such a base is part of no coordinate, so that no other series bounds it.
    """
    h = longest
    for i in range(nc):
        c = scratch.cons[i]
        if state.mode[c] == codes.STICK or arrays.base_rate[c] < 0:
            continue
        permitted = rtol * max(abs(scratch.R[0, i]), math.hypot(arrays.base[c, 1], arrays.base[c, 2]))
        for k in range(top - 2, top):
            term = abs(base_coefficient(arrays, scratch, c, k))
            if term * h**k > permitted:
                h = (permitted / term) ** (1.0 / k)
    return h


@kernel
def _exit_of(
    state: Any, scratch: Any, top: int, terms: int, h: float, order: int, slack: float, is_short: bool
) -> tuple[int, float]:
    """Find the first time in (0, h] at which the polynomial in scratch.poly becomes negative, in units of h.

    A polynomial that is zero throughout, or within the rounding `slack` of its terms, does not go negative.
    It is undecided if the series omits terms that are comparable with it, or with its first term after an event.
    On a short interval a touch is passed if the polynomial is positive after it.
    """
    power, total, end = 1.0, 0.0, 0.0
    for k in range(terms):
        scratch.poly[k] *= power
        total += abs(scratch.poly[k])
        end += scratch.poly[k]
        power *= h
    if total <= slack:
        return NEVER, 1.0
    omitted = 2.0 * (abs(scratch.poly[terms - 1]) + abs(scratch.poly[terms - 2]))
    rounding = 8.0 * _UNIT * total + slack
    scale = _CONVERGED * total if order == 0 else min(_CONVERGED * total, 0.5 * abs(scratch.poly[order]))
    if omitted > max(scale, rounding):
        return OPEN, 0.0  # a sign within the omitted terms would be a guess
    error = omitted + rounding
    form = codes.BERNSTEIN + top - (terms - order)
    code = state.kernels[form] if form < state.kernels.shape[0] else 0
    outcome, theta = first_exit(scratch.poly[:terms], error, 0.0, order, scratch.bern, scratch.stack, code)
    if outcome == OPEN and is_short and end > error:
        outcome = NEVER
    return outcome, theta


@kernel
def _bound_rest(arrays: Any, state: Any, scratch: Any, nc: int, top: int, h: float) -> None:
    """Sum the positive and the negative terms of each guard over a time h, without the first terms.

    The first term is left out; results go to scratch.sums, rows 1 and 2.
    """
    R, F, sums = scratch.R, scratch.F, scratch.sums
    wide, step, zero = R.shape[1], splat(h), splat(0.0)
    for i in range(whole_vectors(nc)):
        sums[0, i] = 1.0 if i < nc and state.mode[scratch.cons[i]] != codes.STICK else 0.0
    for i in range(0, nc, WIDTH):
        above, below, power, slips = zero, zero, step, load(sums, i)
        for k in range(1, top - 1):
            term = power * choose(slips, load(R, k * wide + i), load(F, k * wide + i))
            positive = larger(term, zero)
            above, below, power = above + positive, below + (term - positive), power * step
        term = power * choose(slips, load(R, (top - 1) * wide + i), zero)
        positive = larger(term, zero)
        store(sums, wide + i, above + positive)
        store(sums, 2 * wide + i, below + (term - positive))


@inlined
def _is_far(
    series: Any, i: int, last: int, lead: float, fall: float, power: float, h: float, most: float
) -> bool:
    """Return whether a guard with the value `lead` certainly stays positive up to the time h.

    fall: sum of the negative terms, each of which acts in part only; power: h**last; most: size of all terms.
    """
    error = 2.0 * (abs(series[last, i]) * power + abs(series[last - 1, i]) * (power / h))
    return lead + fall > error + 24.0 * _UNIT * most


@kernel
def isolate(
    arrays: Any, state: Any, scratch: Any, nc: int, tau: float, h: float, top: int, is_short: bool
) -> tuple[int, float]:
    """Find the first exit of each contact from its mode in (0, h]; return (OPEN, fraction) if undecided."""
    _bound_rest(arrays, state, scratch, nc, top, h)
    power = h ** (top - 2)
    for i in range(nc):
        c = scratch.cons[i]
        scratch.exits[i], scratch.kinds[i] = codes.OPEN_END, codes.VELOCITY
        fresh, above, below = state.stamp[c] == tau, scratch.sums[1, i], scratch.sums[2, i]
        if state.mode[c] != codes.STICK:
            sigma, order = float(state.mode[c]), state.decree[c, 0] if fresh else 0
            lead = sigma * scratch.R[0, i]
            fall = below if sigma > 0.0 else -above
            if order == 0 and _is_far(scratch.R, i, top - 1, lead, fall, power * h, h, lead + above - below):
                continue
            for k in range(top):
                scratch.poly[k] = sigma * scratch.R[k, i]
            outcome, theta = _exit_of(state, scratch, top, top, h, order, 0.0, is_short)
            if outcome == OPEN:
                return OPEN, theta
            if outcome == FOUND:
                scratch.exits[i] = theta * h
        elif state.held[c] == 0:
            for side in range(2):
                sigma = 1.0 if side == 0 else -1.0
                limit, order = arrays.limits[c, side], state.decree[c, side] if fresh else 0
                most = max(limit, abs(scratch.F[0, i]))
                lead = limit - sigma * scratch.F[0, i]
                fall = -above if side == 0 else below
                if order == 0 and _is_far(scratch.F, i, top - 2, lead, fall, power, h, most + above - below):
                    continue
                for k in range(top - 1):
                    scratch.poly[k] = -sigma * scratch.F[k, i]
                scratch.poly[0] += limit
                outcome, theta = _exit_of(
                    state, scratch, top, top - 1, h, order, 8.0 * _UNIT * most, is_short
                )
                if outcome == OPEN:
                    return OPEN, theta
                if outcome == FOUND and theta * h < scratch.exits[i]:
                    scratch.exits[i], scratch.kinds[i] = theta * h, codes.UPPER if side == 0 else codes.LOWER
    return FOUND, 1.0


@kernel
def _at_ends(scratch: Any, nc: int, h: float, top: int) -> None:
    """Compute relative velocities, forces and error scales at the end of the step, or at an earlier change of mode."""
    R, F, sums = scratch.R, scratch.F, scratch.sums
    wide = R.shape[1]
    for i in range(whole_vectors(nc)):
        sums[0, i] = min(h, scratch.exits[i]) if i < nc else 0.0
    for i in range(0, nc, WIDTH):
        d, velocity = load(sums, i), splat(0.0)
        for k in range(top - 1, -1, -1):
            velocity = velocity * d + load(R, k * wide + i)
        force, largest, power = splat(0.0), splat(0.0), splat(1.0)
        for k in range(top - 1):
            term = load(F, k * wide + i) * power
            force = force + term
            largest = larger(largest, size(term))
            power = power * d
        store(sums, i, velocity)
        store(sums, wide + i, force)
        store(sums, 2 * wide + i, largest)


@kernel
def _law_holds(
    arrays: Any, laws: Any, state: Any, scratch: Any, nc: int, h: float, top: int, rtol: float
) -> bool:
    """Return whether slip forces agree with their laws at the end of the step, or at an earlier change of mode."""
    _at_ends(scratch, nc, h, top)
    if state.whole[codes.FIRST] >= 0:
        share = _DEFECT * rtol + 64.0 * _UNIT
        return laws.rows.shape[0] == 0 or law_holds_in_run(arrays, laws, scratch, nc, share)
    for t in range(laws.registers.shape[0]):
        first = scratch.lane_ptr[t]
        count, at = scratch.lane_ptr[t + 1] - scratch.lane_ptr[t], scratch.place[t]
        if count == 0 or laws.row_ptr[t + 1] == laws.row_ptr[t]:
            continue
        orders = top + 1
        block = laws.registers[t] * orders * WIDTH
        for j in range(whole_vectors(count)):
            i = scratch.lane[first + min(j, count - 1)]
            place = lane_place(at, block, laws.speed[t], orders, 0, j)
            scratch.V[place] = max(state.mode[scratch.cons[i]] * scratch.sums[0, i], 0.0)
        # order 0 is overwritten, because its old value is no longer needed
        rows, end = (laws.row_ptr[t], laws.row_ptr[t + 1]), at + whole_vectors(count) // WIDTH * block
        advance_simd_series(laws.rows, rows[0], rows[1], scratch.V, at, end, block, orders, 0)
        for j in range(count):
            i = scratch.lane[first + j]
            mode = state.mode[scratch.cons[i]]
            off = abs(scratch.sums[1, i] - mode * scratch.V[lane_place(at, block, laws.out[t], orders, 0, j)])
            if mode != codes.STICK and not off <= (_DEFECT * rtol + 64.0 * _UNIT) * scratch.sums[2, i]:
                return False
    return True


def step_length_kernel(arrays: Any, laws: Any, state: Any, scratch: Any) -> int:
    """Run `step_length` as a kernel that is called by its address and finds its arguments in the state."""
    nd, nc, top = state.whole[codes.DOFS], state.whole[codes.CONS], state.whole[codes.ORDER]
    tau, longest, rtol = state.real[codes.AT], state.real[codes.LONGEST], state.real[codes.RTOL]
    h = reach(arrays, state, scratch, nd, nc, top, rtol, longest)
    scale = max(state.clock[2], longest)
    for _ in range(_SHRINKS):
        if not h > 0.0:
            break
        outcome, _ = isolate(arrays, state, scratch, nc, tau, h, top, h <= _SHORT * scale)
        if outcome == OPEN and h > _TINY * scale:
            h *= 0.5
            continue
        if outcome == OPEN:  # a touch: an exit within rounding that is not certainly negative does not fire
            state.counts[5] += 1
        if _law_holds(arrays, laws, state, scratch, nc, h, top, rtol):
            state.real[codes.LENGTH] = h
            return 0
        h *= 0.5
    state.real[codes.LENGTH] = math.nan
    return 0


@inlined
def step_length(arrays: Any, laws: Any, state: Any, scratch: Any, longest: float, rtol: float) -> float:
    """Return the time over which the series of a patch are accurate, and find the exits from modes in this time.

    NaN if there is no such length.
    """
    state.real[codes.LONGEST], state.real[codes.RTOL] = longest, rtol
    call_kernel(state.kernels[codes.STEP_LENGTH], (arrays, laws, state, scratch))
    return state.real[codes.LENGTH]
