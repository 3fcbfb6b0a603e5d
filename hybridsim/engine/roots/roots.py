"""This module finds all real roots of a guard in a step, with a measured error bound.

On a piece [a, b] the guard is sampled at 17 Chebyshev points. The polynomial of degree 8 through every second
point is the representation; its largest misfit at the other points, doubled, is the error bound. Pieces whose
bound is not small are halved, so a long step over a fast guard costs samples, never a root. A polynomial in
Bernstein form has no root where its coefficients share a sign (R. T. Farouki, Computer Aided Geometric Design
29 (2012) 379, doi:10.1016/j.cagd.2012.03.001); halving isolates every root, and a dip that comes within the
bound is reported as a near-grazing, not lost. Coefficients that are zero by decree at the left end are
divided out (deflation), so a guard that has just fired cannot fire again from the same zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from math import comb

import numpy as np

from hybridsim.engine.native.kernels import allocating_kernel, kernel
from hybridsim.engine.native.loop_hints import put
from hybridsim.engine.system.failures import StepFailure

DEGREE = 8
SAMPLES = 2 * DEGREE + 1
# A piece is accepted when its error bound is below this share of the guard's largest value on it: about the
# square root of the unit roundoff, so that only dips deeper than rounding count and few halvings are needed.
_ACCEPT = 2.0**-30
# Halvings of a step: theta itself is rounded to 2**-53, so a function of it cannot be resolved to 2**-30 of its size on
# a piece narrower than 2**-23. A few halvings later a piece is accepted with any bound.
_DEEPEST = 26
_ROUNDING_DEPTH = 4  # halvings after which the misfit of an unresolved piece may be rounding alone
_MAX_SUBDIVISIONS = 200_000  # a guard that needs more oscillates about 20 000 times within one step
_CLOSEST = 40  # halvings toward the start of a step in the search for a value larger than rounding
# of the largest value on a step: a lower dip is compared with the rounding of the values
_TOUCHING = 2.0**-40
_ROUNDINGS_BEFORE = 8.0  # in roundings of one step: error that may remain from earlier steps
_TINY = 1e-290  # size of values below which rounding is no longer relative
_NARROWEST = 2.0**-26  # width of a piece below which neighbouring signs decide an undecided sign

# Chebyshev points of the second kind on [0, 1]
POINTS = 0.5 - 0.5 * np.cos(np.pi * np.arange(SAMPLES) / (SAMPLES - 1))


def _transforms() -> tuple[np.ndarray, np.ndarray]:
    """Return matrices that map values at sample points to Bernstein coefficients and to values at other points."""
    nodes = POINTS[::2]
    basis = np.array(
        [[comb(DEGREE, i) * x**i * (1 - x) ** (DEGREE - i) for i in range(DEGREE + 1)] for x in POINTS]
    )
    to_bernstein = np.linalg.inv(basis[::2])
    between = basis[1::2] @ to_bernstein
    assert len(nodes) == DEGREE + 1
    return to_bernstein, between


_TO_BERNSTEIN, _BETWEEN = _transforms()
_GROWTH = float(
    np.abs(_TO_BERNSTEIN).sum(axis=1).max()
)  # amplification of the samples' rounding in the coefficients


@dataclass(frozen=True)
class Crossing:
    """A change of sign of a guard in the part (left, right) of a step; +1 is upward."""

    left: float
    right: float
    direction: int


@dataclass(frozen=True)
class Grazing:
    """A minimum of |guard| within the error bound, at which the sign does not certainly change."""

    theta: float
    distance: float


@allocating_kernel
def _halve(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the two halves of a polynomial in Bernstein form, by de Casteljau's algorithm."""
    n = b.shape[0]
    left, right, work = np.empty(n), np.empty(n), b.copy()
    for k in range(n):
        left[k] = work[0]
        right[n - 1 - k] = work[n - 1 - k]
        for i in range(n - 1 - k):
            work[i] = 0.5 * (work[i] + work[i + 1])
    return left, right


@kernel
def _sign(b: np.ndarray, bound: np.ndarray) -> int:
    """Return +1 or -1 if all coefficients have one sign beyond their error bounds, otherwise 0."""
    positive, negative = True, True
    for i in range(b.shape[0]):
        positive = positive and b[i] > bound[i]
        negative = negative and b[i] < -bound[i]
    if positive:
        return 1
    return -1 if negative else 0


@kernel
def _within(b: np.ndarray, bound: np.ndarray) -> bool:
    """Return whether a polynomial lies within its error bounds, so that halving gives no information."""
    for i in range(b.shape[0]):
        if abs(b[i]) > bound[i]:
            return False
    return True


@allocating_kernel
def sign_pattern(b: np.ndarray, bound: np.ndarray) -> tuple[np.ndarray, int]:
    """Return intervals as rows (left, right, sign); the sign is 0 where rounding may hide it."""
    n = b.shape[0]
    rows = np.empty((1024, 3))
    count = 0
    # depth-first from the left; a stack of (coefficients, bounds, left, width)
    coefficients, bounds = np.empty((128, n)), np.empty((128, n))
    place, width = np.empty(128), np.empty(128)
    place[0], width[0] = 0.0, 1.0
    put(b, coefficients[0])
    put(bound, bounds[0])
    top = 1
    while top > 0:
        top -= 1
        c, e, x, w = coefficients[top].copy(), bounds[top].copy(), place[top], width[top]
        s = _sign(c, e)
        if s == 0 and w > _NARROWEST and count < 1000 and not _within(c, e):
            cl, cr = _halve(c)
            el, er = _halve(e)
            for halves, errors, left in ((cr, er, x + 0.5 * w), (cl, el, x)):
                put(halves, coefficients[top])
                put(errors, bounds[top])
                place[top], width[top] = left, 0.5 * w
                top += 1
        elif count > 0 and rows[count - 1, 2] == s:
            rows[count - 1, 1] = x + w
        else:
            rows[count, 0], rows[count, 1], rows[count, 2] = x, x + w, s
            count += 1
    return rows[:count], count


@kernel
def _represent(samples: np.ndarray, coefficients: np.ndarray) -> tuple[float, float]:
    """Compute the Bernstein coefficients of a sampled function, its error bound and its largest value."""
    misfit, largest = 0.0, 0.0
    for i in range(DEGREE + 1):
        coefficients[i] = 0.0
        for j in range(DEGREE + 1):
            coefficients[i] += _TO_BERNSTEIN[i, j] * samples[2 * j]
    for i in range(DEGREE):
        value = -samples[2 * i + 1]
        for j in range(DEGREE + 1):
            value += _BETWEEN[i, j] * samples[2 * j]
        if not abs(value) <= misfit:
            misfit = abs(value)
    for j in range(DEGREE + 1):
        largest = max(largest, abs(samples[2 * j]))
    return 2.0 * misfit + 4.0 * 2.0**-53 * _GROWTH * largest, largest


@kernel
def _deflated(coefficients: np.ndarray, bounds: np.ndarray, order: int, side: int) -> int:
    """Divide a polynomial by theta**order in place, and return how many coefficients remain.

    The first `order` coefficients are zero. The sign of the new leading coefficient is set too, regardless of
    its rounding error.
    """
    n = coefficients.shape[0]
    for _ in range(order):
        for i in range(1, n):
            factor = (n - 1) / i
            coefficients[i - 1] = coefficients[i] * factor
            bounds[i - 1] = bounds[i] * factor
        n -= 1
    if order > 0 and side != 0:
        coefficients[0] = side * max(side * coefficients[0], 2.0 * bounds[0])
    return n


@allocating_kernel
def quiet(
    values: np.ndarray, numbers: np.ndarray, sides: np.ndarray, orders: np.ndarray, floors: np.ndarray
) -> np.ndarray:
    """Return a mask of the functions that certainly keep their signs over a step, from samples (17, functions)."""
    result = np.zeros(numbers.shape[0], dtype=np.bool_)
    coefficients, bounds = np.empty(DEGREE + 1), np.empty(DEGREE + 1)
    samples = np.empty(SAMPLES)
    for k in range(numbers.shape[0]):
        g = numbers[k]
        if sides[g] == 0:
            continue
        for i in range(SAMPLES):
            samples[i] = values[i, g]
        error, largest = _represent(samples, coefficients)
        if not error <= _ACCEPT * largest:
            continue
        for i in range(DEGREE + 1):
            bounds[i] = max(error, floors[g])
        n = _deflated(coefficients, bounds, orders[g], sides[g])
        result[k] = _sign(coefficients[:n], bounds[:n]) == sides[g]
    return result


def _before(
    sample: Callable[[np.ndarray], np.ndarray], theta: float, side: int, rounding: Callable[[], float]
) -> float:
    """Return a point before theta at which the function certainly has the sign `side`; if none is found, return theta.

    The sign of the leading coefficient is known. If the coefficient is within the error bound of the
    polynomial, a zero close to the start is lost, and only the function's values give information.
    """
    if side * sample(np.array([theta]))[0] > 0.0:
        return theta
    points = theta * 2.0 ** -np.arange(1.0, _CLOSEST)
    certain = np.flatnonzero(side * sample(points) > rounding())
    return float(points[certain[0]]) if len(certain) else theta


def _with_touches(
    coefficients: np.ndarray, bounds: np.ndarray, rows: np.ndarray, is_first: bool, is_last: bool
) -> np.ndarray:
    """Return the rows of `sign_pattern`; an interval in which rounding may hide a zero gets an undecided sign.

    The misfit only shows roundings that differ from sample to sample. A common one, such as that of the steps
    before, shifts the dip and stays hidden. The ends of a step have their own rules for rounding. Where the
    sign changes, the pattern is already known.
    """
    found, count = sign_pattern(coefficients, bounds)
    signs = [None, *found[:count, 2].tolist(), None]
    if (is_first and signs[1] == 0) or (is_last and signs[-2] == 0):
        return rows
    touches = [
        (left, right)
        for (left, right, sign), before, after in zip(
            found[:count].tolist(), signs[:-2], signs[2:], strict=True
        )
        if sign == 0 and (before is None or after is None or before == after)
    ]
    parts = []
    for left, right, sign in rows.tolist():
        for begin, end in touches if sign else ():
            if left <= begin and end <= right:
                parts += [(left, begin, sign), (begin, end, 0.0)]
                left = end
        parts.append((left, right, sign))
    return np.array([part for part in parts if part[0] < part[1]])


def find_roots(
    sample: Callable[[np.ndarray], np.ndarray],
    first: np.ndarray,
    order: int,
    side: int,
    stop_at_first: int,
    rounding: Callable[[], float],
    before: Callable[[float], float],
    floor: float = 0.0,
    begins: bool = False,
) -> tuple[list[Crossing], list[Grazing], int, float]:
    """Find all sign changes of one guard over a step, as theta in (0, 1].

    Parameters
    ----------
    sample : callable, thetas (k,) -> values (k,)
    first : values at `POINTS` over the whole step
    order, side : order of the guard's first non-zero coefficient at theta = 0, and its sign just after (0:
        unknown)
    rounding : function that returns a bound of the rounding error of one value; called only if needed
    before : function that returns the effect of errors at the start of the step on a value at theta; called
        only if needed
    floor : uncertainty from the location of the last event, for a function that starts from zero; smaller
        values are ignored
    begins : whether a segment begins here; a value within rounding of zero then leaves zero and is not a
        touch
    stop_at_first : direction of the first crossing after which the search may end (0: find all)

    Returns the crossings and grazings in order, the sign at the end of the step (0 if it is within the
    bound), and the first theta at which the function is not a number (infinity if there is none). No change
    of side is reported across an interval in which it is not a number.
    """
    crossings: list[Crossing] = []
    grazings: list[Grazing] = []
    last, open_from = side, -1.0  # last certain sign, and start of the undecided interval after it
    low, subdivisions, undefined = math.inf, 0, math.inf
    waiting: list[tuple[float, float, np.ndarray | None, int]] = [(0.0, 1.0, first, 0)]
    touching = _TOUCHING * np.abs(first[np.isfinite(first)]).max(initial=0.0)

    def has_left(theta: float) -> bool:
        """Return whether a function that starts at zero exceeds its rounding error before theta."""
        bound = max(floor, _ROUNDINGS_BEFORE * rounding(), before(theta))
        return bool((side * sample(theta * POINTS) > bound).any())

    while waiting:
        a, b, samples, depth = waiting.pop()
        if samples is None:
            samples = sample(a + (b - a) * POINTS)
        subdivisions += 1
        if subdivisions > _MAX_SUBDIVISIONS:
            raise StepFailure(
                f"the zeros within one step could not be separated with {subdivisions} subintervals; reduce "
                "max_step, or write the function without poles"
            )
        coefficients = np.empty(DEGREE + 1)
        error, largest = _represent(samples, coefficients)
        if not math.isfinite(error) and (depth == _DEEPEST or not np.isfinite(samples).any()):
            undefined = min(undefined, b if np.isfinite(samples[0]) else a)
            last, open_from, low = 0, -1.0, math.inf
            continue
        resolved = error <= _ACCEPT * largest or depth == _DEEPEST or _GROWTH * largest <= max(floor, _TINY)
        if not resolved and not (depth >= _ROUNDING_DEPTH and error <= _GROWTH * rounding()):
            middle = 0.5 * (a + b)
            waiting += [(middle, b, None, depth + 1), (a, middle, None, depth + 1)]
            continue
        bounds = np.full(DEGREE + 1, max(error, floor))
        n = _deflated(coefficients, bounds, order, side) if a == 0.0 else DEGREE + 1
        rows, count = sign_pattern(coefficients[:n], bounds[:n])
        if count > 1 or (rows[0, 2] and (rows[0, 2] * coefficients[:n]).min() <= touching):
            bounds[:] = max(error, floor, _ROUNDINGS_BEFORE * rounding(), before(b))
            if n <= DEGREE:
                _represent(samples, coefficients)
                _deflated(coefficients, bounds, order, side)
            rows = _with_touches(coefficients[:n], bounds[:n], rows[:count], a == 0.0, b == 1.0)
            count = len(rows)
        for left, right, sign in rows[:count]:
            x, y = a + (b - a) * left, a + (b - a) * right
            if sign == 0:
                if open_from < 0.0:
                    open_from = x
                value = sample(np.array([0.5 * (x + y)]))[0] if order == 0 or x > 0.0 else math.inf
                low = min(low, abs(value))
                continue
            if last == 0:
                last = int(sign)
            elif sign != last:
                start = open_from if open_from >= 0.0 else x
                if a == 0.0 and order > 0:
                    start = _before(sample, start, last, rounding)
                crossings.append(Crossing(start, x, int(sign)))
                last = int(sign)
                if stop_at_first == sign:
                    return crossings, grazings, last, undefined
            elif (open_from > 0.0 and (order == 0 or has_left(open_from))) or (
                open_from == 0.0 and order == 0 and not begins
            ):
                grazings.append(Grazing(0.5 * (open_from + x), low))
            open_from, low = -1.0, math.inf
        if b == 1.0 and count and rows[count - 1, 2] == 0:
            return crossings, grazings, 0, undefined
    return crossings, grazings, last, undefined
