"""This module finds the first guard that becomes negative along a polynomial dense output."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import call_noinline, call_series, inlined, kernel
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.record.hermite import fit_in_time
from hybridsim.engine.roots.defect_check import keeps_up, sum_at
from hybridsim.engine.roots.earliest_exit import earliest_exit, parts_for_exit
from hybridsim.engine.roots.first_exit import FOUND, NEVER, OPEN
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.series.interpreter import advance, reach, sum_sizes, tabulate
from hybridsim.engine.system.system import System

_SHORTER = 0.25
_LONGER = 4.0
_ROUNDING = 16.0 * UNIT  # of a Bernstein coefficient, relative to the sum of the sizes of its terms
_SHORTEST = 2.0**-40  # of a step: shortest piece, on which a guard's series is useless
# Largest number of subintervals of a step; they become very short near a point at which the guard is undefined.
_MAX_SUBINTERVALS = 4096


class GuardSearch(NamedTuple):
    """The arrays of `first_guard`, for n states, G guards, R registers, and series up to `order`."""

    V: np.ndarray  # (R, order + 1), series along the polynomial
    W: np.ndarray  # (R, order + 1), values and series at points
    states: np.ndarray
    guard_series: np.ndarray
    a: np.ndarray
    b: np.ndarray
    stack: np.ndarray
    powers: np.ndarray
    values: np.ndarray
    sums: np.ndarray
    totals: np.ndarray
    floors: np.ndarray
    ahead: np.ndarray
    rates: np.ndarray
    everyone: np.ndarray
    guard_registers: np.ndarray  # (G,) registers of the active guards
    sides: np.ndarray
    orders: np.ndarray
    bernstein: np.ndarray


def guard_search(system: System, order: int) -> GuardSearch:
    """Return new arrays of `first_guard` for series up to an order, packed."""
    n, guards, columns, whole = system.n, system.guard_count, order + 1, np.int64
    arrays: GuardSearch = packed(
        GuardSearch(
            **{name: np.zeros((system.registers.count, columns)) for name in ("V", "W")},
            states=np.empty((n, columns)),
            guard_series=np.empty((guards, columns)),
            **{name: np.empty(columns) for name in ("a", "b")},
            stack=np.empty((64, columns + 2)),
            powers=np.empty(columns + 1),
            **{name: np.empty(guards) for name in ("values", "sums", "totals", "floors")},
            **{name: np.empty(n) for name in ("ahead", "rates")},
            everyone=np.arange(guards, dtype=whole),
            **{name: np.empty(guards, dtype=whole) for name in ("guard_registers", "sides", "orders")},
            bernstein=np.zeros(0, dtype=whole),
        )
    )
    return arrays


@inlined
def shifted(coefficients: Any, q: float, out: Any) -> None:
    """Shift polynomials (n, m) to another origin; missing higher coefficients are zero."""
    n, m = coefficients.shape
    for i in range(n):
        for j in range(m):
            out[i, j] = coefficients[i, j]
        for j in range(m, out.shape[1]):
            out[i, j] = 0.0
        if q != 0.0:
            for j in range(m - 1):
                for k in range(m - 2, j - 1, -1):
                    out[i, k] += q * out[i, k + 1]


@inlined
def series_along(
    code: int, rows: Any, inputs: Any, s: float, x: Any, guard_registers: Any, V: Any, W: Any, out: Any
) -> None:
    """Compute the Taylor coefficients of each guard along states that are given as polynomials.

    rows: tape rows that the functions need. V, W: registers that hold the tape's constants. code: address of
    a function that does the same (`along` of `hybridsim.engine.series.emit_series`); 0 for none.
    """
    if code != 0:
        call_series(code, s, 0.0, x, out, W, out)
        return
    time, states, size = inputs.time[0], inputs.states, out.shape[1]
    for i in range(states.shape[0]):
        for j in range(size):
            V[states[i], j] = x[i, j]
    if time >= 0:
        V[time, 0], V[time, 1] = s, 1.0
    for j in range(size):
        call_noinline(advance, (rows, V, j))
    for i in range(guard_registers.shape[0]):
        for j in range(size):
            out[i, j] = V[guard_registers[i], j]


@inlined
def guards_at(
    code: int, rows: Any, inputs: Any, s: float, x: Any, guard_registers: Any, W: Any, rates: Any, out: Any
) -> None:
    """Compute the values of the guards at a time and state, by compiled code if available.

    The code also writes rates, as `values` of `hybridsim.engine.series.emit_series` does.
    """
    if code != 0:
        call_series(code, s, 0.0, x, out, W, rates)
        return
    time, states = inputs.time[0], inputs.states
    for i in range(states.shape[0]):
        W[states[i], 0] = x[i]
    if time >= 0:
        W[time, 0] = s
    call_noinline(advance, (rows, W, 0))
    for j in range(guard_registers.shape[0]):
        out[j] = W[guard_registers[j], 0]


@inlined
def begin_positive(sides: Any, orders: Any, floors: Any) -> None:
    """Record that every guard is positive at the start of the next step or part of a step."""
    for g in range(sides.shape[0]):
        sides[g], orders[g], floors[g] = 1, 0, 0.0


@kernel
def stays_positive(left: Any, right: Any, order: int, floor: float, d: float, weights: Any) -> bool:
    """Return whether a polynomial is certainly positive on (0, d], because all its Bernstein coefficients are positive.

    left, right (K,): its Taylor coefficients at both ends. The first `order` of them are set to zero on the
    left, with an uncertainty `floor`. weights (K, K): from these to the K Bernstein coefficients next to an
    end.
    """
    size, power = 0.0, 1.0
    for k in range(left.shape[0]):
        size += (abs(left[k]) + abs(right[k])) * power
        power *= d
    error = _ROUNDING * size + floor
    for j in range(left.shape[0]):
        low, high, power = 0.0, 0.0, 1.0
        for k in range(j + 1):
            if k >= order:
                low += weights[j, k] * left[k] * power
            high += weights[j, k] * right[k] * (power if k % 2 == 0 else -power)
            power *= d
        if not ((low > error or j < order) and high > error):
            return False
    return True


@kernel
def first_linear_guard(tapes: Any, k: int, d: float, hermite: Any, own: Any) -> tuple[int, int, float]:
    """Find the first guard that becomes negative, for guards that are linear in states and time.

    own: the Taylor coefficients of the active guards at the ends of the step, `guards_left` and `guards` (G, K), and
    `search`, a `GuardSearch`.
    """
    left, right, scratch = own.guards_left, own.guards, own.search
    sides, orders, floors = scratch.sides, scratch.orders, scratch.floors
    first, count = tapes.active_start[k], tapes.active_start[k + 1] - tapes.active_start[k]
    is_positive = True
    for i in range(count):
        g = tapes.active[first + i]
        is_positive = (
            is_positive
            and sides[g] > 0
            and stays_positive(left[i], right[i], orders[g], floors[g], d, hermite.weights)
        )
    outcome, g, at = NEVER, -1, d
    if not is_positive:
        polynomials, guard_registers, V = own.polynomials, scratch.guard_registers, scratch.V
        left, right = left[:count], right[:count]
        if not fit_in_time(left, right, d, hermite.shift, hermite.inverse, own.lack, polynomials[:count]):
            return OPEN, -1, 0.0
        degree = polynomials.shape[1] - 1
        for i in range(count):
            for j in range(degree + 1):
                V[guard_registers[i], j] = polynomials[i, j]
            for j in range(degree + 1, degree + 3):  # nothing is omitted: the error of a series is zero
                V[guard_registers[i], j] = 0.0
        tabulate(d, degree + 2, scratch.powers)
        guard_registers = guard_registers[:count]
        for i in range(count):
            scratch.totals[i] = sum_sizes(V, guard_registers[i], degree + 2, scratch.powers)
        outcome, g, at = earliest_exit(
            tapes, k, degree + 2, d, V, guard_registers, scratch.powers, scratch.totals, parts_for_exit(scratch),
            scratch.bernstein,
        )  # fmt: skip
    if outcome == NEVER:
        begin_positive(sides, orders, floors)
    return outcome, g, at


@kernel
def likely_reach(V: Any, guard_registers: Any, order: int, rtol: float) -> float:
    """Return a first guess of the length over which the guards' series are accurate."""
    longest = math.inf
    for j in range(guard_registers.shape[0]):
        r = guard_registers[j]
        for k in (0, 1):
            if V[r, k] != 0.0 and V[r, order] != 0.0:
                w = (rtol * abs(V[r, k] / V[r, order])) ** (1.0 / (order - k))
                longest = min(longest, _LONGER * w)
    return longest


@kernel
def first_guard(
    tapes: Any,
    k: int,
    rows: Any,
    inputs: Any,
    codes: Any,
    order: int,
    rtol: float,
    s: float,
    d: float,
    atol: Any,
    polynomial: Any,
    scratch: Any,
) -> tuple[int, int, float]:
    """Find the guard that becomes negative first in a step; return FOUND, NEVER or OPEN with the time.

    The time counts from s. rows: tape rows that the guards need; codes: `EndsCodes`. polynomial (n, m): the
    states in powers of the time from s. scratch: `GuardSearch`; V and W with the constants of the tape in their
    registers; sides, orders and floors of the guards just after s, as in `earliest_exit`, which are updated. The series
    of a guard is used as long as its last terms stay below rtol of its largest one and it agrees with the
    guard at its end. There the next piece begins.
    """
    along, values_code = codes.along[k], codes.values[k]
    x, U, values = scratch.states, scratch.guard_series, scratch.values
    y, rates = scratch.ahead, scratch.rates
    count = tapes.active_start[k + 1] - tapes.active_start[k]
    guard_registers, everyone = scratch.guard_registers[:count], scratch.everyone[:count]
    none = everyone[:0]
    q = 0.0
    for _ in range(_MAX_SUBINTERVALS):
        if not q < d:
            return NEVER, -1, d
        shifted(polynomial, q, x)
        series_along(along, rows, inputs, s + q, x, guard_registers, scratch.V, scratch.W, U)
        left = d - q
        longest = min(left, likely_reach(U, everyone, order, rtol))
        w = call_noinline(
            reach, (0, U, none, U, everyone, order, rtol, atol, 1.0, longest, scratch.powers, scratch.totals)
        )
        if not w > _SHORTEST * d:
            return OPEN, -1, q
        outcome, g, at = earliest_exit(
            tapes, k, order, w, U, everyone, scratch.powers, scratch.totals, parts_for_exit(scratch), scratch.bernstein
        )  # fmt: skip
        if outcome == OPEN:
            return OPEN, g, q + at
        while True:
            for i in range(x.shape[0]):
                y[i] = x[i, order]
                for j in range(order - 1, -1, -1):
                    y[i] = y[i] * at + x[i, j]
            guards_at(values_code, rows, inputs, s + q + at, y, guard_registers, scratch.W, rates, values)
            tabulate(at, order, scratch.powers)
            for j in range(guard_registers.shape[0]):
                scratch.sums[j] = sum_at(U, j, order, scratch.powers)
            if keeps_up(U, everyone, order, scratch.powers, rtol, values, scratch.sums):
                break
            at, outcome = _SHORTER * at, NEVER
            if not at > _SHORTEST * d:
                return OPEN, g, q
        if outcome == FOUND:
            return FOUND, g, q + at
        q = d if at >= left else q + at
        begin_positive(scratch.sides, scratch.orders, scratch.floors)
    return (OPEN, -1, q) if q < d else (NEVER, -1, d)
