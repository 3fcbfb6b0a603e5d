"""Two-point Hermite interpolation: dense output from the derivatives at both ends of a step, of any order."""

from __future__ import annotations

import math
from functools import cache
from math import comb
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import allocating_kernel, call, kernel
from hybridsim.engine.record.segments import Dense

_DEFECT = 100.0  # times the tolerance: by how much a step may miss the flow between its ends, over its length


@cache
def right_system(count: int) -> np.ndarray:
    """Inverse of the map from the coefficients of theta**count * q to the derivatives (over k!) at theta = 1."""
    rows = [[comb(count + j, k) for j in range(count)] for k in range(count)]
    return np.linalg.inv(np.array(rows, dtype=float))


@cache
def shift_matrix(count: int) -> np.ndarray:
    """Taylor shift by one: coefficients at theta = 0 to those at theta = 1."""
    return np.array([[comb(j, k) for k in range(count)] for j in range(count)], dtype=float)


@cache
def bernstein_weights(count: int) -> np.ndarray:
    """From the Taylor coefficients at an end (in theta) to the `count` Bernstein coefficients of degree 2 K - 1 there.

    On the right the signs of odd coefficients change, since theta runs backward from there.
    """
    degree = 2 * count - 1
    return np.array([[comb(j, k) / comb(degree, k) for k in range(count)] for j in range(count)])


class Hermite(NamedTuple):
    """The matrices of one K: `shift_matrix`, `right_system`, `bernstein_weights`, `middle_weights`."""

    shift: np.ndarray
    inverse: np.ndarray
    weights: np.ndarray
    middle: np.ndarray


@kernel
def fit(left: Any, right: Any, h: float, shift: Any, inverse: Any, lack: Any, out: Any) -> None:
    """Coefficients (n, 2 K) of the polynomial in theta: the left series, then theta**K times a correction.

    shift, inverse: `shift_matrix` and `right_system` of K; lack (K,) is room.
    """
    n, count = left.shape
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


@kernel
def fit_in_time(left: Any, right: Any, h: float, shift: Any, inverse: Any, lack: Any, out: Any) -> bool:
    """The same in powers of the time from the left end; whether all coefficients are finite."""
    fit(left, right, h, shift, inverse, lack, out)
    power, total = 1.0, 0.0
    for k in range(out.shape[1]):
        for i in range(out.shape[0]):
            out[i, k] /= power
            total += abs(out[i, k])
        power *= h
    return total < math.inf


@cache
def middle_weights(count: int) -> np.ndarray:
    """Of the terms of the left series at theta = 1 in the value of the polynomial at theta = 1/2, and in its slope.

    Terms of the right series, theta running backward from there, have the same weights; in the slope with other signs.
    """
    found, lack = np.empty((2, count)), np.empty(count)
    for k in range(count):
        left, right, out = np.eye(count)[[k]], np.zeros((1, count)), np.empty((1, 2 * count))
        fit(left, right, 1.0, shift_matrix(count), right_system(count), lack, out)
        polynomial = np.polynomial.Polynomial(out[0])
        found[:, k] = polynomial(0.5), polynomial.deriv()(0.5)
    return found


@kernel
def holds_between(
    flow: Any,
    weights: Any,
    s: float,
    h: float,
    left: Any,
    right: Any,
    p: Any,
    z: Any,
    tolerances: Any,
    x: Any,
    dx: Any,
) -> bool:
    """Whether in the middle of a step the polynomial meets the flow as well as the tolerances ask for.

    The ends tell nothing of that: where a step ends before a sharp bend of the flow, such as that of a friction
    smoothed over a small velocity, its last derivatives are those of the bend, and the polynomial is far off between
    ends that are right. tolerances: rtol, atol. weights: `middle_weights`. x, dx (n,): room.
    """
    rtol, atol = tolerances
    n, count = left.shape
    for i in range(n):
        value, power, sign = 0.0, 1.0, 1.0
        for k in range(count):
            value += weights[0, k] * power * (left[i, k] + sign * right[i, k])
            power, sign = power * h, -sign
        x[i] = value
    call(flow, s + 0.5 * h, x, p, z, dx)
    for i in range(n):
        change, power, sign = 0.0, 1.0, 1.0
        for k in range(count):
            change += weights[1, k] * power * (left[i, k] - sign * right[i, k])
            power, sign = power * h, -sign
        size = max(abs(x[i]), max(abs(left[i, 0]), abs(right[i, 0])))
        if abs(change - h * dx[i]) > _DEFECT * (atol[i] + rtol * size):
            return False
    return True


@allocating_kernel
def fit_all(steps: Any, ends: Any, shift: Any, inverse: Any, out: Any) -> None:
    """`fit_in_time` for many steps: steps (m, 2) with lengths last, ends (m, n, 2 K) left series and then right."""
    count = shift.shape[0]
    lack = np.empty(count)
    for i in range(ends.shape[0]):
        fit_in_time(ends[i, :, :count], ends[i, :, count:], steps[i, 1], shift, inverse, lack, out[i])


@allocating_kernel
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
    n, count = left.shape
    coefficients = np.empty((n, 2 * count))
    fit(left, right, s1 - s0, shift_matrix(count), right_system(count), np.empty(count), coefficients)

    def dense(s: np.ndarray) -> np.ndarray:
        return _evaluate(coefficients, s0, s1, left, right, np.asarray(s, dtype=float))

    return dense
