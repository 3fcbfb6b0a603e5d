"""This module evaluates a friction law for many contacts at once, with vector instructions.

The recurrences are those of `hybridsim.engine.series.interpreter`. Each operation works on eight contacts (lanes), so
that the interpreter's overhead is shared. Each group of eight has a block with its registers one after the
other, and within a register its coefficients. Lanes beyond the last contact are copies of it.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.simd.vectors import WIDTH, load, splat, store
from hybridsim.engine.series import operations as ops
from hybridsim.engine.series.optimise import PAIRED


@inlined
def clear(V: Any, at: int, length: int) -> None:
    """Write zeros into vectors from index `at` on."""
    for i in range(at, at + length, WIDTH):
        store(V, i, splat(0.0))


@inlined
def lane_place(at: int, block: int, register: int, orders: int, k: int, lane: int) -> int:
    """Return the index of Taylor coefficient k of a register for one contact."""
    return at + (lane >> 3) * block + (register * orders + k) * WIDTH + (lane & 7)


@inlined
def _product(V: Any, a: int, b: int, first: int, last: int) -> Any:
    """Return the sum of a_i b_{first + last - i} over i from `first` to `last`."""
    total = splat(0.0)
    for _ in range(first, last + 1):
        total = total + load(V, a) * load(V, b)
        a, b = a + WIDTH, b - WIDTH
    return total


@inlined
def _weighted(V: Any, a: int, b: int, k: int, last: int) -> Any:
    """Return the sum of i a_i b_{k-i} over i from 1 to `last`."""
    total = splat(0.0)
    for i in range(1, last + 1):
        total = total + splat(float(i)) * (load(V, a + i * WIDTH) * load(V, b + (k - i) * WIDTH))
    return total


@kernel
def _leading(op: int, V: Any, a: int, b: int, flag: int, kind: int, o: int, o2: int) -> None:
    """Compute coefficient 0 of the operations that are defined by a differential equation."""
    for j in range(WIDTH):
        u = V[a + j]
        if op == ops.EXP:
            V[o + j] = math.inf if u >= 709.0 else math.exp(u)
        elif op in (ops.SINCOS, ops.SINCOS_LINEAR):
            V[o + j], V[o2 + j] = math.sin(u), math.cos(u)
        elif op == ops.SINHCOSH:
            V[o + j], V[o2 + j] = math.sinh(u), math.cosh(u)
        elif op == ops.TANGENT:
            y = math.tan(u) if flag == 0 else math.tanh(u)
            V[o + j], V[o2 + j] = y, 1.0 + (y * y if flag == 0 else -y * y)
        elif op == ops.SQRT:
            V[o + j] = math.sqrt(u) if u >= 0.0 else math.nan
        elif op == ops.INTEGRAL:
            v, y = V[b + j], math.nan
            if kind == ops.LOG and v > 0.0:
                y = math.log(v)
            elif kind == ops.ASIN and abs(v) <= 1.0:
                y = math.asin(v)
            elif kind == ops.ACOS and abs(v) <= 1.0:
                y = math.acos(v)
            elif kind == ops.ATAN:
                y = math.atan(v)
            V[o + j] = y


@kernel
def _higher(op: int, V: Any, a: int, b: int, flag: int, out: int, out2: int, k: int) -> None:
    """Compute coefficient k >= 1 of the operations that are defined by a differential equation."""
    o, o2, share = out + k * WIDTH, out2 + k * WIDTH, splat(1.0 / k)
    if op == ops.EXP:
        store(V, o, share * _weighted(V, a, out, k, k))
    elif op == ops.INTEGRAL:
        store(V, o, (load(V, b + k * WIDTH) - share * _weighted(V, out, a, k, k - 1)) / load(V, a))
    elif op == ops.SQRT:
        half = splat(0.5)
        store(V, o, half * load(V, a + k * WIDTH) - half * _product(V, out + WIDTH, o - WIDTH, 1, k - 1))
        for j in range(WIDTH):
            V[o + j] = 0.0 if V[out + j] == 0.0 and V[o + j] == 0.0 else V[o + j] / V[out + j]
    else:
        store(V, o, share * _weighted(V, a, out2, k, k))
        if op == ops.TANGENT:
            square = _product(V, out, o, 0, k)
            store(V, o2, square if flag == 0 else splat(-1.0) * square)
        else:
            change = share * _weighted(V, a, out, k, k)
            store(V, o2, change if op == ops.SINHCOSH else splat(-1.0) * change)


@inlined
def _quotient(V: Any, x: int, out: int, b: int, k: int) -> Any:
    """Return coefficient k of a quotient `out` = x/b, from the lower coefficients of `out`.

    The newest coefficient of b is used last, and no division by b_0 follows it. A processor with out-of-order
    execution has then finished everything else.
    """
    inverse, total = splat(1.0) / load(V, b), load(V, x)
    b += WIDTH
    for i in range(out + (k - 1) * WIDTH, out - 1, -WIDTH):
        total = total - load(V, i) * load(V, b)
        b += WIDTH
    return total * inverse


@inlined
def _with_constant(op: int, x: Any, c: Any) -> Any:
    """Return coefficient 0 of an operation on a Taylor series and a constant."""
    if op == ops.ADD_CONSTANT:
        return x + c
    return x - c if op == ops.SUB_CONSTANT else c - x


@kernel
def advance_simd_series(
    rows: Any, first: int, last: int, V: Any, begin: int, end: int, block: int, orders: int, k: int
) -> None:
    """Compute coefficient k for all contacts in V[begin:end] by the operations first..last - 1.

    Coefficient k of register r is at (r*orders + k)*WIDTH of a block.
    """
    length = orders * WIDTH
    for base in range(begin, end, block):
        for r in range(first, last):
            op = rows[r, 0]
            a, b, out = base + rows[r, 1] * length, base + rows[r, 2] * length, base + rows[r, 4] * length
            z, x, y = out + k * WIDTH, a + k * WIDTH, b + k * WIDTH
            if op == ops.SCALE:
                store(V, z, load(V, x) * load(V, b))
            elif ops.ADD_CONSTANT <= op <= ops.CONSTANT_SUB:
                value = load(V, x)
                if k == 0:
                    value = _with_constant(op, value, load(V, b))
                elif op == ops.CONSTANT_SUB:
                    value = splat(-1.0) * value
                store(V, z, value)
            elif op == ops.DIV:
                store(V, z, _quotient(V, x, out, b, k))
            elif op == ops.MUL:
                store(V, z, _product(V, a, y, 0, k))
            elif op == ops.ADD:
                store(V, z, load(V, x) + load(V, y))
            elif op == ops.SUB:
                store(V, z, load(V, x) - load(V, y))
            elif op == ops.DIVIDE_BY:
                store(V, z, load(V, x) / load(V, b))
            elif op == ops.NEG:
                store(V, z, splat(-1.0) * load(V, x))
            elif k == 0:
                _leading(op, V, a, b, rows[r, 2], rows[r, 3], out, out + length)
            else:
                _higher(op, V, a, b, rows[r, 2], out, out + length, k)


@kernel
def clear_constants(laws: Any, V: Any, t: int, base: int, orders: int) -> None:
    """Set the constant registers of a block of contacts to zero, and store the numbers of the law."""
    length = orders * WIDTH
    for i in range(laws.constant_ptr[t], laws.constant_ptr[t + 1]):
        pair = 2 if laws.constant_rows[i, 0] in PAIRED else 1
        clear(V, base + laws.constant_rows[i, 4] * length, pair * length)
    for i in range(laws.par_ptr[t], laws.par_ptr[t + 1]):
        clear(V, base + laws.par_reg[i] * length, length)
    for i in range(laws.number_ptr[t], laws.number_ptr[t + 1]):
        clear(V, base + laws.number_reg[i] * length, length)
        store(V, base + laws.number_reg[i] * length, splat(laws.number_val[i]))
