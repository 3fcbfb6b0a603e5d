"""A tape run for many contacts at once: one interpreter, one row of numbers for each register and order.

The recurrences are those of `hybridsim.engine.taylor`; here the innermost loop goes over contacts (lanes), so that the
interpreter's own cost is shared among them.
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
    ACOS,
    ADD,
    ASIN,
    ATAN,
    DIV,
    EXP,
    INTEGRAL,
    LOG,
    MUL,
    NEG,
    SINCOS,
    SINHCOSH,
    SQRT,
    SUB,
    TANGENT,
)  # fmt: skip


@inlined
def _product(V: Any, out: int, a: int, b: int, k: int, first: int, last: int, n: int, factor: float) -> None:
    """V[out] += factor * sum_{i=first}^{last} a_i b_{k-i}; a, b, out are places of coefficient 0 (out: of k)."""
    total = V[out : out + n]
    for i in range(first, last + 1):
        _add_product(total, V[a + i * n : a + i * n + n], V[b + (k - i) * n : b + (k - i) * n + n], n, factor)


@inlined
def _add_product(total: Any, x: Any, y: Any, n: int, factor: float) -> None:
    """total += factor x y, lane by lane; views of their own, so that the loop becomes one of vectors."""
    for j in range(n):
        total[j] += factor * (x[j] * y[j])


@inlined
def _weighted(V: Any, out: int, a: int, b: int, k: int, last: int, n: int, factor: float) -> None:
    """V[out] += factor * sum_{i=1}^{last} i a_i b_{k-i}."""
    total = V[out : out + n]
    for i in range(1, last + 1):
        x, y = V[a + i * n : a + i * n + n], V[b + (k - i) * n : b + (k - i) * n + n]
        _add_product(total, x, y, n, factor * i)


@kernel
def _leading(op: int, V: Any, a: int, b: int, flag: int, kind: int, o: int, o2: int, n: int) -> None:
    """Order 0 of the operations that follow a differential equation."""
    for j in range(n):
        u = V[a + j]
        if op == EXP:
            V[o + j] = math.inf if u >= 709.0 else math.exp(u)
        elif op in (SINCOS, SINCOS_LINEAR):
            V[o + j], V[o2 + j] = math.sin(u), math.cos(u)
        elif op == SINHCOSH:
            V[o + j], V[o2 + j] = math.sinh(u), math.cosh(u)
        elif op == TANGENT:
            y = math.tan(u) if flag == 0 else math.tanh(u)
            V[o + j], V[o2 + j] = y, 1.0 + (y * y if flag == 0 else -y * y)
        elif op == INTEGRAL:
            v, y = V[b + j], math.nan
            if kind == LOG and v > 0.0:
                y = math.log(v)
            elif kind == ASIN and abs(v) <= 1.0:
                y = math.asin(v)
            elif kind == ACOS and abs(v) <= 1.0:
                y = math.acos(v)
            elif kind == ATAN:
                y = math.atan(v)
            V[o + j] = y


@kernel
def _higher(op: int, V: Any, a: int, b: int, flag: int, out: int, out2: int, k: int, n: int) -> None:
    """Order k >= 1 of the operations that follow a differential equation; places of coefficient 0."""
    o, o2 = out + k * n, out2 + k * n
    for j in range(n):
        V[o + j] = 0.0
    if op == EXP:
        _weighted(V, o, a, out, k, k, n, 1.0 / k)
    elif op == INTEGRAL:
        _weighted(V, o, out, a, k, k - 1, n, -1.0 / k)
        for j in range(n):
            V[o + j] = (V[b + k * n + j] + V[o + j]) / V[a + j]
    else:
        for j in range(n):
            V[o2 + j] = 0.0
        _weighted(V, o, a, out2, k, k, n, 1.0 / k)
        if op == TANGENT:
            _product(V, o2, out, out, k, 0, k, n, 1.0 if flag == 0 else -1.0)
        else:
            _weighted(V, o2, a, out, k, k, n, (1.0 if op == SINHCOSH else -1.0) / k)


@kernel
def advance_lanes(rows: Any, V: Any, base: int, orders: int, n: int, k: int) -> None:
    """Coefficient k of every operation for n lanes; register r has its coefficient k at base + (r*orders + k)*n."""
    size = orders * n
    for r in range(rows.shape[0]):
        op, flag, kind = rows[r, 0], rows[r, 2], rows[r, 3]
        a, b, out = base + rows[r, 1] * size, base + rows[r, 2] * size, base + rows[r, 4] * size
        o, at, bt = out + k * n, a + k * n, b + k * n
        z, x, y, c = V[o : o + n], V[at : at + n], V[bt : bt + n], V[b : b + n]
        if op == SCALE:
            for j in range(n):
                z[j] = x[j] * c[j]
        elif op == ADD:
            for j in range(n):
                z[j] = x[j] + y[j]
        elif op == SUB:
            for j in range(n):
                z[j] = x[j] - y[j]
        elif op == MUL:
            for j in range(n):
                z[j] = 0.0
            _product(V, o, a, b, k, 0, k, n, 1.0)
        elif op == DIVIDE_BY:
            for j in range(n):
                z[j] = x[j] / c[j]
        elif op == DIV:
            for j in range(n):
                z[j] = x[j]
            _product(V, o, out, b, k, 0, k - 1, n, -1.0)
            for j in range(n):
                z[j] /= c[j]
        elif op == NEG:
            for j in range(n):
                z[j] = -x[j]
        elif op in (ADD_CONSTANT, SUB_CONSTANT, CONSTANT_SUB):
            sign, other = -1.0 if op == CONSTANT_SUB else 1.0, -1.0 if op == SUB_CONSTANT else 1.0
            for j in range(n):
                z[j] = sign * x[j]
            if k == 0:
                for j in range(n):
                    z[j] += other * c[j]
        elif op == SQRT:
            if k == 0:
                for j in range(n):
                    z[j] = math.sqrt(x[j]) if x[j] >= 0.0 else math.nan
            else:
                for j in range(n):
                    z[j] = 0.5 * x[j]
                _product(V, o, out, out, k, 1, k - 1, n, -0.5)
                for j in range(n):
                    z[j] = 0.0 if V[out + j] == 0.0 and z[j] == 0.0 else z[j] / V[out + j]
        elif k == 0:
            _leading(op, V, a, b, flag, kind, out, out + size, n)
        else:
            _higher(op, V, a, b, flag, out, out + size, k, n)
