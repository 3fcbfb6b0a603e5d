"""Two-point Hermite interpolation: dense output from the derivatives at both ends of a step, of any order."""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np

from hybridsim.engine.jit import kernel
from hybridsim.engine.stepping import Dense


@cache
def _right_system(count: int) -> np.ndarray:
    """Inverse of the map from the coefficients of theta**count * q to the derivatives (over k!) at theta = 1."""
    rows = [[comb(count + j, k) for j in range(count)] for k in range(count)]
    return np.linalg.inv(np.array(rows, dtype=float))


@cache
def _shift(count: int) -> np.ndarray:
    """Taylor shift by one: coefficients at theta = 0 to those at theta = 1."""
    return np.array([[comb(j, k) for k in range(count)] for j in range(count)], dtype=float)


@kernel
def _fit(left: np.ndarray, right: np.ndarray, h: float, shift: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Coefficients (n, 2 K) of the polynomial in theta: the left series, then theta**K times a correction."""
    n, count = left.shape
    out, lack = np.empty((n, 2 * count)), np.empty(count)
    for i in range(n):
        power = 1.0
        for k in range(count):
            out[i, k] = left[i, k] * power
            lack[k] = right[i, k] * power
            power *= h
        for k in range(count):
            for j in range(count):
                lack[k] -= out[i, j] * shift[j, k]
        for k in range(count):
            total = 0.0
            for j in range(count):
                total += inverse[k, j] * lack[j]
            out[i, count + k] = total
    return out


@kernel
def _evaluate(
    c: np.ndarray, s0: float, s1: float, left: np.ndarray, right: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """Values (k, n) at local times s (k,); the ends bit for bit."""
    n, size = c.shape
    out = np.empty((s.shape[0], n))
    for m in range(s.shape[0]):
        theta = (s[m] - s0) / (s1 - s0)
        for i in range(n):
            value = 0.0
            for k in range(size - 1, -1, -1):
                value = value * theta + c[i, k]
            out[m, i] = value
            if s[m] == s0:
                out[m, i] = left[i, 0]
            elif s[m] == s1:
                out[m, i] = right[i, 0]
    return out


def hermite(s0: float, s1: float, left: np.ndarray, right: np.ndarray) -> Dense:
    """The polynomial of degree 2 K - 1 that has the K Taylor coefficients `left` at s0 and `right` at s1.

    Parameters
    ----------
    left, right : (n, K) coefficients x^(k)/k!, k = 0..K-1. K = 2 is the cubic of value and slope; its error is
        h^4 x''''/384, that of K = 4 is h^8 x^(8)/(256 8!).
    """
    count = left.shape[1]
    coefficients = _fit(left, right, s1 - s0, _shift(count), _right_system(count))

    def dense(s: np.ndarray) -> np.ndarray:
        return _evaluate(coefficients, s0, s1, left, right, np.asarray(s, dtype=float))

    return dense
