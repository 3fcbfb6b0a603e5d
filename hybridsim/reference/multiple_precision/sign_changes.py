"""This module finds all sign changes of a power series within a step, in order.

A polynomial in Bernstein form has, within its interval, at most as many zeros as its coefficients have sign
changes, and the difference is even (R. T. Farouki, Computer Aided Geometric Design 29 (2012) 379,
doi:10.1016/j.cagd.2012.03.001). Bisection therefore leaves intervals with no zero or with one.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybridsim.reference.multiple_precision.expansion import Coefficients, rate_at, value_at
from hybridsim.reference.multiple_precision.precision import Number, Precision

# An interval of 2^-40 of a step that may still contain two zeros is a touch, not a crossing.
_DEEPEST = 40
# Bernstein coefficients in double precision are accurate to 1e-14 of the largest coefficient, as sums of up
# to forty terms with rounding of 1e-16. Above ten times this bound their signs are certain.
_SURE = 1e-13


def sign_changes(c: Coefficients, h: Number, precision: Precision) -> list[Number]:
    """Return the times in (0, h] at which a power series changes its sign.

    Parameters
    ----------
    c : coefficients; the first must not be zero, because a zero at the start of a step is not a crossing.
    """
    scaled, power = [], precision.context.one
    for value in c:
        scaled.append(value * power)
        power = power * h
    if abs(scaled[0]) > sum(abs(value) for value in scaled[1:]):
        return []
    size = max(abs(value) for value in scaled)
    rough = _double_table(len(c)) @ np.array([float(value / size) for value in scaled])
    if (rough > _SURE).all() or (rough < -_SURE).all():
        return []
    table = _table(precision, len(c))
    fdot = precision.context.fdot
    bernstein = [fdot(row, scaled[: len(row)]) for row in table]
    zero, one = precision.context.zero, precision.context.one
    return [h * u for u in _isolate(scaled, bernstein, zero, one, 0, precision)]


def _isolate(
    p: Sequence[Number], bernstein: list[Number], low: Number, width: Number, depth: int, precision: Precision
) -> list[Number]:
    """Return the points in an interval at which a polynomial changes its sign."""
    signs = [value > 0 for value in bernstein if value != 0]
    changes = sum(a != b for a, b in itertools.pairwise(signs))
    if changes == 0:
        return []
    if changes == 1 or depth == _DEEPEST:
        return [_refine(p, low, low + width, precision)] if changes % 2 else []
    left, right, row = [bernstein[0]], [bernstein[-1]], bernstein
    while len(row) > 1:
        row = [(a + b) / 2 for a, b in itertools.pairwise(row)]
        left.append(row[0])
        right.append(row[-1])
    half = width / 2
    found = _isolate(p, left, low, half, depth + 1, precision)
    found += _isolate(p, right[::-1], low + half, half, depth + 1, precision)
    # A zero at the middle itself is in neither half.
    if row[0] == 0 and _side_at_end(left) != _side_at_end(right):
        found = sorted([*found, low + half])
    return found


def _side_at_end(row: Sequence[Number]) -> bool:
    """Return whether the last coefficient that is not zero is positive."""
    return bool(next(value for value in reversed(row) if value != 0) > 0)


def _refine(p: Sequence[Number], low: Number, high: Number, precision: Precision) -> Number:
    """Return the only zero in an interval, by Newton's method with bisection as a safeguard."""
    rising = value_at(p, high) > value_at(p, low)
    resolution = precision.context.eps
    u = (low + high) / 2
    for _ in range(4 * math.ceil(precision.bits)):
        value = value_at(p, u)
        if value == 0:
            return u
        low, high = (low, u) if (value > 0) == rising else (u, high)
        slope = rate_at(p, u)
        following = u - value / slope if slope != 0 else low
        if not low < following < high:
            following = (low + high) / 2
        if abs(following - u) <= resolution:
            return following
        u = following
    return u


@functools.cache
def _fractions(n: int) -> tuple[tuple[tuple[int, int], ...], ...]:
    """Return the matrix of the conversion of n coefficients to Bernstein form."""
    return tuple(tuple((math.comb(j, i), math.comb(n - 1, i)) for i in range(j + 1)) for j in range(n))


@functools.cache
def _double_table(n: int) -> NDArray[np.float64]:
    table = np.zeros((n, n))
    for j, row in enumerate(_fractions(n)):
        table[j, : j + 1] = [a / b for a, b in row]
    return table


@functools.lru_cache(maxsize=8)
def _table(precision: Precision, n: int) -> list[list[Any]]:
    return [[precision.number(a) / b for a, b in row] for row in _fractions(n)]
