"""This module computes Taylor coefficients of states and guards with rounding error bounds.

The recurrences are those of `hybridsim.engine.series.interpreter`; each error bound follows its recurrence to first
order in the unit roundoff (N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2002, section 3.3).
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.constants import EXACTLY
from hybridsim.engine.native.constants import UNIT as UNIT
from hybridsim.engine.native.kernels import call_noinline, inlined, kernel
from hybridsim.engine.series import operations as ops

ORDER = EXACTLY


@inlined
def _pair(V: Any, E: Any, a: int, b: int, i: int, j: int, u: float, v: float) -> tuple[float, float]:
    """Compute u a_i b_j + v a_j b_i with its error bound, for integers u and v."""
    first, second = u * V[a, i] * V[b, j], v * V[a, j] * V[b, i]
    error = u * (abs(V[a, i]) * E[b, j] + E[a, i] * (abs(V[b, j]) + E[b, j]))
    error += v * (abs(V[a, j]) * E[b, i] + E[a, j] * (abs(V[b, i]) + E[b, i]))
    error += 2.0 * UNIT * (abs(first) + abs(second)) + UNIT * abs(first + second)
    return first + second, error


@kernel
def _inner(V: Any, E: Any, a: int, b: int, k: int, weighted: bool) -> tuple[float, float]:
    """Compute the sum of a_i b_{k-i}, or of i a_i b_{k-i}, for 0 < i < k, with its error bound.

    The order of summation is that of `hybridsim.engine.series.interpreter`.
    """
    total, error, m = 0.0, 0.0, k // 2
    if k > 0 and k % 2 == 0:
        w = m if weighted else 1
        total = w * V[a, m] * V[b, m]
        error = w * (abs(V[a, m]) * E[b, m] + E[a, m] * (abs(V[b, m]) + E[b, m])) + 2.0 * UNIT * abs(total)
    for i in range((k - 1) // 2, 0, -1):
        u, v = (i, k - i) if weighted else (1, 1)
        pair, e = _pair(V, E, a, b, i, k - i, float(u), float(v))
        total += pair
        error += e + UNIT * abs(total)
    return total, error


@inlined
def _product(V: Any, E: Any, a: int, b: int, k: int) -> tuple[float, float]:
    """Compute the sum of a_i b_{k-i} for i from 0 to k, with its error bound."""
    if k == 0:
        total = V[a, 0] * V[b, 0]
        error = abs(V[a, 0]) * E[b, 0] + E[a, 0] * (abs(V[b, 0]) + E[b, 0]) + UNIT * abs(total)
        return total, error
    inner, e = call_noinline(_inner, (V, E, a, b, k, False))
    ends, d = _pair(V, E, a, b, 0, k, 1.0, 1.0)
    total = inner + ends
    return total, e + d + UNIT * abs(total)


@inlined
def _slope(V: Any, E: Any, a: int, b: int, k: int) -> tuple[float, float]:
    """Compute the sum of i a_i b_{k-i} for i from 1 to k, with its error bound."""
    inner, error = call_noinline(_inner, (V, E, a, b, k, True))
    last = k * V[a, k] * V[b, 0]
    error += k * (abs(V[a, k]) * E[b, 0] + E[a, k] * (abs(V[b, 0]) + E[b, 0])) + 2.0 * UNIT * abs(last)
    return inner + last, error + UNIT * abs(inner + last)


@kernel
def _first_sign(V: Any, a: int, k: int) -> float:
    """Return the sign of a Taylor series just after its origin, from its first non-zero coefficient."""
    for i in range(k + 1):
        if V[a, i] > 0.0:
            return 1.0
        if V[a, i] < 0.0:
            return -1.0
    return 0.0


@kernel
def _first_difference(V: Any, a: int, b: int, k: int) -> float:
    for i in range(k + 1):
        if V[a, i] != V[b, i]:
            return V[a, i] - V[b, i]
    return 0.0


@inlined
def _put(V: Any, E: Any, out: int, k: int, value: float, error: float) -> None:
    V[out, k] = value
    E[out, k] = error


@inlined
def _divide(V: Any, E: Any, out: int, k: int, numerator: float, error: float, b: int) -> None:
    """Compute coefficient k of a quotient from its numerator, with its error bound."""
    divisor = V[b, 0]
    value = numerator / divisor
    V[out, k] = value
    E[out, k] = (error + abs(value) * E[b, 0]) / abs(divisor) + UNIT * abs(value)


@inlined
def _multiply(V: Any, E: Any, out: int, k: int, factor: float, error: float, b: int) -> None:
    """Compute coefficient k of a quotient with a rounded reciprocal, with its error bound."""
    divisor = V[b, 0]
    value = factor * (1.0 / divisor)
    V[out, k] = value
    E[out, k] = (error + abs(value) * E[b, 0]) / abs(divisor) + 2.0 * UNIT * abs(value)


@kernel
def _leading(op: int, V: Any, E: Any, a: int, b: int, c: int, out: int) -> None:
    """Compute coefficient 0 of operations whose other coefficients follow from a differential equation."""
    u, du = V[a, 0], E[a, 0]
    if op == ops.EXP:
        y = math.inf if u >= 709.0 else math.exp(u)  # math.exp raises an exception if it overflows
        _put(V, E, out, 0, y, abs(y) * (du + 2.0 * UNIT))
    elif op == ops.SINCOS:
        s, co = math.sin(u), math.cos(u)
        _put(V, E, out, 0, s, abs(co) * du + 0.5 * du * du + 2.0 * UNIT * abs(s))
        _put(V, E, out + 1, 0, co, abs(s) * du + 0.5 * du * du + 2.0 * UNIT * abs(co))
    elif op == ops.SINHCOSH:
        s, co = math.sinh(u), math.cosh(u)
        _put(V, E, out, 0, s, abs(co) * du + 2.0 * UNIT * abs(s))
        _put(V, E, out + 1, 0, co, abs(s) * du + 2.0 * UNIT * abs(co))
    elif op == ops.TANGENT:
        sign = 1.0 if b == 0 else -1.0  # tan: w = 1 + y^2; tanh: w = 1 - y^2
        y = math.tan(u) if b == 0 else math.tanh(u)
        w = 1.0 + sign * y * y
        _put(V, E, out, 0, y, abs(w) * du + 2.0 * UNIT * abs(y))
        _put(V, E, out + 1, 0, w, 2.0 * abs(y) * E[out, 0] + 3.0 * UNIT * (1.0 + y * y))
    elif op == ops.INTEGRAL:
        v, dv = V[b, 0], E[b, 0]
        y = 0.0
        slope = dv / abs(u) if u != 0.0 else math.inf
        if c == ops.LOG:
            y = math.log(v) if v > 0.0 else math.nan
        elif c == ops.ASIN:
            y = math.asin(v) if abs(v) <= 1.0 else math.nan
        elif c == ops.ACOS:
            y = math.acos(v) if abs(v) <= 1.0 else math.nan
        elif c == ops.ATAN:
            y = math.atan(v)
        else:
            y = math.atan2(v, u)
            square = u * u + v * v
            slope = (abs(u) * dv + abs(v) * du) / square if square > 0.0 else math.inf
        _put(V, E, out, 0, y, slope + 2.0 * UNIT * abs(y))


@kernel
def _higher(op: int, V: Any, E: Any, a: int, b: int, c: int, out: int, k: int) -> None:
    """Compute coefficient k >= 1 of operations whose coefficients follow from a differential equation."""
    part = 1.0 / k
    if op == ops.EXP:
        y, e = _slope(V, E, a, out, k)
        _put(V, E, out, k, y * part, (e + 2.0 * UNIT * abs(y)) * part)
    elif op == ops.SINCOS:
        s, e = _slope(V, E, a, out + 1, k)
        co, d = _slope(V, E, a, out, k)
        _put(V, E, out, k, s * part, (e + 2.0 * UNIT * abs(s)) * part)
        _put(V, E, out + 1, k, -(co * part), (d + 2.0 * UNIT * abs(co)) * part)
    elif op == ops.SINHCOSH:
        s, e = _slope(V, E, a, out + 1, k)
        co, d = _slope(V, E, a, out, k)
        _put(V, E, out, k, s * part, (e + 2.0 * UNIT * abs(s)) * part)
        _put(V, E, out + 1, k, co * part, (d + 2.0 * UNIT * abs(co)) * part)
    elif op == ops.TANGENT:
        y, e = _slope(V, E, a, out + 1, k)
        _put(V, E, out, k, y * part, (e + 2.0 * UNIT * abs(y)) * part)
        w, d = _product(V, E, out, out, k)
        _put(V, E, out + 1, k, w if b == 0 else -w, d)
    elif op == ops.INTEGRAL and c != ops.ANGLE:
        # y' a = b'  =>  k y_k a_0 = k b_k - sum_{j<k} j y_j a_{k-j}
        s, e = call_noinline(_inner, (V, E, out, a, k, True))
        n = V[b, k] - s * part
        _divide(V, E, out, k, n, E[b, k] + (e + 2.0 * UNIT * abs(s)) * part + UNIT * abs(n), a)
    elif op == ops.INTEGRAL:
        # y = angle of (a, b):  y' (a^2 + b^2) = a b' - b a'
        left, e = _slope(V, E, b, a, k)
        right, d = _slope(V, E, a, b, k)
        total, error = left - right, e + d + UNIT * (abs(left) + abs(right))
        for j in range(1, k):
            w1, e1 = _product(V, E, a, a, k - j)
            w2, e2 = _product(V, E, b, b, k - j)
            total -= j * V[out, j] * (w1 + w2)
            error += j * (abs(V[out, j]) * (e1 + e2) + E[out, j] * abs(w1 + w2)) + 3 * UNIT * abs(total)
        square = V[a, 0] ** 2 + V[b, 0] ** 2
        y = total / (k * square)
        relative = 2.0 * (abs(V[a, 0]) * E[a, 0] + abs(V[b, 0]) * E[b, 0]) / square
        _put(V, E, out, k, y, error / (k * square) + abs(y) * (relative + 4.0 * UNIT))


@kernel
def _logic(op: int, V: Any, E: Any, a: int, b: int, c: int, out: int, k: int) -> None:
    """Compute coefficient k of comparisons, conditional values, abs, min and max, in the branch that applies next."""
    if op == ops.ABS:
        sign = _first_sign(V, a, k)
        _put(V, E, out, k, sign * V[a, k], E[a, k])
    elif op in (ops.MIN, ops.MAX):
        difference = _first_difference(V, a, b, k)
        take_a = (difference <= 0.0) == (op == ops.MIN)
        source = a if take_a else b
        _put(V, E, out, k, V[source, k], max(E[a, k], E[b, k]))
    elif op == ops.SELECT:
        source = b if V[a, 0] != 0.0 else c
        _put(V, E, out, k, V[source, k], E[source, k])
    elif k > 0:
        _put(V, E, out, k, 0.0, 0.0)
    else:
        value = 0.0
        if op == ops.SIGN:
            value = 1.0 if V[a, 0] > 0.0 else (-1.0 if V[a, 0] < 0.0 else 0.0)
        elif op == ops.LESS:
            value = 1.0 if V[a, 0] < V[b, 0] else 0.0
        elif op == ops.LESS_EQUAL:
            value = 1.0 if V[a, 0] <= V[b, 0] else 0.0
        elif op == ops.EQUAL:
            value = 1.0 if V[a, 0] == V[b, 0] else 0.0
        elif op == ops.AND:
            value = 1.0 if V[a, 0] != 0.0 and V[b, 0] != 0.0 else 0.0
        elif op == ops.OR:
            value = 1.0 if V[a, 0] != 0.0 or V[b, 0] != 0.0 else 0.0
        elif op == ops.NOT:
            value = 1.0 if V[a, 0] == 0.0 else 0.0
        _put(V, E, out, k, value, 0.0)


@kernel
def _with_constant(op: int, V: Any, E: Any, a: int, b: int, out: int, k: int) -> None:
    """Compute coefficient k of an operation on a Taylor series and a constant."""
    u, du, v, dv = V[a, k], E[a, k], V[b, 0], E[b, 0]
    if op == ops.SCALE:
        y = u * v
        _put(V, E, out, k, y, abs(u) * dv + du * (abs(v) + dv) + UNIT * abs(y))
    elif op == ops.DIVIDE_BY and k == 0:
        _divide(V, E, out, 0, u, du, b)
    elif op == ops.DIVIDE_BY:
        _multiply(V, E, out, k, u, du, b)
    elif op == ops.SINCOS_LINEAR and k == 0:
        _leading(ops.SINCOS, V, E, a, b, 0, out)
    elif op == ops.SINCOS_LINEAR:
        rate, e = V[a, 1], E[a, 1]
        s, ds, co, dco = V[out, k - 1], E[out, k - 1], V[out + 1, k - 1], E[out + 1, k - 1]
        part = 1.0 / k
        rate, e = rate * part, (e + 2.0 * UNIT * abs(rate)) * part
        y = rate * co
        _put(V, E, out, k, y, abs(rate) * dco + e * (abs(co) + dco) + UNIT * abs(y))
        y = -(rate * s)
        _put(V, E, out + 1, k, y, abs(rate) * ds + e * (abs(s) + ds) + UNIT * abs(y))
    elif k > 0:
        _put(V, E, out, k, -u if op == ops.CONSTANT_SUB else u, du)
    else:
        y = v - u if op == ops.CONSTANT_SUB else (u + v if op == ops.ADD_CONSTANT else u - v)
        _put(V, E, out, 0, y, du + dv + UNIT * abs(y))


@kernel
def _advance(row: Any, V: Any, E: Any, k: int) -> None:
    """Compute coefficient k of one operation, with its error bound."""
    op, a, b, c, out = row[0], row[1], row[2], row[3], row[4]
    if op == ops.COPY:
        _put(V, E, out, k, V[a, k], E[a, k])
    elif op == ops.ADD:
        y = V[a, k] + V[b, k]
        _put(V, E, out, k, y, E[a, k] + E[b, k] + UNIT * abs(y))
    elif op == ops.SUB:
        y = V[a, k] - V[b, k]
        _put(V, E, out, k, y, E[a, k] + E[b, k] + UNIT * abs(y))
    elif op == ops.NEG:
        _put(V, E, out, k, -V[a, k], E[a, k])
    elif op == ops.MUL:
        y, e = _product(V, E, a, b, k)
        _put(V, E, out, k, y, e)
    elif op == ops.DIV and k == 0:
        _divide(V, E, out, 0, V[a, 0], E[a, 0], b)
    elif op == ops.DIV:
        y, e = call_noinline(_inner, (V, E, out, b, k, False))
        first = V[out, 0] * V[b, k]
        e += abs(V[out, 0]) * E[b, k] + E[out, 0] * (abs(V[b, k]) + E[b, k]) + UNIT * abs(first)
        y += first
        n = V[a, k] - y
        _multiply(V, E, out, k, n, E[a, k] + e + UNIT * (abs(y) + abs(n)), b)
    elif op == ops.SQRT:
        if k == 0:
            y = math.sqrt(V[a, 0]) if V[a, 0] >= 0.0 else math.nan
            e = E[a, 0] / (2.0 * y) if y > 0.0 else math.sqrt(E[a, 0])
            _put(V, E, out, 0, y, e + UNIT * abs(y))
        else:
            y, e = call_noinline(_inner, (V, E, out, out, k, False))
            n = 0.5 * (V[a, k] - y)
            if V[out, 0] == 0.0 and n == 0.0 and E[a, k] + e == 0.0:
                _put(V, E, out, k, 0.0, 0.0)
            else:
                _divide(V, E, out, k, n, 0.5 * (E[a, k] + e) + UNIT * abs(n), out)
    elif op >= ops.ADD_CONSTANT:
        _with_constant(op, V, E, a, b, out, k)
    elif op >= ops.ABS:
        _logic(op, V, E, a, b, c, out, k)
    elif k == 0:
        _leading(op, V, E, a, b, c, out)
    else:
        _higher(op, V, E, a, b, c, out, k)


@kernel
def run_tape(rows: Any, order: int, states: Any, derivatives: Any, V: Any, E: Any) -> None:
    """Compute all Taylor coefficients along the flow, and their error bounds, up to an order.

    `rows` (m, 5) int64. The caller sets the registers of constants, time and parameters and order 0 of the
    states. states[i] is the register of x_i, derivatives[i] that of dx_i/dt.
    """
    for k in range(order + 1):
        for r in range(rows.shape[0]):
            _advance(rows[r], V, E, k)
        if k < order:
            for i in range(states.shape[0]):
                value = V[derivatives[i], k] / (k + 1)
                V[states[i], k + 1] = value
                E[states[i], k + 1] = E[derivatives[i], k] / (k + 1) + (UNIT * abs(value) if k > 0 else 0.0)


@kernel
def run_series(
    constant_rows: Any,
    rows: Any,
    inputs: Any,
    derivatives: Any,
    s: float,
    s_error: float,
    x: Any,
    x_error: Any,
    p: Any,
    V: Any,
    E: Any,
) -> None:
    """Set the inputs of an optimised tape, and compute all Taylor coefficients with error bounds.

    inputs: see `hybridsim.engine.system.system.Inputs`. derivatives: registers of the states' rates.
    """
    constants, values, parameters = inputs.constants, inputs.values, inputs.parameters
    sources, phases, time, states = inputs.sources, inputs.phases, inputs.time[0], inputs.states
    for r in range(V.shape[0]):
        for k in range(V.shape[1]):
            V[r, k], E[r, k] = 0.0, 0.0
    for i in range(constants.shape[0]):
        V[constants[i], 0], E[constants[i], 0] = values[i, 0], values[i, 1]
    for i in range(parameters.shape[0]):
        V[parameters[i], 0] = p[sources[i]]
    for i in range(phases.shape[0]):
        E[phases[i], 0] = 2.0 * UNIT * abs(V[phases[i], 0])
    order = V.shape[1] - 1
    if time >= 0:
        V[time, 0], E[time, 0] = s, s_error
        if order > 0:
            V[time, 1] = 1.0
    for i in range(states.shape[0]):
        V[states[i], 0] = x[i]
        E[states[i], 0] = x_error[i]
    for r in range(constant_rows.shape[0]):
        call_noinline(_advance, (constant_rows[r], V, E, 0))
    run_tape(rows, order, states, derivatives, V, E)
