"""This module bounds Taylor polynomials of a guard, to prove where the guard is positive.

Coefficients and bounds are those of `hybridsim.engine.linear.motion.guard_terms`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.kernels import inlined, polynomial_kernel
from hybridsim.engine.native.simd.vectors import WIDTH, all_larger, load, splat
from hybridsim.engine.series.bounded import UNIT

_ITERATIONS = 100
_NEAR = 1e-9  # relative change by Newton's method that leaves an error below rounding
_POLISH = 6  # iterations of Newton's method from a near start
_SAFE = 0.95  # safety factor
_HALVINGS = 5
_SQUARES = BOUND_TERMS.bit_length() - 1  # BOUND_TERMS is a power of two
# range for a dip (a parabola stays positive up to 4); iterations to its minimum; clearance there in errors
_DIPS, _TURNS, _CLEAR = 6.0, 3, 4.0
# c (x - v)**2 + e has positive coefficients in Bernstein form of degree 15 up to v + 7.5 e/(c v)
_PAST = 3.0
# a monomial x**i on [0, 1] in Bernstein form of degree BOUND_TERMS - 1: C(j, i)/C(BOUND_TERMS - 1, i)
_BERNSTEIN = np.array(
    [
        [math.comb(j, i) / math.comb(BOUND_TERMS - 1, i) for j in range(BOUND_TERMS)]
        for i in range(BOUND_TERMS)
    ]
)


@polynomial_kernel
def value_and_slope(backward: Any, count: int, d: float, start: float) -> tuple[float, float]:
    """Evaluate a polynomial and its derivative, from the highest coefficient down."""
    square = d * d
    even, odd = (start, 0.0) if count % 2 == 0 else (0.0, start)
    even_rate = odd_rate = 0.0
    if count % 2 == 1:
        even = backward[0]
    for i in range(count % 2, count, 2):
        odd_rate = odd_rate * square + odd
        odd = odd * square + backward[i]
        even_rate = even_rate * square + even
        even = even * square + backward[i + 1]
    return even + d * odd, odd + 2.0 * d * (even_rate + d * odd_rate)


@inlined
def safe_step(terms: Any, first: int, rest: float, longest: float, error: float, lower: Any) -> float:
    """Return a step over which a polynomial with a bounded remainder certainly stays positive.

    m is the number of terms. Positive terms after the first negative one are omitted. The bound then has one
    zero (Descartes' rule) and is positive before it. lower: scratch space for the terms. error: error of a
    guard that begins away from zero; the guard stays above it.
    """
    m = BOUND_TERMS - first
    is_down = False
    for i in range(m):
        a = terms[first + i]
        is_down = is_down or a < 0.0
        lower[m - 1 - i] = min(a, 0.0) if is_down else a
    if first == 0:
        lower[m - 1] -= min(error, 0.5 * lower[m - 1])
    d = longest
    a, b, c = lower[m - 1], lower[m - 2], lower[m - 3]
    if b < 0.0 or c < 0.0:  # the zero of three terms is a good guess
        turn = math.sqrt(b * b - 4.0 * a * c) - b
        if 2.0 * a < d * turn:
            d = 2.0 * a / turn
    for _ in range(_ITERATIONS):
        value, slope = value_and_slope(lower, m, d, -rest)
        if value > 0.0:
            return d
        closer = (d - value / slope) * _SAFE if slope < 0.0 else 0.0
        d = closer if 0.0 < closer < d else 0.5 * d
    return 0.0


@inlined
def _to_the_terms(d: float) -> float:
    """Return `d` to the power BOUND_TERMS by repeated squaring."""
    for _ in range(_SQUARES):
        d *= d
    return d


@inlined
def zero_of_terms(terms: Any, rest: float, size: float, backward: Any) -> float:
    """Return the next zero of a falling guard from its Taylor polynomial, or NaN if the zero is inaccurate."""
    if not terms[1] < 0.0:
        return math.nan
    d = -terms[0] / terms[1]
    if not rest * _to_the_terms(d) <= 0.25 * UNIT * size:
        return math.nan
    for i in range(BOUND_TERMS):
        backward[i] = terms[BOUND_TERMS - 1 - i]
    change = math.inf
    for _ in range(_POLISH):
        value, slope = value_and_slope(backward, BOUND_TERMS, d, 0.0)
        if not slope < 0.5 * terms[1]:
            return math.nan
        change = value / slope
        d -= change
        if abs(change) <= _NEAR * abs(d):
            break
    if not abs(change) <= _NEAR * abs(d):
        return math.nan
    rising, power = terms[1], 1.0
    for i in range(2, BOUND_TERMS):
        power *= abs(d)
        rising += i * power * (max(terms[i], 0.0) if d > 0.0 else abs(terms[i]))
    # a monotonic guard has one zero there; otherwise Newton's method may have skipped the first one
    return d if rest * _to_the_terms(d) <= 0.25 * UNIT * size and rising < 0.0 else math.nan


@inlined
def _term(terms: Any, i: int, power: float) -> float:
    return terms[i] * power if i < BOUND_TERMS else 0.0


@inlined
def stays_positive(terms: Any, first: int, rest: float, d: float, error: float) -> bool:
    """Return whether a polynomial with a bounded remainder is certainly positive on (0, d].

    The test uses the coefficients in Bernstein form, which are two vectors. error: error of the guard itself,
    which is this sum times x**first; its value at the end of the interval is used.
    """
    low, also_low, high, also_high = splat(0.0), splat(0.0), splat(0.0), splat(0.0)
    power, square, total, at = 1.0, d * d, 0.0, 0
    for i in range(0, BOUND_TERMS, 2):  # two independent sums
        u, v = _term(terms, first + i, power), _term(terms, first + i + 1, power * d)
        power *= square
        total += abs(u) + abs(v)
        x, y = splat(u), splat(v)
        if i < WIDTH:  # the later terms do not contribute to the first half
            low, also_low = low + load(_BERNSTEIN, at) * x, also_low + load(_BERNSTEIN, at + BOUND_TERMS) * y
        high = high + load(_BERNSTEIN, at + WIDTH) * x
        also_high = also_high + load(_BERNSTEIN, at + BOUND_TERMS + WIDTH) * y
        at += 2 * BOUND_TERMS
    count, square = BOUND_TERMS - first, d
    while count > 0:  # rest d**count, by squares
        if count % 2 == 1:
            rest *= square
        square *= square
        count //= 2
    for _ in range(first):
        error /= d
    lowest = splat(rest + 2.0 * BOUND_TERMS * UNIT * total + error)
    return all_larger(low + also_low, lowest) and all_larger(high + also_high, lowest)


@inlined
def past_dip(terms: Any, first: int, longest: float, error: float, backward: Any) -> float:
    """Return a point after the minimum of a guard that falls and rises, or 0 if there is no minimum."""
    a, b, c = terms[first], terms[first + 1], terms[first + 2]
    if not (b < 0.0 < c and b * b < _DIPS * a * c):
        return 0.0
    m = BOUND_TERMS - first
    for i in range(m):
        backward[m - 1 - i] = terms[first + i]
    lowest, value = -0.5 * b / c, 0.0
    for _ in range(_TURNS):
        value, slope = value_and_slope(backward, m, lowest, 0.0)
        lowest -= 0.5 * slope / c
    if not (value > _CLEAR * error and lowest > 0.0):
        return 0.0
    return min(lowest + min(lowest, _PAST * value / (c * lowest)), longest)


@inlined
def falls_over(terms: Any, rest: float, longest: float) -> float:
    """Return the distance from a zero within which the guard falls at least half as fast as at the zero, or 0."""
    steepness = -terms[1]
    if not steepness > 0.0:
        return 0.0
    d = min(longest, 0.25 * steepness / abs(terms[2])) if terms[2] != 0.0 else longest
    for _ in range(_HALVINGS):
        change, power = BOUND_TERMS * rest * d ** (BOUND_TERMS - 1), 1.0
        for i in range(2, BOUND_TERMS):
            power *= d
            change += i * abs(terms[i]) * power
        if change <= 0.5 * steepness:
            return d
        d *= 0.5
    return 0.0
