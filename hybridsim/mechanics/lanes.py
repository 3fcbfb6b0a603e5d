"""A tape run for many contacts at once: one interpreter, one row of numbers for each register and order.

The recurrences are those of `hybridsim.engine.taylor`; here the innermost loop goes over contacts (lanes), so that the
interpreter's own cost is shared among them. Lanes come in whole vectors: those beyond the last contact are copies of
its lane.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.eight import WIDTH, load, splat, store
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
def _product(V: Any, z: int, a: int, b: int, count: int, n: int, factor: float) -> None:
    """V[z] += factor * sum_{i<count} V[a + i n] V[b - i n], lane by lane; a: of its first coefficient, b: of its last."""
    weight = splat(factor)
    for j in range(0, n, WIDTH):
        total = load(V, z + j)
        for i in range(count):
            total = total + weight * (load(V, a + i * n + j) * load(V, b - i * n + j))
        store(V, z + j, total)


@inlined
def _weighted(V: Any, out: int, a: int, b: int, k: int, last: int, n: int, factor: float) -> None:
    """V[out] += factor * sum_{i=1}^{last} i a_i b_{k-i}; a, b: places of coefficient 0."""
    for j in range(0, n, WIDTH):
        total = load(V, out + j)
        for i in range(1, last + 1):
            total = total + splat(factor * i) * (load(V, a + i * n + j) * load(V, b + (k - i) * n + j))
        store(V, out + j, total)


@inlined
def clear(V: Any, at: int, length: int) -> None:
    """Zeros from a place on, in whole vectors."""
    for i in range(at, at + length, WIDTH):
        store(V, i, splat(0.0))


@inlined
def _fill(V: Any, z: int, n: int, value: float) -> None:
    """One number in every lane."""
    for j in range(0, n, WIDTH):
        store(V, z + j, splat(value))


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
    _fill(V, o, n, 0.0)
    if op == EXP:
        _weighted(V, o, a, out, k, k, n, 1.0 / k)
    elif op == INTEGRAL:
        _weighted(V, o, out, a, k, k - 1, n, -1.0 / k)
        for j in range(0, n, WIDTH):
            store(V, o + j, (load(V, b + k * n + j) + load(V, o + j)) / load(V, a + j))
    else:
        _fill(V, o2, n, 0.0)
        _weighted(V, o, a, out2, k, k, n, 1.0 / k)
        if op == TANGENT:
            _product(V, o2, out, out + k * n, k + 1, n, 1.0 if flag == 0 else -1.0)
        else:
            _weighted(V, o2, a, out, k, k, n, (1.0 if op == SINHCOSH else -1.0) / k)


@inlined
def _quotient(V: Any, z: int, x: int, out: int, b: int, k: int, n: int) -> None:
    """V[z] = (V[x] - sum_{i<k} out_i b_{k-i}) / b_0; out, b: places of coefficient 0."""
    for j in range(0, n, WIDTH):
        total = load(V, x + j)
        for i in range(k):
            total = total - load(V, out + i * n + j) * load(V, b + (k - i) * n + j)
        store(V, z + j, total / load(V, b + j))


@inlined
def _shifted(V: Any, z: int, x: int, c: int, k: int, n: int, signs: tuple[float, float]) -> None:
    """V[z] = a series and a constant, with their signs."""
    for j in range(0, n, WIDTH):
        total = splat(signs[0]) * load(V, x + j)
        if k == 0:
            total = total + splat(signs[1]) * load(V, c + j)
        store(V, z + j, total)


@kernel
def advance_lanes(rows: Any, V: Any, base: int, orders: int, n: int, k: int) -> None:
    """Coefficient k of every operation for n lanes; register r has its coefficient k at base + (r*orders + k)*n.

    n is a whole number of vectors.
    """
    length = orders * n
    for r in range(rows.shape[0]):
        op, flag, kind = rows[r, 0], rows[r, 2], rows[r, 3]
        a, b, out = base + rows[r, 1] * length, base + rows[r, 2] * length, base + rows[r, 4] * length
        z, x, y = out + k * n, a + k * n, b + k * n
        if op == SCALE:
            for j in range(0, n, WIDTH):
                store(V, z + j, load(V, x + j) * load(V, b + j))
        elif op == DIV:
            _quotient(V, z, x, out, b, k, n)
        elif op == MUL:
            _fill(V, z, n, 0.0)
            _product(V, z, a, y, k + 1, n, 1.0)
        elif op == ADD:
            for j in range(0, n, WIDTH):
                store(V, z + j, load(V, x + j) + load(V, y + j))
        elif op == SUB:
            for j in range(0, n, WIDTH):
                store(V, z + j, load(V, x + j) - load(V, y + j))
        elif op == DIVIDE_BY:
            for j in range(0, n, WIDTH):
                store(V, z + j, load(V, x + j) / load(V, b + j))
        elif op == NEG:
            for j in range(0, n, WIDTH):
                store(V, z + j, splat(-1.0) * load(V, x + j))
        elif op == ADD_CONSTANT:
            _shifted(V, z, x, b, k, n, (1.0, 1.0))
        elif op == SUB_CONSTANT:
            _shifted(V, z, x, b, k, n, (1.0, -1.0))
        elif op == CONSTANT_SUB:
            _shifted(V, z, x, b, k, n, (-1.0, 1.0))
        elif op == SQRT:
            for j in range(n):
                if k == 0:
                    V[z + j] = math.sqrt(V[x + j]) if V[x + j] >= 0.0 else math.nan
                else:
                    V[z + j] = 0.5 * V[x + j]
            if k > 0:
                _product(V, z, out + n, out + (k - 1) * n, k - 1, n, -0.5)
                for j in range(n):
                    V[z + j] = 0.0 if V[out + j] == 0.0 and V[z + j] == 0.0 else V[z + j] / V[out + j]
        elif k == 0:
            _leading(op, V, a, b, flag, kind, out, out + length, n)
        else:
            _higher(op, V, a, b, flag, out, out + length, k, n)
