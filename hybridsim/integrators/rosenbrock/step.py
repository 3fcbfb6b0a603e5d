"""This module takes one trial step of a Rosenbrock method, and estimates its error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import call, kernel
from hybridsim.engine.series.interpreter import advance
from hybridsim.engine.system.series_at import registers_at
from hybridsim.engine.system.system import System

_SMALLEST_NORMAL = 2.0**-1022  # of doubles; the reciprocals of smaller numbers may overflow


@dataclass(frozen=True)
class RosenbrockTableau:
    """A Rosenbrock method with s stages, in the form without Jacobian-vector products.

            (1/(gamma h) - J) U_i = f(t + nodes_i h, x + sum_j a_ij U_j) + sum_j c_ij U_j/h + d_i h df/dt
            x1 = x + sum_i m_i U_i, error = sum_i e_i U_i
            x(theta) = (1 - theta) x0 + theta (x1 + (1 - theta)(K_0 + theta (K_1 + ...))), K = dense @ U

    E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, section IV.7,
    doi:10.1007/978-3-642-05221-7.
    """

    gamma: float
    a: np.ndarray
    c: np.ndarray
    m: np.ndarray
    e: np.ndarray
    nodes: np.ndarray
    d: np.ndarray
    dense: np.ndarray
    order: int
    error_order: int

    @property
    def arrays(self) -> tuple[Any, ...]:
        """Return the coefficients of the tableau as arrays for `rosenbrock_attempt`."""
        return self.gamma, self.a, self.c, self.m, self.e, self.nodes, self.d


@kernel
def linearise(rows: Any, flow_registers: Any, s: float, x: Any, V: Any, jacobian: Any, rate: Any) -> None:
    """Compute the Jacobian (n, n) and the time derivative (n,) of the flow at (s, x).

    Both come from the tape at first order, one direction at a time; V (registers, 2) holds its constants.
    """
    time, states, derivatives = flow_registers
    n = states.shape[0]
    if time >= 0:
        V[time, 0], V[time, 1] = s, 1.0
    for i in range(n):
        V[states[i], 0], V[states[i], 1] = x[i], 0.0
    advance(rows, V, 0)
    advance(rows, V, 1)
    for i in range(n):
        rate[i] = V[derivatives[i], 1]
    if time >= 0:
        V[time, 1] = 0.0
    for j in range(n):
        V[states[j], 1] = 1.0
        advance(rows, V, 1)
        for i in range(n):
            jacobian[i, j] = V[derivatives[i], 1]
        V[states[j], 1] = 0.0


class Linearisation:
    """Computes Jacobians (n, n) and time derivatives (n,) of the flow in one combination of modes."""

    def __init__(self, system: System, p: np.ndarray, z: np.ndarray) -> None:
        inputs, tape = system.registers.inputs, system.optimised_tape(z)
        self._rows, self._flow_registers = tape.rows, (int(inputs.time[0]), inputs.states, tape.derivatives)
        self._V = registers_at(system, p, z, 2)

    def at(self, s: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the Jacobian and the time derivative at (s, x)."""
        jacobian, rate = np.empty((len(x), len(x))), np.empty(len(x))
        linearise(self._rows, self._flow_registers, s, x, self._V, jacobian, rate)
        return jacobian, rate


@kernel
def factor(a: Any, pivots: Any) -> bool:
    """Compute LU factors in place with partial pivoting; return False if the matrix is singular or not finite."""
    n = a.shape[0]
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[p, k]):
                p = i
        pivots[k] = p
        if not 0.0 < abs(a[p, k]) < math.inf:
            return False
        for j in range(k, n):
            a[k, j], a[p, j] = a[p, j], a[k, j]
        for i in range(k + 1, n):
            a[i, k] /= a[k, k]
            for j in range(k + 1, n):
                a[i, j] -= a[i, k] * a[k, j]
    return True


@kernel
def solve(a: Any, pivots: Any, b: Any) -> None:
    """Solve a linear system in place with the factors and pivots from `factor`."""
    n = a.shape[0]
    for k in range(n):
        p = pivots[k]
        b[k], b[p] = b[p], b[k]
        for i in range(k + 1, n):
            b[i] -= a[i, k] * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= a[k, j] * b[j]
        b[k] /= a[k, k]


@kernel
def rosenbrock_attempt(
    flow: Any,
    tableau: Any,
    s: float,
    h: float,
    x: Any,
    jacobian: Any,
    rate: Any,
    p: Any,
    z: Any,
    tolerances: Any,
    matrix: Any,
    pivots: Any,
    slope: Any,
    stages: Any,
    out: Any,
) -> float:
    """Try one step of length `h` from (s, x); write its end to `out` and return its scaled error.

    tableau: see `RosenbrockTableau`. tolerances: rtol, atol. matrix, pivots, slope: scratch space. stages (s,
    n): output. If 1/(gamma h) may overflow, the step is one of Euler's method, whose error is below any rounding.
    """
    gamma, a, c, m, e, nodes, d = tableau
    rtol, atol = tolerances
    n = x.shape[0]
    if abs(gamma * h) < _SMALLEST_NORMAL:
        matrix[:], stages[:] = 0.0, 0.0
        call(flow, s, x, p, z, slope)
        for i in range(n):
            matrix[i, i], pivots[i] = math.inf, i  # the limit of the matrix of a step of length zero
            out[i] = x[i] + h * slope[i]
            if not abs(out[i]) < math.inf:
                return math.nan
        return 0.0
    for i in range(n):
        for j in range(n):
            matrix[i, j] = -jacobian[i, j]
        matrix[i, i] += 1.0 / (gamma * h)
    if not factor(matrix, pivots):
        return math.nan
    for k in range(nodes.shape[0]):
        for i in range(n):
            total = 0.0
            for j in range(k):
                total += a[k, j] * stages[j, i]
            out[i] = x[i] + total
        call(flow, s + nodes[k] * h, out, p, z, slope)
        for i in range(n):
            total = 0.0
            for j in range(k):
                total += c[k, j] * stages[j, i]
            stages[k, i] = slope[i] + total / h + d[k] * h * rate[i]
        solve(matrix, pivots, stages[k])
    square = 0.0
    for i in range(n):
        total, error = 0.0, 0.0
        for k in range(nodes.shape[0]):
            total += m[k] * stages[k, i]
            error += e[k] * stages[k, i]
        out[i] = x[i] + total
        scale = atol[i] + rtol * max(abs(x[i]), abs(out[i]))
        if scale > 0.0:
            square += (error / scale) ** 2
        elif not abs(total) < math.inf:
            return math.nan
    return math.sqrt(square / n) if n > 0 else 0.0
