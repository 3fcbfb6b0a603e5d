"""Two-point Hermite interpolation: dense output from the derivatives at both ends of a step, of any order."""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np

from hybridsim.engine.stepping import Dense


@cache
def _right_system(count: int) -> np.ndarray:
    """Inverse of the map from the coefficients of theta**count * q to the derivatives (over k!) at theta = 1."""
    rows = [[comb(count + j, k) for j in range(count)] for k in range(count)]
    return np.linalg.inv(np.array(rows, dtype=float))


def hermite(s0: float, s1: float, left: np.ndarray, right: np.ndarray) -> Dense:
    """The polynomial of degree 2 K - 1 that has the K Taylor coefficients `left` at s0 and `right` at s1.

    Parameters
    ----------
    left, right : (n, K) coefficients x^(k)/k!, k = 0..K-1. K = 2 is the cubic of value and slope; its error is
        h^4 x''''/384, that of K = 4 is h^8 x^(8)/(256 8!).
    """
    h = s1 - s0
    count = left.shape[1]
    powers = h ** np.arange(count)
    a, b = left * powers, right * powers
    # what the left series lacks at the right end, derivative by derivative
    shift = np.array([[comb(j, k) for k in range(count)] for j in range(count)], dtype=float)
    q = (b - a @ shift) @ _right_system(count).T

    def dense(s: np.ndarray) -> np.ndarray:
        theta = (np.asarray(s, dtype=float) - s0) / h
        first = np.zeros((len(theta), a.shape[0]))
        second = np.zeros_like(first)
        for k in reversed(range(count)):
            first = first * theta[:, None] + a[:, k]
            second = second * theta[:, None] + q[:, k]
        out = first + theta[:, None] ** count * second
        out[theta == 1.0] = b[:, 0]
        return out

    return dense
