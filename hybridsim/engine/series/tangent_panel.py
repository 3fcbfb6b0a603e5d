"""This module applies the differentiation rules of a tape's operations at eight points at a time.

Each register has its value and its derivatives in D directions, and each operation has its own rule (A. Griewank and A.
Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, chapter 3). A panel is the eight points of one evaluation.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import call_noinline, inlined, kernel
from hybridsim.engine.native.simd.vectors import WIDTH, choose, load, padded_rows, splat, store
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series import operations as ops
from hybridsim.engine.series.interpreter import advance


class Panel(NamedTuple):
    """Scratch arrays for one panel of R registers with D directions."""

    registers: np.ndarray  # (R, 1 + D, 8) values, followed by derivatives, of each register at each point
    active: np.ndarray  # (R,) whether a register has a derivative that is not zero
    one: np.ndarray  # (R, 1) values at one point
    factors: np.ndarray  # (16,) of the derivatives of both arguments
    edges: np.ndarray  # (8,) whether an operation may have no derivative at each point


def panel(registers: int, directions: int) -> Any:
    """Return packed scratch arrays for a panel."""
    rows = padded_rows(registers * (1 + directions), WIDTH)
    return packed(
        Panel(
            rows.reshape(registers, 1 + directions, WIDTH),
            np.zeros(registers, dtype=np.int64),
            np.zeros((registers, 1)),
            np.zeros(2 * WIDTH),
            np.zeros(WIDTH, dtype=np.int64),
        )
    )


@inlined
def set_everywhere(panel: Any, r: int, value: float, seeds: Any, row: int) -> None:
    """Set a register to the same value and derivatives at all points; the derivatives are zero if row < 0."""
    W, width = panel.registers, panel.registers.shape[1]
    store(W, r * width * WIDTH, splat(value))
    active = 0
    if row >= 0:
        for j in range(width - 1):
            if seeds[row, j] != 0.0:
                active = 1
            store(W, (r * width + 1 + j) * WIDTH, splat(seeds[row, j]))
    panel.active[r] = active


@kernel
def set_numbers(panel: Any, inputs: Any, p: Any, seeds: Any) -> None:
    """Set the constants and the entries of the run-time vector p, with derivatives `seeds` (n + 1 + P, D)."""
    n = inputs.states.shape[0]
    for i in range(inputs.constants.shape[0]):
        set_everywhere(panel, inputs.constants[i], inputs.values[i, 0], seeds, -1)
    for i in range(inputs.parameters.shape[0]):
        source = inputs.sources[i]
        set_everywhere(panel, inputs.parameters[i], p[source], seeds, n + 1 + source)


@kernel
def set_points(panel: Any, inputs: Any, s: Any, x: Any, first: int, count: int, seeds: Any) -> None:
    """Set time and states at the points `first`, ..., `first` + `count` - 1; the last one fills the panel."""
    time, states, W = inputs.time[0], inputs.states, panel.registers
    n = states.shape[0]
    if time >= 0:
        set_everywhere(panel, time, 0.0, seeds, n)
        for m in range(WIDTH):
            W[time, 0, m] = s[first + min(m, count - 1)]
    for i in range(n):
        set_everywhere(panel, states[i], 0.0, seeds, i)
        for m in range(WIDTH):
            W[states[i], 0, m] = x[first + min(m, count - 1), i]


@kernel
def _combine(panel: Any, out: int, a: int, b: int, first: Any, second: Any) -> None:
    """Set the derivatives of `out` to first * D[a] + second * D[b], where D are derivatives; omit b if b < 0.

    A zero derivative times an infinite factor is zero.
    """
    W, active, width, zero = panel.registers, panel.active, panel.registers.shape[1], splat(0.0)
    has_a, has_b = active[a] != 0, b >= 0 and active[b] != 0
    active[out] = 1 if has_a or has_b else 0
    for j in range(1, width):
        total = zero
        if has_a:
            slope = load(W, (a * width + j) * WIDTH)
            total = choose(slope, first * slope, zero)
        if has_b:
            slope = load(W, (b * width + j) * WIDTH)
            total = total + choose(slope, second * slope, zero)
        if has_a or has_b:
            store(W, (out * width + j) * WIDTH, total)


@kernel
def _select(panel: Any, a: int, b: int, c: int, out: int) -> None:
    """Choose the derivatives of b or c by the condition a; an equality counts as false, as it holds at one point."""
    W, active = panel.registers, panel.active
    active[out] = 1
    for m in range(WIDTH):
        for j in range(1, W.shape[1]):
            takes_b = W[a, 0, m] != 0.0 and not (active[a] != 0 and W[a, j, m] != 0.0)
            source = b if takes_b else c
            W[out, j, m] = W[source, j, m] if active[source] != 0 else 0.0


@inlined
def _value(panel: Any, row: Any, count: int) -> None:
    """Compute the values of one operation at all points."""
    op, a, b, c, out = row[0, 0], row[0, 1], row[0, 2], row[0, 3], row[0, 4]
    W, width, one = panel.registers, panel.registers.shape[1], panel.one
    left, right, at = a * width * WIDTH, b * width * WIDTH, out * width * WIDTH
    if op in (ops.ADD, ops.ADD_CONSTANT):
        store(W, at, load(W, left) + load(W, right))
    elif op in (ops.SUB, ops.SUB_CONSTANT):
        store(W, at, load(W, left) - load(W, right))
    elif op in (ops.MUL, ops.SCALE):
        store(W, at, load(W, left) * load(W, right))
    else:
        is_pair = op in (ops.SINCOS, ops.SINCOS_LINEAR, ops.SINHCOSH, ops.TANGENT)
        for m in range(WIDTH):
            if m < count:
                one[a, 0], one[b, 0] = W[a, 0, m], W[b, 0, m]
                if op == ops.SELECT:
                    one[c, 0] = W[c, 0, m]
                call_noinline(advance, (row, one, 0))
            W[out, 0, m] = one[out, 0]
            if is_pair:
                W[out + 1, 0, m] = one[out + 1, 0]


@inlined
def _tangent(panel: Any, op: int, a: int, b: int, c: int, out: int) -> None:
    """Apply the differentiation rule of one operation; all values are known."""
    W, width, F = panel.registers, panel.registers.shape[1], panel.factors
    u, v = load(W, a * width * WIDTH), load(W, b * width * WIDTH)
    y, one = load(W, out * width * WIDTH), splat(1.0)
    left, right, first, second = a, b, one, one
    is_pair = op in (ops.SINCOS, ops.SINCOS_LINEAR, ops.SINHCOSH, ops.TANGENT)
    if op in (ops.ADD, ops.ADD_CONSTANT):
        pass
    elif op in (ops.SUB, ops.SUB_CONSTANT, ops.EQUAL):
        second = splat(-1.0)
    elif op == ops.CONSTANT_SUB:
        first = splat(-1.0)
    elif op == ops.NEG:
        first, right = splat(-1.0), -1
    elif op in (ops.MUL, ops.SCALE):
        first, second = v, u
    elif op in (ops.DIV, ops.DIVIDE_BY):
        first, second = one / v, splat(0.0) - y / v
    elif op == ops.SQRT:
        first, right = splat(0.5) / y, -1
    elif op == ops.EXP:
        first, right = y, -1
    elif is_pair:
        first, right = load(W, (out + 1) * width * WIDTH), -1
    elif op == ops.INTEGRAL and c == ops.ANGLE:
        square = u * u + v * v
        first, second = splat(0.0) - v / square, u / square
    elif op == ops.INTEGRAL:  # y' a = b'
        first, left, right = one / u, b, -1
    elif op in (ops.ABS, ops.MIN, ops.MAX):
        for m in range(WIDTH):
            takes_a = (W[a, 0, m] <= W[b, 0, m]) == (op == ops.MIN)
            F[m], F[WIDTH + m] = (1.0, 0.0) if takes_a else (0.0, 1.0)
            if op == ops.ABS:
                F[m] = 1.0 if W[a, 0, m] >= 0.0 else -1.0
        first, second = load(F, 0), load(F, WIDTH)
        right = -1 if op == ops.ABS else b
    elif op == ops.SELECT:
        call_noinline(_select, (panel, a, b, c, out))
        return
    else:  # other comparisons and logic
        panel.active[out] = 0
        return
    call_noinline(_combine, (panel, out, left, right, first, second))
    if is_pair:  # tan and 1 + tan^2; tanh and 1 - tanh^2
        left = out if op == ops.TANGENT else a
        sign = 1.0 if op == ops.SINHCOSH else -1.0
        if op == ops.TANGENT:
            sign = 2.0 if b == 0 else -2.0
        call_noinline(_combine, (panel, out + 1, left, -1, splat(sign) * y, one))


@inlined
def _mark_edges(panel: Any, op: int, a: int, b: int, c: int, out: int) -> None:
    """Mark the points at which an operation may have no derivative, such as a root at zero."""
    W, active, edges = panel.registers, panel.active, panel.edges
    for m in range(WIDTH):
        u, v = W[a, 0, m], W[b, 0, m]
        if op == ops.SQRT:
            edges[m] |= W[out, 0, m] == 0.0
        elif op == ops.INTEGRAL:
            edges[m] |= u == 0.0 and (c != ops.ANGLE or v == 0.0)
        elif op in (ops.ABS, ops.SIGN):
            edges[m] |= u == 0.0
        elif u == v and c != ops.AGREEING:  # of MIN, MAX, EQUAL, LESS, LESS_EQUAL
            for j in range(1, W.shape[1]):
                one = W[a, j, m] if active[a] != 0 else 0.0
                other = W[b, j, m] if active[b] != 0 else 0.0
                edges[m] |= one != other


@kernel
def run_panel(rows: Any, panel: Any, count: int) -> None:
    """Apply all operations with their differentiation rules at the first `count` points of a panel."""
    for m in range(WIDTH):
        panel.edges[m] = 0
    for r in range(rows.shape[0]):
        op, a, b, c, out = rows[r, 0], rows[r, 1], rows[r, 2], rows[r, 3], rows[r, 4]
        _value(panel, rows[r : r + 1], count)
        _tangent(panel, op, a, b, c, out)
        has_edge = op in (ops.SQRT, ops.INTEGRAL, ops.ABS, ops.SIGN, ops.MIN, ops.MAX)
        if has_edge or op in (ops.EQUAL, ops.LESS, ops.LESS_EQUAL):
            _mark_edges(panel, op, a, b, c, out)


@inlined
def slope_at(panel: Any, register: int, direction: int, point: int) -> float:
    """Return the derivative of a register in one direction at one point."""
    return panel.registers[register, 1 + direction, point] if panel.active[register] != 0 else 0.0


@kernel
def run_tangents(
    rows: Any,
    inputs: Any,
    seeds: Any,
    outputs: Any,
    s: Any,
    x: Any,
    p: Any,
    panel: Any,
    values: Any,
    slopes: Any,
) -> None:
    """Write values and derivatives of some registers at times s (m,) and states x (m, n).

    The last column of values is 1 if an operation may have no derivative there, and else 0.
    seeds (n + 1 + P, D): directions of the states, of local time, and of each entry of p.
    """
    set_numbers(panel, inputs, p, seeds)
    for first in range(0, s.shape[0], WIDTH):
        count = min(WIDTH, s.shape[0] - first)
        set_points(panel, inputs, s, x, first, count, seeds)
        call_noinline(run_panel, (rows, panel, count))
        for m in range(count):
            values[first + m, outputs.shape[0]] = panel.edges[m]
            for i in range(outputs.shape[0]):
                values[first + m, i] = panel.registers[outputs[i], 0, m]
                for j in range(seeds.shape[1]):
                    slopes[first + m, i, j] = slope_at(panel, outputs[i], j, m)
