"""Taylor coefficients of any order along a flow, and how far they reach.

The recurrences are those of automatic differentiation (A. Jorba and M. Zou, Experimental Mathematics 14 (2005) 99,
doi:10.1080/10586458.2005.10128904), over the lean tape and without the error bounds that `hybridsim.engine.jets` keeps.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.jit import inlined, kernel
from hybridsim.engine.lean_tape import (
    ADD_CONSTANT,
    CONSTANT_SUB,
    DIVIDE_BY,
    SCALE,
    SINCOS_LINEAR,
    SUB_CONSTANT,
)
from hybridsim.engine.tape import (
    ABS,
    ACOS,
    ADD,
    AND,
    ANGLE,
    ASIN,
    ATAN,
    DIV,
    EQUAL,
    EXP,
    INTEGRAL,
    LESS,
    LESS_EQUAL,
    LOG,
    MAX,
    MIN,
    MUL,
    NEG,
    NOT,
    OR,
    SELECT,
    SIGN,
    SINCOS,
    SINHCOSH,
    SQRT,
    SUB,
    TANGENT,
)

# Step control: the last two coefficients of each state and each guard stay below the tolerance at the end of a step.
_SHORTER = 0.5  # factor on a step over which a guard's series does not reach
_TRIALS = 60  # halvings: down to nothing


@inlined
def _convolution(V: Any, a: int, b: int, k: int, first: int, last: int) -> float:
    """sum_{i=first}^{last} a_i b_{k-i}."""
    total = 0.0
    for i in range(first, last + 1):
        total += V[a, i] * V[b, k - i]
    return total


@inlined
def _weighted(V: Any, a: int, b: int, k: int, last: int) -> float:
    """sum_{i=1}^{last} i a_i b_{k-i}: coefficient k - 1 of a' b."""
    total = 0.0
    for i in range(1, last + 1):
        total += i * V[a, i] * V[b, k - i]
    return total


@kernel
def _leading(op: int, V: Any, a: int, b: int, c: int, out: int) -> None:
    """Order 0 of the operations that follow a differential equation."""
    u = V[a, 0]
    if op == EXP:
        V[out, 0] = math.inf if u >= 709.0 else math.exp(u)  # math.exp raises where it overflows
    elif op in (SINCOS, SINCOS_LINEAR):
        V[out, 0], V[out + 1, 0] = math.sin(u), math.cos(u)
    elif op == SINHCOSH:
        V[out, 0], V[out + 1, 0] = math.sinh(u), math.cosh(u)
    elif op == TANGENT:
        y = math.tan(u) if b == 0 else math.tanh(u)
        V[out, 0], V[out + 1, 0] = y, 1.0 + (y * y if b == 0 else -y * y)
    elif op == INTEGRAL:
        v, y = V[b, 0], math.nan
        if c == LOG and v > 0.0:
            y = math.log(v)
        elif c == ASIN and abs(v) <= 1.0:
            y = math.asin(v)
        elif c == ACOS and abs(v) <= 1.0:
            y = math.acos(v)
        elif c == ATAN:
            y = math.atan(v)
        elif c == ANGLE:
            y = math.atan2(v, u)
        V[out, 0] = y


@kernel
def _higher(op: int, V: Any, a: int, b: int, c: int, out: int, k: int) -> None:
    """Order k >= 1 of the operations that follow a differential equation."""
    if op == EXP:
        V[out, k] = _weighted(V, a, out, k, k) / k
    elif op == SINCOS:
        V[out, k] = _weighted(V, a, out + 1, k, k) / k
        V[out + 1, k] = -_weighted(V, a, out, k, k) / k
    elif op == SINHCOSH:
        V[out, k] = _weighted(V, a, out + 1, k, k) / k
        V[out + 1, k] = _weighted(V, a, out, k, k) / k
    elif op == TANGENT:
        V[out, k] = _weighted(V, a, out + 1, k, k) / k
        w = _convolution(V, out, out, k, 0, k)
        V[out + 1, k] = w if b == 0 else -w
    elif op == INTEGRAL and c != ANGLE:
        V[out, k] = (V[b, k] - _weighted(V, out, a, k, k - 1) / k) / V[a, 0]
    elif op == INTEGRAL:
        total = _weighted(V, b, a, k, k) - _weighted(V, a, b, k, k)
        for j in range(1, k):
            square = _convolution(V, a, a, k - j, 0, k - j) + _convolution(V, b, b, k - j, 0, k - j)
            total -= j * V[out, j] * square
        V[out, k] = total / (k * (V[a, 0] ** 2 + V[b, 0] ** 2))


@kernel
def _logic(op: int, V: Any, a: int, b: int, c: int, out: int, k: int) -> None:
    """Order k of comparisons, choices and corners; a corner takes the side its argument goes to."""
    if op in (ABS, MIN, MAX):
        sign = 0.0
        for i in range(k + 1):
            difference = V[a, i] if op == ABS else V[a, i] - V[b, i]
            if difference != 0.0:
                sign = 1.0 if difference > 0.0 else -1.0
                break
        if op == ABS:
            V[out, k] = sign * V[a, k]
        else:
            V[out, k] = V[a, k] if (sign <= 0.0) == (op == MIN) else V[b, k]
    elif op == SELECT:
        V[out, k] = V[b, k] if V[a, 0] != 0.0 else V[c, k]
    elif k > 0:
        V[out, k] = 0.0
    else:
        u, v = V[a, 0], V[b, 0]
        truth = False
        if op == SIGN:
            V[out, 0] = 1.0 if u > 0.0 else (-1.0 if u < 0.0 else 0.0)
            return
        if op == LESS:
            truth = u < v
        elif op == LESS_EQUAL:
            truth = u <= v
        elif op == EQUAL:
            truth = u == v
        elif op == AND:
            truth = u != 0.0 and v != 0.0
        elif op == OR:
            truth = u != 0.0 or v != 0.0
        elif op == NOT:
            truth = u == 0.0
        V[out, 0] = 1.0 if truth else 0.0


@kernel
def advance(rows: Any, V: Any, k: int) -> None:
    """Coefficient k of every operation, in order."""
    for r in range(rows.shape[0]):
        op, a, b, c, out = rows[r, 0], rows[r, 1], rows[r, 2], rows[r, 3], rows[r, 4]
        if op == SCALE:
            V[out, k] = V[a, k] * V[b, 0]
        elif op == ADD:
            V[out, k] = V[a, k] + V[b, k]
        elif op == SUB:
            V[out, k] = V[a, k] - V[b, k]
        elif op == ADD_CONSTANT:
            V[out, k] = V[a, k] + V[b, 0] if k == 0 else V[a, k]
        elif op == SUB_CONSTANT:
            V[out, k] = V[a, k] - V[b, 0] if k == 0 else V[a, k]
        elif op == CONSTANT_SUB:
            V[out, k] = V[b, 0] - V[a, 0] if k == 0 else -V[a, k]
        elif op == SINCOS_LINEAR and k > 0:
            V[out, k] = V[a, 1] * V[out + 1, k - 1] / k
            V[out + 1, k] = -V[a, 1] * V[out, k - 1] / k
        elif op == MUL:
            V[out, k] = _convolution(V, a, b, k, 0, k)
        elif op == DIVIDE_BY:
            V[out, k] = V[a, k] / V[b, 0]
        elif op == DIV:
            V[out, k] = (V[a, k] - _convolution(V, out, b, k, 0, k - 1)) / V[b, 0]
        elif op == NEG:
            V[out, k] = -V[a, k]
        elif op == SQRT:
            if k == 0:
                V[out, 0] = math.sqrt(V[a, 0]) if V[a, 0] >= 0.0 else math.nan
            else:
                rest = 0.5 * (V[a, k] - _convolution(V, out, out, k, 1, k - 1))
                V[out, k] = 0.0 if V[out, 0] == 0.0 and rest == 0.0 else rest / V[out, 0]
        elif op >= ABS and op <= EQUAL:
            _logic(op, V, a, b, c, out, k)
        elif k == 0:
            _leading(op, V, a, b, c, out)
        else:
            _higher(op, V, a, b, c, out, k)


@kernel
def expand(rows: Any, places: Any, order: int, s: float, x: Any, V: Any) -> None:
    """Coefficients 0..order of all registers along the flow from x at local time s.

    places: registers of time (-1: none), of the states and of their derivatives. Constants are set beforehand.
    """
    time, states, derivatives = places
    if time >= 0:
        V[time, 0], V[time, 1] = s, 1.0
    for i in range(states.shape[0]):
        V[states[i], 0] = x[i]
    for k in range(order + 1):
        advance(rows, V, k)
        if k < order:
            for i in range(states.shape[0]):
                V[states[i], k + 1] = V[derivatives[i], k] / (k + 1)


@kernel
def reach(V: Any, states: Any, watched: Any, order: int, rtol: float, atol: Any, longest: float) -> float:
    """The step up to which the series hold to the tolerance, at most `longest`.

    The last two terms of each state are below atol + rtol |x|; those of each watched function below rtol of its
    largest term. NaN where a coefficient is no number.
    """
    h = longest
    for i in range(states.shape[0]):
        r = states[i]
        scale = atol[i] + rtol * abs(V[r, 0])
        for k in range(order - 1, order + 1):
            size = abs(V[r, k])
            if not size < math.inf:
                return math.nan
            if size * h**k > scale:
                if scale == 0.0:
                    scale = rtol * max(abs(V[r, 1]) * h, 1e-300)
                h = min(h, (scale / size) ** (1.0 / k))
    for j in range(watched.shape[0]):
        r = watched[j]
        for _ in range(_TRIALS):
            largest, power = 0.0, 1.0
            for k in range(order - 1):
                size = abs(V[r, k]) * power
                if not size < math.inf:
                    return math.nan
                largest = max(largest, size)
                power *= h
            last = max(abs(V[r, order - 1]) * power, abs(V[r, order]) * power * h)
            if not last < math.inf:
                return math.nan
            if last <= rtol * largest or last == 0.0:
                break
            h *= max(_SHORTER, 0.9 * (rtol * largest / last) ** (1.0 / order)) if largest > 0.0 else _SHORTER
    return h


@kernel
def evaluate_series(V: Any, registers: Any, order: int, d: float, out: Any) -> None:
    """Values of the series of some registers at a distance d from their origin (Horner)."""
    for i in range(registers.shape[0]):
        total = V[registers[i], order]
        for k in range(order - 1, -1, -1):
            total = total * d + V[registers[i], k]
        out[i] = total


@kernel
def polynomials(coefficients: Any, d: Any, out: Any) -> None:
    """out[j, i] = sum_k coefficients[i, k] d[j]**k."""
    order = coefficients.shape[1] - 1
    for j in range(d.shape[0]):
        for i in range(coefficients.shape[0]):
            total = coefficients[i, order]
            for k in range(order - 1, -1, -1):
                total = total * d[j] + coefficients[i, k]
            out[j, i] = total
