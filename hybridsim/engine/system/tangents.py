"""This module computes first derivatives of rates, guards, surfaces and monitors.

This is forward automatic differentiation of the tape (A. Griewank and A. Walther, Evaluating Derivatives, 2nd ed., SIAM
2008, chapter 3). Each register has its value and its derivatives in D directions, and each operation has its own rule.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.series import operations as ops
from hybridsim.engine.series.interpreter import advance
from hybridsim.engine.series.optimise import live_rows
from hybridsim.engine.system.slopes_at_edge import slopes_at_edge
from hybridsim.engine.system.system import System


@inlined
def _combine(D: Any, out: int, first: float, a: int, second: float, b: int) -> None:
    """Set D[out] = first * D[a] + second * D[b], where zero times infinity is zero."""
    for j in range(D.shape[1]):
        total = 0.0
        if D[a, j] != 0.0:
            total += first * D[a, j]
        if D[b, j] != 0.0:
            total += second * D[b, j]
        D[out, j] = total


@kernel
def _tangent(op: int, a: int, b: int, c: int, out: int, V: Any, D: Any) -> None:
    """Compute the derivative of one operation from the derivatives of its operands."""
    u, v, y = V[a, 0], V[b, 0], V[out, 0]
    if op in (ops.ADD, ops.ADD_CONSTANT):
        _combine(D, out, 1.0, a, 1.0, b)
    elif op in (ops.SUB, ops.SUB_CONSTANT):
        _combine(D, out, 1.0, a, -1.0, b)
    elif op == ops.CONSTANT_SUB:
        _combine(D, out, -1.0, a, 1.0, b)
    elif op == ops.NEG:
        _combine(D, out, -1.0, a, 0.0, a)
    elif op in (ops.MUL, ops.SCALE):
        _combine(D, out, v, a, u, b)
    elif op in (ops.DIV, ops.DIVIDE_BY):
        _combine(D, out, 1.0 / v, a, -y / v, b)
    elif op == ops.SQRT:
        _combine(D, out, 0.5 / y, a, 0.0, a)
    elif op == ops.EXP:
        _combine(D, out, y, a, 0.0, a)
    elif op in (ops.SINCOS, ops.SINCOS_LINEAR):
        _combine(D, out, V[out + 1, 0], a, 0.0, a)
        _combine(D, out + 1, -y, a, 0.0, a)
    elif op == ops.SINHCOSH:
        _combine(D, out, V[out + 1, 0], a, 0.0, a)
        _combine(D, out + 1, y, a, 0.0, a)
    elif op == ops.TANGENT:  # tan and 1 + tan^2; tanh and 1 - tanh^2
        _combine(D, out, V[out + 1, 0], a, 0.0, a)
        _combine(D, out + 1, 2.0 * y if b == 0 else -2.0 * y, out, 0.0, a)
    elif op == ops.INTEGRAL and c == ops.ANGLE:
        square = u * u + v * v
        _combine(D, out, -v / square, a, u / square, b)
    elif op == ops.INTEGRAL:  # y' a = b'
        _combine(D, out, 0.0, a, 1.0 / u, b)
    elif op == ops.ABS:
        _combine(D, out, 1.0 if u >= 0.0 else -1.0, a, 0.0, a)
    elif op in (ops.MIN, ops.MAX):
        takes_a = (u <= v) == (op == ops.MIN)
        _combine(D, out, 1.0 if takes_a else 0.0, a, 0.0 if takes_a else 1.0, b)
    elif op == ops.SELECT:
        source = b if u != 0.0 else c
        for j in range(D.shape[1]):  # equality at one point does not hold next to it
            D[out, j] = D[c, j] if u != 0.0 and D[a, j] != 0.0 else D[source, j]
    elif op == ops.EQUAL:
        _combine(D, out, 1.0, a, -1.0, b)
    else:  # other comparisons and logic
        _combine(D, out, 0.0, a, 0.0, a)


@inlined
def _is_at_edge(op: int, a: int, b: int, c: int, out: int, V: Any, D: Any) -> bool:
    """Return whether an operation may have no derivative at its present arguments, such as a root at zero."""
    u, v = V[a, 0], V[b, 0]
    if op == ops.SQRT:
        return bool(V[out, 0] == 0.0)
    if op == ops.INTEGRAL:
        return bool(u == 0.0 and (c != ops.ANGLE or v == 0.0))
    if op in (ops.ABS, ops.SIGN):
        return bool(u == 0.0)
    if op in (ops.MIN, ops.MAX, ops.EQUAL, ops.LESS, ops.LESS_EQUAL) and u == v and c != ops.AGREEING:
        for j in range(D.shape[1]):
            if D[a, j] != D[b, j]:
                return True
    return False


@kernel
def run_tangents(
    rows: Any,
    inputs: Any,
    seeds: Any,
    outputs: Any,
    s: Any,
    x: Any,
    p: Any,
    V: Any,
    D: Any,
    values: Any,
    tangents: Any,
) -> None:
    """Write values and derivatives of some registers at times s (m,) and states x (m, n).

    The last column of values is 1 if an operation may have no derivative there, and else 0.
    seeds (n + 1 + P, D): directions of the states, of local time, and of each entry of p.
    """
    time, states = inputs.time[0], inputs.states
    n = states.shape[0]
    for i in range(inputs.constants.shape[0]):
        V[inputs.constants[i], 0] = inputs.values[i, 0]
        for j in range(D.shape[1]):
            D[inputs.constants[i], j] = 0.0
    for i in range(inputs.parameters.shape[0]):
        r, source = inputs.parameters[i], inputs.sources[i]
        V[r, 0] = p[source]
        for j in range(D.shape[1]):
            D[r, j] = seeds[n + 1 + source, j]
    for m in range(s.shape[0]):
        if time >= 0:
            V[time, 0] = s[m]
            for j in range(D.shape[1]):
                D[time, j] = seeds[n, j]
        for i in range(n):
            V[states[i], 0] = x[m, i]
            for j in range(D.shape[1]):
                D[states[i], j] = seeds[i, j]
        advance(rows, V, 0)
        is_at_edge = False
        for r in range(rows.shape[0]):
            op, a, b, c, out = rows[r, 0], rows[r, 1], rows[r, 2], rows[r, 3], rows[r, 4]
            _tangent(op, a, b, c, out, V, D)
            is_at_edge |= _is_at_edge(op, a, b, c, out, V, D)
        values[m, outputs.shape[0]] = 1.0 if is_at_edge else 0.0
        for i in range(outputs.shape[0]):
            values[m, i] = V[outputs[i], 0]
            for j in range(D.shape[1]):
                tangents[m, i, j] = D[outputs[i], j]


class Tangents(NamedTuple):
    """Values (m, W) and derivatives (m, W, D) of W functions of a mode; NaN where a derivative does not exist."""

    values: np.ndarray
    slopes: np.ndarray


class TangentTape:
    """The instruction tape of one combination of modes for rates and other functions with derivatives.

    Parameters
    ----------
    guards, monitors, surfaces : numbers of the functions that follow the rates of the n states.
    """

    def __init__(
        self,
        system: System,
        z: np.ndarray,
        guards: tuple[int, ...] = (),
        monitors: tuple[int, ...] = (),
        surfaces: tuple[int, ...] = (),
    ) -> None:
        tape = system.optimised_tape(z)
        self._outputs = np.concatenate(
            [
                tape.derivatives,
                tape.guards[list(guards)],
                tape.monitors[list(monitors)],
                tape.surfaces[list(surfaces)],
            ]
        ).astype(np.int64)
        self._rows = live_rows(np.concatenate([tape.constant_rows, tape.rows]), self._outputs)
        self._registers = system.registers

    def is_same(self, other: TangentTape) -> bool:
        """Return whether another instruction tape computes the same quantities by the same operations."""
        return np.array_equal(self._rows, other._rows) and np.array_equal(self._outputs, other._outputs)

    def __call__(self, s: np.ndarray, x: np.ndarray, p: np.ndarray, seeds: np.ndarray) -> Tangents:
        """Evaluate values and derivatives at times (m,) and states (m, n), along the columns of `seeds`."""
        found, edges = self._along(s, x, p, seeds)
        for m in np.flatnonzero(edges):
            at = float(s[m]), np.array(x[m], dtype=float), p

            def displaced(ds: float, dx: np.ndarray, dp: np.ndarray, at: Any = at) -> np.ndarray:
                near, still = self._along(np.array([at[0] + ds]), (at[1] + dx)[None], at[2] + dp, seeds)
                slopes = near.slopes[0]
                return np.where(np.isfinite(slopes), slopes, np.nan) if still[0] else slopes

            found.slopes[m] = slopes_at_edge(displaced, *at, seeds)
        return found

    def _along(
        self, s: np.ndarray, x: np.ndarray, p: np.ndarray, seeds: np.ndarray
    ) -> tuple[Tangents, np.ndarray]:
        """Return values, derivatives, and a mask of points at which the derivatives may not exist."""
        count, outputs, directions = self._registers.count, len(self._outputs), seeds.shape[1]
        values, slopes = np.empty((len(s), outputs + 1)), np.empty((len(s), outputs, directions))
        run_tangents(
            self._rows, self._registers.inputs, np.ascontiguousarray(seeds), self._outputs,
            np.ascontiguousarray(s, dtype=float), np.ascontiguousarray(x, dtype=float), p,
            np.zeros((count, 1)), np.zeros((count, directions)), values, slopes,
        )  # fmt: skip
        return Tangents(values[:, :-1], slopes), values[:, -1] > 0.0
