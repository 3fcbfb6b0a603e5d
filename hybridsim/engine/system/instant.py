"""This module computes with times in double-double precision, as unevaluated sums of two doubles.

Error-free sums and products after T. J. Dekker, Numer. Math. 18 (1971) 224, doi:10.1007/BF01397083.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel

_SPLITTER = 134217729.0  # 2**27 + 1: splits a 53-bit significand into two halves with exact products
# 2*pi to 107 + 53 bits as an unevaluated sum of three doubles
_TWO_PI = (6.283185307179586, 2.4492935982947064e-16, -5.989539619436679e-33)


class Instant(NamedTuple):
    """A time as the unevaluated sum ``high + low`` with |low| <= ulp(high)/2."""

    high: float
    low: float = 0.0

    def plus(self, step: float) -> Instant:
        """Return this instant plus a number of type double, rounded to double-double precision."""
        high, error = two_sum(self.high, step)
        return Instant(*two_sum(high, error + self.low))

    def minus(self, other: Instant) -> float:
        """Return the difference of two instants, rounded once to a double."""
        high, error = two_sum(self.high, -other.high)
        return high + (error + (self.low - other.low))

    def __float__(self) -> float:
        return float(self.high + self.low)  # float() must not return a NumPy double


@inlined
def two_sum(a: float, b: float) -> tuple[float, float]:
    """Return the rounded sum of two numbers and its exact rounding error."""
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


@inlined
def two_product(a: float, b: float) -> tuple[float, float]:
    """Return the rounded product of two numbers and its exact rounding error."""
    product = a * b
    t = _SPLITTER * a
    a_high = t - (t - a)
    a_low = a - a_high
    t = _SPLITTER * b
    b_high = t - (t - b)
    b_low = b - b_high
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def multiples(start: float, k: np.ndarray, period: float) -> np.ndarray:
    """Return the scheduled times (m, 2) with the numbers k (m,), each bit for bit equal to the result of `multiple`."""
    high, error = _plain(two_product)(k.astype(float), period)
    total, rest = _plain(two_sum)(start, high)
    return np.stack(_plain(two_sum)(total, rest + error), axis=1)


def later(instants: np.ndarray, step: float) -> np.ndarray:
    """Return instants (m, 2) plus a number, bit for bit equal to the results of `Instant.plus`."""
    high, error = _plain(two_sum)(instants[:, 0], step)
    return np.stack(_plain(two_sum)(high, error + instants[:, 1]), axis=1)


def _plain(kernel: Any) -> Any:
    """Return the uncompiled function of a kernel, because the Python function also accepts arrays."""
    return getattr(kernel, "py_func", kernel)


def times(instant: Instant, factor: float) -> Instant:
    """Return an instant times a double, in double-double precision."""
    high, error = two_product(instant.high, factor)
    return Instant(*two_sum(high, error + instant.low * factor))


def multiple(start: float, k: int, period: float) -> Instant:
    """Return the k-th scheduled time, start + k*period, without accumulated rounding errors."""
    high, error = two_product(float(k), period)
    total, rest = two_sum(start, high)
    return Instant(*two_sum(total, rest + error))


def rest_of_rate(rate: float, period: float) -> float:
    """Return 2 pi/period - rate accurately, for a rate that differs from 2 pi/period by rounding errors only."""
    product, error = two_product(rate, period)
    return ((_TWO_PI[0] - product) - error + _TWO_PI[1]) / period


def phase(instant: Instant, rate: float, offset: float) -> float:
    """Return the phase (rate*instant + offset) modulo 2 pi, accurate for any number of turns."""
    return float(phase_of(instant.high, instant.low, rate, offset))


@kernel
def phase_of(high: float, low: float, rate: float, offset: float) -> float:
    """Return the phase (rate*(high + low) + offset) modulo 2 pi, accurate for any number of turns.

    The result is in [-pi, pi], or outside by the rounding of the whole angle if that is half a turn. The product and
    the reduction use two doubles. After 1e6 turns the angle is accurate to one ulp, while a plain ``rate*t`` would have
    lost six digits.
    """
    product, error = two_product(high, rate)
    angle, rest = two_sum(product, error + low * rate)
    total, error = two_sum(angle, offset)
    angle, rest = two_sum(total, error + rest)
    if not math.isfinite(angle):
        return math.nan
    turns = np.rint(angle / _TWO_PI[0])
    a, a_error = two_product(turns, _TWO_PI[0])
    b, b_error = two_product(turns, _TWO_PI[1])
    left, error = two_sum(angle, -a)
    return left + (((error + rest) - a_error) - b - b_error - turns * _TWO_PI[2])
