"""This module interpolates a step of any order from the derivatives at both of its ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from math import comb
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import allocating_kernel, call, kernel
from hybridsim.engine.record.segments import Dense

_DEFECT = 100.0  # largest defect between the ends of a step, integrated over its length, in tolerances


@cache
def right_system(count: int) -> np.ndarray:
    """Return the matrix that maps derivatives at theta = 1 to the coefficients of a Hermite correction."""
    rows = [[comb(count + j, k) for j in range(count)] for k in range(count)]
    return np.linalg.inv(np.array(rows, dtype=float))


@cache
def shift_matrix(count: int) -> np.ndarray:
    """Return the matrix that maps Taylor coefficients at theta = 0 to Taylor coefficients at theta = 1."""
    return np.array([[comb(j, k) for k in range(count)] for j in range(count)], dtype=float)


@cache
def bernstein_weights(count: int) -> np.ndarray:
    """Return the matrix that maps Taylor coefficients at an end to Bernstein coefficients at this end.

    At the right end the signs of odd coefficients change, because theta runs backward from there.
    """
    degree = 2 * count - 1
    return np.array([[comb(j, k) / comb(degree, k) for k in range(count)] for j in range(count)])


class Hermite(NamedTuple):
    """The matrices of Hermite interpolation with K derivatives at each end."""

    shift: np.ndarray
    inverse: np.ndarray
    weights: np.ndarray
    middle: np.ndarray


@kernel
def fit(left: Any, right: Any, h: float, shift: Any, inverse: Any, lack: Any, out: Any) -> None:
    """Write the coefficients (n, 2 K) of the Hermite polynomial in theta.

    shift, inverse: `shift_matrix` and `right_system` of K. lack (K,): scratch.
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
    """Write the Hermite polynomial in powers of the time since the step's start; return whether it is finite."""
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
    """Return the weights with which the derivatives at one end enter the value and the slope at mid-step.

    The terms of the right series, with theta backward from there, have the same weights, with opposite signs in the
    slope.
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
    """Return whether the polynomial satisfies the differential equation in the middle of a step.

    The ends do not show this. If a step ends before a sharp bend of the flow, such as friction smoothed over a small
    velocity, its last derivatives are those of the bend. The polynomial is then wrong between correct ends. A step may
    also end where the flow has no value, such as just below the zero of a root. tolerances: rtol, atol. weights:
    `middle_weights`. x, dx (n,): scratch.
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
        lack = abs(change - h * dx[i])
        if lack > _DEFECT * (atol[i] + rtol * size):
            return False
        if math.isnan(lack):  # some derivative is missing; at the end the rates themselves must exist
            for j in range(n):
                x[j] = right[j, 0]
            call(flow, s + h, x, p, z, dx)
            for j in range(n):
                if not math.isfinite(dx[j]):
                    return False
            return True
    return True


@allocating_kernel
def fit_all(steps: Any, ends: Any, shift: Any, inverse: Any, out: Any) -> None:
    """Apply `fit_in_time` to many steps, given their lengths and the derivatives at both ends."""
    count = shift.shape[0]
    lack = np.empty(count)
    for i in range(ends.shape[0]):
        fit_in_time(ends[i, :, :count], ends[i, :, count:], steps[i, 1], shift, inverse, lack, out[i])


@allocating_kernel
def _evaluate(
    c: np.ndarray, s0: float, s1: float, left: np.ndarray, right: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """Return the states (k, n) at local times (k,); they are exact at both ends of the step."""
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


def on_first_use(make: Callable[[], Dense]) -> Dense:
    """Return dense output that is made when it is first evaluated.

    `functools.cache` would copy the attributes of `make` at every step, which takes a few per cent of a step.
    """
    made: list[Dense] = []

    def dense(s: np.ndarray) -> np.ndarray:
        if not made:
            made.append(make())
        return made[0](s)

    return dense


def hermite(s0: float, s1: float, left: np.ndarray, right: np.ndarray) -> Dense:
    """Return the polynomial of degree 2 K - 1 with given Taylor coefficients at both ends of a step.

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
