"""This module computes Taylor coefficients of any order, and the step for which they are accurate.

The recurrences are those of automatic differentiation (A. Jorba and M. Zou, Experimental Mathematics 14
(2005) 99, doi:10.1080/10586458.2005.10128904). They use the optimised tape, without the error bounds of
`hybridsim.engine.series.bounded`.

Sums run from the middle of a convolution outward. The newest coefficients, at both ends, are added last, so
that few operations depend on them. Divisions by an order, or at higher orders by a fixed number, are
multiplications by the reciprocal. The generated code of `hybridsim.engine.series.emit_series` does the same
operations, to the last bit. So does `hybridsim.engine.series.bounded` up to the order by which events are
decided; beyond it products and sums are fused.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybridsim.engine.native.constants import EXACTLY
from hybridsim.engine.native.kernels import (
    call_noinline,
    call_series,
    fused,
    inlined,
    kernel,
    polynomial_kernel,
)
from hybridsim.engine.series import operations as ops
from hybridsim.engine.series.high_orders import (
    FACTOR,
    HAS_B,
    HAS_C,
    INTEGRATE,
    NEGATIVE,
    OVER_B,
    OVER_C,
    RECIPROCAL,
)

# Step control: the last two coefficients of each state and each guard stay below the tolerance at the end of a step.
_SHORTER = 0.5  # factor on a step that is too long for a guard's series, without a better estimate
# Factor on a guard's tolerance, so that a guard that equals a state does not shorten that state's own step.
SLACK = 1.5
_TRIALS = 60  # most halvings of a step
_FIRST, _SURELY = 4, 0.9  # terms that determine a shorter step; safety factor on it
_LEAST, _MANTISSA, _ONE = 1e-300, (1 << 52) - 1, 1023 << 52  # bit fields of a double


@kernel
def _inner(V: Any, a: int, b: int, k: int) -> float:
    """Compute the sum of a_i b_{k-i} for i from 1 to k - 1."""
    total = V[a, k // 2] * V[b, k // 2] if k > 0 and k % 2 == 0 else 0.0
    if k <= EXACTLY:
        for i in range((k - 1) // 2, 0, -1):
            total += V[a, i] * V[b, k - i] + V[a, k - i] * V[b, i]
        return total
    if a == b:
        for i in range((k - 1) // 2, 0, -1):
            total = fused(2.0 * V[a, i], V[a, k - i], total)
        return total
    other = 0.0  # a second sum, independent of the first
    for i in range((k - 1) // 2, 0, -1):
        total, other = fused(V[a, i], V[b, k - i], total), fused(V[a, k - i], V[b, i], other)
    return total + other


@inlined
def _product(V: Any, a: int, b: int, k: int) -> float:
    """Compute the sum of a_i b_{k-i} for i from 0 to k."""
    if k == 0:
        return V[a, 0] * V[b, 0]
    inner = call_noinline(_inner, (V, a, b, k))
    if k <= EXACTLY:
        return inner + (V[a, 0] * V[b, k] + V[a, k] * V[b, 0])
    if a == b:
        return fused(2.0 * V[a, 0], V[a, k], inner)
    return fused(V[a, 0], V[b, k], fused(V[a, k], V[b, 0], inner))


@kernel
def _weighted(V: Any, a: int, b: int, k: int) -> float:
    """Compute the sum of i a_i b_{k-i} for i from 1 to k - 1."""
    total = k // 2 * V[a, k // 2] * V[b, k // 2] if k % 2 == 0 else 0.0
    if k <= EXACTLY:
        for i in range((k - 1) // 2, 0, -1):
            total += i * V[a, i] * V[b, k - i] + (k - i) * V[a, k - i] * V[b, i]
        return total
    other = 0.0
    for i in range((k - 1) // 2, 0, -1):
        total = fused(i * V[a, i], V[b, k - i], total)
        other = fused((k - i) * V[a, k - i], V[b, i], other)
    return total + other


@inlined
def _rise(V: Any, a: int, b: int, k: int) -> float:
    """Compute coefficient k of the integral of a' b."""
    if k <= EXACTLY:
        return _slope(V, a, b, k) * (1.0 / k)
    return fused(V[a, k], V[b, 0], call_noinline(_weighted, (V, a, b, k)) * (1.0 / k))


@inlined
def _slope(V: Any, a: int, b: int, k: int) -> float:
    """Compute coefficient k - 1 of a' b, the sum of i a_i b_{k-i} for i from 1 to k."""
    return call_noinline(_weighted, (V, a, b, k)) + k * V[a, k] * V[b, 0]


@kernel
def _leading(op: int, V: Any, a: int, b: int, c: int, out: int) -> None:
    """Compute coefficient 0 of operations whose other coefficients follow from a differential equation."""
    u = V[a, 0]
    if op == ops.EXP:
        V[out, 0] = math.inf if u >= 709.0 else math.exp(u)  # math.exp raises an exception if it overflows
    elif op in (ops.SINCOS, ops.SINCOS_LINEAR):
        V[out, 0], V[out + 1, 0] = math.sin(u), math.cos(u)
    elif op == ops.SINHCOSH:
        V[out, 0], V[out + 1, 0] = math.sinh(u), math.cosh(u)
    elif op == ops.TANGENT:
        y = math.tan(u) if b == 0 else math.tanh(u)
        V[out, 0], V[out + 1, 0] = y, 1.0 + (y * y if b == 0 else -y * y)
    elif op == ops.INTEGRAL:
        v, y = V[b, 0], math.nan
        if c == ops.LOG and v > 0.0:
            y = math.log(v)
        elif c == ops.ASIN and abs(v) <= 1.0:
            y = math.asin(v)
        elif c == ops.ACOS and abs(v) <= 1.0:
            y = math.acos(v)
        elif c == ops.ATAN:
            y = math.atan(v)
        elif c == ops.ANGLE:
            y = math.atan2(v, u)
        V[out, 0] = y


@kernel
def _higher(op: int, V: Any, a: int, b: int, c: int, out: int, k: int) -> None:
    """Compute coefficient k >= 1 of operations whose coefficients follow from a differential equation."""
    if op == ops.EXP:
        V[out, k] = _rise(V, a, out, k)
    elif op == ops.SINCOS:
        V[out, k] = _rise(V, a, out + 1, k)
        V[out + 1, k] = -_rise(V, a, out, k)
    elif op == ops.SINHCOSH:
        V[out, k] = _rise(V, a, out + 1, k)
        V[out + 1, k] = _rise(V, a, out, k)
    elif op == ops.TANGENT:
        V[out, k] = _rise(V, a, out + 1, k)
        w = _product(V, out, out, k)
        V[out + 1, k] = w if b == 0 else -w
    elif op == ops.INTEGRAL and c != ops.ANGLE:
        V[out, k] = (V[b, k] - call_noinline(_weighted, (V, out, a, k)) * (1.0 / k)) / V[a, 0]
    elif op == ops.INTEGRAL:
        total = _slope(V, b, a, k) - _slope(V, a, b, k)
        for j in range(1, k):
            total -= j * V[out, j] * (_product(V, a, a, k - j) + _product(V, b, b, k - j))
        V[out, k] = total / (k * (V[a, 0] ** 2 + V[b, 0] ** 2))


@kernel
def _logic(op: int, V: Any, a: int, b: int, c: int, out: int, k: int) -> None:
    """Compute coefficient k of comparisons, conditional values, abs, min and max, in the branch that applies next."""
    if op in (ops.ABS, ops.MIN, ops.MAX):
        sign = 0.0
        for i in range(k + 1):
            difference = V[a, i] if op == ops.ABS else V[a, i] - V[b, i]
            if difference != 0.0:
                sign = 1.0 if difference > 0.0 else -1.0
                break
        if op == ops.ABS:
            V[out, k] = sign * V[a, k]
        else:
            V[out, k] = V[a, k] if (sign <= 0.0) == (op == ops.MIN) else V[b, k]
    elif op == ops.SELECT:
        V[out, k] = V[b, k] if V[a, 0] != 0.0 else V[c, k]
    elif k > 0:
        V[out, k] = 0.0
    else:
        u, v = V[a, 0], V[b, 0]
        truth = False
        if op == ops.SIGN:
            V[out, 0] = 1.0 if u > 0.0 else (-1.0 if u < 0.0 else 0.0)
            return
        if op == ops.LESS:
            truth = u < v
        elif op == ops.LESS_EQUAL:
            truth = u <= v
        elif op == ops.EQUAL:
            truth = u == v
        elif op == ops.AND:
            truth = u != 0.0 and v != 0.0
        elif op == ops.OR:
            truth = u != 0.0 or v != 0.0
        elif op == ops.NOT:
            truth = u == 0.0
        V[out, 0] = 1.0 if truth else 0.0


@inlined
def _factor(flags: int, V: Any, b: int, c: int) -> float:
    """Compute a factor from up to two constants, each of which multiplies or divides."""
    f = 1.0
    if flags & HAS_B:
        f = 1.0 / V[b, 0] if flags & OVER_B else V[b, 0]
    if flags & HAS_C:
        f *= 1.0 / V[c, 0] if flags & OVER_C else V[c, 0]
    return -f if flags & NEGATIVE else f


@kernel
def advance(rows: Any, V: Any, k: int) -> None:
    """Compute Taylor coefficient k of every operation, in order."""
    for r in range(rows.shape[0]):
        op, a, b, c, out = rows[r, 0], rows[r, 1], rows[r, 2], rows[r, 3], rows[r, 4]
        if op == ops.SCALE:
            V[out, k] = V[a, k] * V[b, 0]
        elif op == ops.ADD:
            V[out, k] = V[a, k] + V[b, k]
        elif op == ops.SUB:
            V[out, k] = V[a, k] - V[b, k]
        elif op == ops.ADD_CONSTANT:
            V[out, k] = V[a, k] + V[b, 0] if k == 0 else V[a, k]
        elif op == ops.SUB_CONSTANT:
            V[out, k] = V[a, k] - V[b, 0] if k == 0 else V[a, k]
        elif op == ops.CONSTANT_SUB:
            V[out, k] = V[b, 0] - V[a, 0] if k == 0 else -V[a, k]
        elif op == ops.SINCOS_LINEAR and k > 0:
            rate = V[a, 1] * (1.0 / k)
            V[out, k] = rate * V[out + 1, k - 1]
            V[out + 1, k] = -(rate * V[out, k - 1])
        elif op == ops.MUL:
            V[out, k] = _product(V, a, b, k)
        elif op == ops.DIVIDE_BY:
            V[out, k] = V[a, k] / V[b, 0] if k == 0 else V[a, k] * (1.0 / V[b, 0])
        elif op == ops.DIV:
            if k == 0:
                V[out, 0] = V[a, 0] / V[b, 0]
            else:
                inner = call_noinline(_inner, (V, out, b, k))
                if k <= EXACTLY:
                    rest = V[a, k] - (inner + V[out, 0] * V[b, k])
                else:
                    rest = fused(-V[out, 0], V[b, k], V[a, k] - inner)
                V[out, k] = rest * (1.0 / V[b, 0])
        elif op == ops.NEG:
            V[out, k] = -V[a, k]
        elif op == ops.SQRT:
            if k == 0:
                V[out, 0] = math.sqrt(V[a, 0]) if V[a, 0] >= 0.0 else math.nan
            else:
                rest = 0.5 * (V[a, k] - call_noinline(_inner, (V, out, out, k)))
                V[out, k] = 0.0 if V[out, 0] == 0.0 and rest == 0.0 else rest / V[out, 0]
        elif op >= RECIPROCAL:
            part = 1.0 / V[b, 0]
            factor = V[out, 0] * part * _factor((op - RECIPROCAL) ^ NEGATIVE, V, 0, c)
            V[out, k] = fused(V[a, k], factor, -(call_noinline(_inner, (V, out, b, k)) * part))
        elif op >= INTEGRATE:
            if k + 1 < V.shape[1]:
                V[out, k + 1] = V[a, k] * (_factor(op - INTEGRATE, V, b, c) * (1.0 / (k + 1)))
        elif op >= FACTOR:
            V[out, k] = V[a, k] * _factor(op - FACTOR, V, b, c)
        elif op >= ops.ABS and op <= ops.EQUAL:
            _logic(op, V, a, b, c, out, k)
        elif k == 0:
            _leading(op, V, a, b, c, out)
        else:
            _higher(op, V, a, b, c, out, k)


@kernel
def expand(rows: Any, high: Any, flow_registers: Any, order: int, s: float, x: Any, V: Any) -> None:
    """Compute all Taylor coefficients up to an order along the flow from x at local time s.

    high: rows for the orders beyond `EXACTLY` (`hybridsim.engine.series.high_orders`); if empty, all orders
    use the same rows. flow_registers: registers of time (-1: none), of the states and of their derivatives. The
    caller sets the constants.
    """
    time, states, derivatives = flow_registers
    if time >= 0:
        V[time, 0], V[time, 1] = s, 1.0
    for i in range(states.shape[0]):
        V[states[i], 0] = x[i]
    for k in range(order + 1):
        if k > EXACTLY and high.shape[0] > 0:
            call_noinline(advance, (high, V, k))
            continue
        call_noinline(advance, (rows, V, k))
        if k < order:
            for i in range(states.shape[0]):
                rate, j = V[derivatives[i], k], k + 1
                V[states[i], j] = rate / j if j <= EXACTLY else rate * (1.0 / j)


@inlined
def tabulate(h: float, order: int, powers: Any) -> None:
    """Compute the powers of h up to an order, four at a time from the fifth on."""
    powers[0], powers[1] = 1.0, h
    for k in range(2, min(order, 4) + 1):
        powers[k] = powers[k // 2] * powers[k - k // 2]
    for k in range(5, order + 1):
        powers[k] = powers[k - 4] * powers[4]


@inlined
def sum_sizes(U: Any, r: int, order: int, powers: Any) -> float:
    """Compute the sum of |U[r, k]| h**k over k from given powers of h."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for k in range(order - 3, 0, -4):
        a, b = fused(abs(U[r, k]), powers[k], a), fused(abs(U[r, k + 1]), powers[k + 1], b)
        c, d = fused(abs(U[r, k + 2]), powers[k + 2], c), fused(abs(U[r, k + 3]), powers[k + 3], d)
    total = (a + c) + (b + d)
    for k in range(order % 4, 0, -1):
        total = fused(abs(U[r, k]), powers[k], total)
    return abs(U[r, 0]) + total


@inlined
def measure(code: int, U: Any, monitored: Any, order: int, h: float, powers: Any, totals: Any) -> None:
    """Compute the powers of h, and the sums of |U[r, k]| h**k over k for the monitored rows r.

    code: address of a function that does so for all rows, with the totals after the powers in memory (`sizes`
    of `hybridsim.engine.series.emit_series`); 0 for none.
    """
    if code != 0:
        call_series(code, h, 0.0, U, U, U, powers)
    else:
        call_noinline(_interpreted_sizes, (U, monitored, order, h, powers, totals))


@kernel
def _interpreted_sizes(U: Any, monitored: Any, order: int, h: float, powers: Any, totals: Any) -> None:
    tabulate(h, order, powers)
    for j in range(monitored.shape[0]):
        totals[j] = sum_sizes(U, monitored[j], order, powers)


@inlined
def _root(x: float, n: int) -> float:
    """Approximate x**(1/n) for x >= 0 to a few digits, faster than by a power."""
    return math.exp(math.log(x) / n) if 0.0 < x < math.inf else x


@polynomial_kernel
def rough_inverse_root(x: float, n: int) -> float:
    """Approximate x**(-1/n) for x >= 0 to three digits, faster than by a power.

    Exponent and mantissa are read from the bits of a double. Between powers of two the logarithm and the
    exponential are cubics with errors of 8e-4 / n and 1e-4.
    """
    if not _LEAST <= x < math.inf:
        return math.inf if x == 0.0 else 1.0 / _root(x, n)
    bits = np.float64(x).view(np.int64)
    f = np.int64((bits & _MANTISSA) | _ONE).view(np.float64) - 1.0
    log = ((0.152700285 * f - 0.568704053) * f + 1.41565319) * f + 8.25462823e-4
    log = (((bits >> 52) - 1023) + log) * (-1.0 / n)
    whole = math.floor(log)
    f = log - whole
    power = ((0.07896726 * f + 0.22469316) * f + 0.69632477) * f + 0.99990029
    return power * np.int64((np.int64(whole) + 1023) << 52).view(np.float64)


@inlined
def shorter_reach(U: Any, r: int, order: int, rtol: float, h: float, is_before: bool) -> float:
    """Return a step below h over which the last term of a Taylor series is below the tolerance, or h/2.

    is_before: use the last term but one, which is larger. Over a useful step one of the first four terms is
    the largest, or not much smaller; for exp(w t) with rtol = 1e-12 and order 24 it is the fourth. These
    terms give the step directly.
    """
    last = order - 1 if is_before else order
    found = 0.0
    for k in range(min(_FIRST, last)):
        if U[r, k] != 0.0:
            found = max(found, rough_inverse_root(abs(U[r, last]) / (rtol * abs(U[r, k])), last - k))
    found *= _SURELY
    return found if 0.0 < found < h else _SHORTER * h


@kernel
def reach(
    code: int, V: Any, states: Any, U: Any, monitored: Any, order: int, rtol: float, atol: Any, slack: float,
    longest: float, powers: Any, totals: Any,
) -> float:  # fmt: skip
    """Return the step, at most `longest`, over which the Taylor series meet the tolerance.

    On return powers (order + 1,) are h**k and totals are those of `sum_sizes` for the functions; code: see
    `measure`.

    states: rows of V with the series of the states, monitored: rows of U with those of functions. The last two
    terms of each state are below atol + rtol |x|, and those of each function below rtol of its largest term,
    times the slack. The result is NaN if a coefficient is not finite.
    """
    h, first, last = longest, 0.0, 0.0  # the last two terms over the tolerance, without the powers of h
    for i in range(states.shape[0]):
        r = states[i]
        one, two = abs(V[r, order - 1]), abs(V[r, order])
        if not (one < math.inf and two < math.inf):
            return math.nan
        scale = atol[i] + rtol * abs(V[r, 0])
        if scale == 0.0:
            scale = rtol * max(abs(V[r, 1]) * h, 1e-300)
        first, last = max(first, one / scale), max(last, two / scale)
    h = min(h, rough_inverse_root(first, order - 1), rough_inverse_root(last, order))
    measure(code, U, monitored, order, h, powers, totals)
    for j in range(monitored.shape[0]):
        r = monitored[j]
        for _ in range(_TRIALS):
            if not totals[j] < math.inf:
                return math.nan
            term = max(abs(U[r, order - 1]) * powers[order - 1], abs(U[r, order]) * powers[order])
            largest = max(abs(U[r, 0]), abs(U[r, 1]) * powers[1])
            if term <= slack * rtol * largest or term == 0.0:
                break
            if not term > slack * rtol * totals[j]:  # otherwise none of the terms is large enough
                a, b, c = 0.0, 0.0, 0.0
                for k in range(2, order - 3, 3):  # three independent lines
                    a = max(a, abs(U[r, k]) * powers[k])
                    b = max(b, abs(U[r, k + 1]) * powers[k + 1])
                    c = max(c, abs(U[r, k + 2]) * powers[k + 2])
                for k in range(max(order - 3, 2), order - 1):
                    a = max(a, abs(U[r, k]) * powers[k])
                if term <= slack * rtol * max(max(largest, a), max(b, c)):
                    break
            h = shorter_reach(U, r, order, rtol, h, abs(U[r, order]) * powers[order] < term)
            measure(code, U, monitored, order, h, powers, totals)
    return h


@polynomial_kernel
def polynomials(coefficients: Any, d: Any, out: Any) -> None:
    """Evaluate the polynomials with given coefficients at the points d.

    The result equals that of `hybridsim.engine.record.series_block` to the last bit.
    """
    order = coefficients.shape[1] - 1
    for j in range(d.shape[0]):
        for i in range(coefficients.shape[0]):
            total = coefficients[i, order]
            for k in range(order - 1, -1, -1):
                total = total * d[j] + coefficients[i, k]
            out[j, i] = total
