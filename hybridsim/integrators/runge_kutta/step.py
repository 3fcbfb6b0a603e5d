"""This module takes one trial step of an explicit embedded Runge-Kutta method."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import call, kernel
from hybridsim.engine.native.struct_pack import packed

_NOTHING = 1e-9  # rounding of a coefficient that order conditions make zero


class Coefficients(NamedTuple):
    """The coefficients of a tableau as arrays: nodes, matrix, weights and error weights."""

    c: np.ndarray
    a: np.ndarray
    weights: np.ndarray


@dataclass(frozen=True)
class Tableau:
    """An explicit method with s stages: nodes c (s,), a (s, s) strictly lower triangular, weights b (s,).

    e (s,) is b minus the weights of the embedded method; the error estimate of a step is of order
    h**error_order. e_low, if given, is a second estimate of lower order that safeguards the first, as in
    DOP853: the error used is e**2/sqrt(e**2 + 0.01 e_low**2).
    """

    c: np.ndarray
    a: np.ndarray
    b: np.ndarray
    e: np.ndarray
    order: int
    error_order: int
    e_low: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def packed(self) -> Any:
        """Return the coefficients as packed arrays for compiled code."""
        rows = [self.b, self.e, self.e_low] if self.e_low.size else [self.b, self.e]
        arrays = (np.ascontiguousarray(part, dtype=float) for part in (self.c, self.a, rows))
        return packed(Coefficients(*arrays))

    @cached_property
    def leading_terms(self) -> tuple[int, float, float, int, float]:
        """Return the order and coefficient of each leading error term for a linear problem.

        On a linear problem a combination e of the stages is sum_k (e . A**(k - 1) 1) k! h**k x_k. Return the
        order q of the main estimate, its coefficients at q and q + 1, then order and coefficient of the low
        estimate, (0, 0) without one.
        """
        q, terms = self._leading(self.e)
        q_low, terms_low = self._leading(self.e_low) if self.e_low.size else (0, np.zeros(2))
        return q, float(terms[0]), float(terms[1]), q_low, float(terms_low[0])

    @cached_property
    def rounding(self) -> float:
        """Return the rounding error of a step, relative to the rounding of h times the rates."""
        return float(np.abs(self.b) @ (1.0 + np.abs(self.a).sum(axis=1)))

    @cached_property
    def real_stability(self) -> float:
        """Return the stability limit of the method on the negative real axis."""
        power, terms = np.ones(len(self.c)), [1.0]
        for _ in self.c:
            terms.append(float(self.b @ power))
            power = self.a @ power
        z = np.arange(1e-3, 3.0 * len(self.c), 1e-3)
        unstable = np.abs(np.polynomial.polynomial.polyval(-z, terms)) > 1.0 + 1e-9
        return float(z[np.argmax(unstable)])

    def _leading(self, e: np.ndarray) -> tuple[int, np.ndarray]:
        power, k = np.ones(len(self.c)), 0
        found: list[float] = []
        while len(found) < 2:
            k += 1
            term = abs(float(e @ power)) * math.factorial(k)
            if found or term > _NOTHING:
                found.append(term)
            power = self.a @ power
        return k - 1, np.array(found)


@kernel
def attempt(
    flow: Any,
    tableau: Any,
    s: float,
    h: float,
    x: Any,
    dx: Any,
    p: Any,
    z: Any,
    tolerances: Any,
    k: Any,
    out: Any,
) -> float:
    """Try one step of length `h` from (s, x); write its end to `out` and return its scaled error.

    tableau: `Coefficients`. tolerances: rtol, atol.
    """
    c, a, weights = tableau.c, tableau.a, tableau.weights
    rtol, atol = tolerances
    stages, n = c.shape[0], x.shape[0]
    for m in range(n):
        k[0, m] = dx[m]
    for i in range(1, stages):
        for m in range(n):
            total = 0.0
            for j in range(i):
                total += a[i, j] * k[j, m]
            out[m] = x[m] + h * total
        call(flow, s + c[i] * h, out, p, z, k[i])
    square, square_low = 0.0, 0.0
    for m in range(n):
        total, error, error_low = 0.0, 0.0, 0.0
        for j in range(stages):
            total += weights[0, j] * k[j, m]
            error += weights[1, j] * k[j, m]
            if weights.shape[0] > 2:
                error_low += weights[2, j] * k[j, m]
        out[m] = x[m] + h * total
        scale = atol[m] + rtol * max(abs(x[m]), abs(out[m]))
        if scale > 0.0:
            square += (error / scale) ** 2
            square_low += (error_low / scale) ** 2
    if square == 0.0 or n == 0:
        return 0.0
    weighted = square + 0.01 * square_low
    return abs(h) * square / math.sqrt(weighted * n) if weighted > 0.0 else math.nan
