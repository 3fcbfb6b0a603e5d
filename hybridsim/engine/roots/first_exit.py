"""This module finds the first time at which a polynomial becomes negative, with an error bound.

In Bernstein form on [0, 1] the coefficients of a power series are sums of its own with weights in [0, 1], so
that the change of basis loses no accuracy. There is no root if the coefficients share a sign (R. T. Farouki,
Computer Aided Geometric Design 29 (2012) 379, doi:10.1016/j.cagd.2012.03.001).
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import call_series, inlined, kernel, polynomial_kernel

NEVER, FOUND, OPEN = 0, 1, 2  # outcomes: stays positive, a root, undecided because of rounding
POSITIVE, NEGATIVE, WITHIN, ONCE, MIXED = range(5)  # signs of a piece
_DEEPEST = 40  # most halvings; an undecided piece of this width is a touch
_POLISH = 100  # iterations: bisection alone needs 53
_NEAR = 1e-6  # relative change in Halley's third-order method below which the remaining error is known


@kernel
def to_bernstein(a: Any, b: Any) -> None:
    """Compute the Bernstein coefficients on [0, 1] of a polynomial."""
    n = a.shape[0] - 1
    b[0] = a[0]
    share = 1.0  # 1/C(n, k)
    for k in range(1, n + 1):
        share *= k / (n - k + 1.0)
        b[k] = a[k] * share
    for k in range(1, n + 1):  # differences to values, by sums over Pascal's triangle
        for j in range(n, k - 1, -1):  # backward, so that the sums are independent
            b[j] += b[j - 1]


@inlined
def halve(stack: Any, top: int, m: int, b: Any) -> None:
    """Split the interval on top of the stack into two halves, with the left half on top."""
    left, width = stack[top, m], 0.5 * stack[top, m + 1]
    for i in range(m):
        b[i] = stack[top, i]
    for step in range(m):
        stack[top + 1, step] = b[0]
        stack[top, m - 1 - step] = b[m - 1 - step]
        for i in range(m - 1 - step):
            b[i] = 0.5 * (b[i] + b[i + 1])
    stack[top, m], stack[top, m + 1] = left + width, width
    stack[top + 1, m], stack[top + 1, m + 1] = left, width


@kernel
def first_exit(
    a: Any, error: float, floor: float, order: int, b: Any, stack: Any, code: int
) -> tuple[int, float]:
    """Find the first theta in (0, 1] at which a polynomial becomes negative.

    The first `order` coefficients are set to zero and the next is positive. error bounds the distance of p
    from the function that it approximates, and floor bounds its deviation from zero at the start. p is
    shifted by the error, and q = p/theta**order, whose zeros are searched, by floor/theta**order.

    The result is (NEVER, 1) if p stays above the bounds and (FOUND, theta) for a certain zero. It is (OPEN,
    theta) if p comes within the bounds without a certain change of sign before the next certain one, or at
    the end. b (m,), stack (64, m + 2): scratch space for m coefficients, and for pieces with their left ends
    and widths. code: address of a function that does `to_bernstein` for that many coefficients
    (`hybridsim.engine.series.emit_bernstein`), 0 for none.
    """
    m = a.shape[0] - order
    for i in range(m):
        b[i] = a[order + i]
    rest = 0.0
    for i in range(1, m):
        rest += abs(b[i])
    if b[0] - rest > error + 2.0**order * floor:
        return NEVER, 1.0
    if order > 0:
        b[0] = max(b[0], 2.0 * (error + floor))  # positive by definition, regardless of rounding
    if code != 0:
        call_series(code, 0.0, 0.0, b, b, b, stack)
    else:
        to_bernstein(b[:m], stack[0, :m])
    stack[0, m], stack[0, m + 1] = 0.0, 1.0
    top, touched, last = 1, -1.0, 0.0
    while top > 0:
        top -= 1
        left, width = stack[top, m], stack[top, m + 1]
        shift = floor
        if left > 0.0:
            for _ in range(order):
                shift /= left
        kind = signs_of(stack[top, :m], error + shift)
        if kind == POSITIVE and left == 0.0 and order > 0 and width > 2.0**-_DEEPEST and dips(stack[top, :m]):
            kind = MIXED  # the first half is less accurate than the second
        if kind == POSITIVE:
            if touched >= 0.0:
                return OPEN, touched
            last = left + width
            continue
        if kind == NEGATIVE:
            start = last if touched < 0.0 else touched
            return FOUND, polished(a, order, min(last, start), left, 0.5 * (min(last, start) + left))
        if touched < 0.0 and kind == ONCE:
            start = left + width * change_of_sign(stack[top, :m])
            return FOUND, polished(a, order, left, left + width, start)
        if width <= 2.0**-_DEEPEST or kind == WITHIN:
            if touched < 0.0:
                touched = left
            continue
        halve(stack, top, m, b)
        top += 2
    return (NEVER, 1.0) if touched < 0.0 else (OPEN, touched)


@kernel
def signs_of(b: Any, error: float) -> int:
    """Classify the signs of a polynomial on an interval from its Bernstein coefficients.

    POSITIVE, NEGATIVE: all coefficients are, beyond the error. WITHIN: none is beyond the error. ONCE: the
    piece certainly begins positive, ends negative and has one zero, since the coefficients change their sign
    once.
    """
    m = b.shape[0]
    above = 0
    while above < m and b[above] > error:
        above += 1
    if above == m:
        return POSITIVE
    if above == 0:
        below, within = 0, 0
        for i in range(m):
            below += b[i] < -error
            within += abs(b[i]) <= error
        return NEGATIVE if below == m else WITHIN if within == m else MIXED
    if not b[m - 1] < -error:
        return MIXED
    changes = 0
    for i in range(above, m):
        changes += (b[i] < 0.0) != (b[i - 1] < 0.0)
    return ONCE if changes == 1 else MIXED


@kernel
def dips(b: Any) -> bool:
    """Return whether Bernstein coefficients fall below half of the first coefficient and rise again."""
    lowest = b[0]
    for i in range(1, b.shape[0]):
        if b[i] > lowest and lowest < 0.5 * b[0]:
            return True
        lowest = min(lowest, b[i])
    return False


@kernel
def change_of_sign(b: Any) -> float:
    """Return the point in [0, 1] at which the polygon of the Bernstein coefficients first becomes negative."""
    i = 1
    while b[i] >= 0.0:
        i += 1
    return (i - 1 + b[i - 1] / (b[i - 1] - b[i])) / (b.shape[0] - 1)


@polynomial_kernel
def _expanded(a: Any, order: int, theta: float) -> tuple[float, float, float]:
    """Return value, slope and half the curvature, at theta, of the polynomial with the coefficients a[order:].

    With q = theta**2 they are E(q) + theta O(q): the even and odd powers are independent sums.
    """
    q, last = theta * theta, a.shape[0] - 1
    even = even_slope = even_bend = odd = odd_slope = odd_bend = 0.0
    if (last - order) % 2 == 0:  # one more even power than odd powers
        even = a[last]
        last -= 1
    for k in range(last, order, -2):
        odd_bend = odd_bend * q + odd_slope
        odd_slope = odd_slope * q + odd
        odd = odd * q + a[k]
        even_bend = even_bend * q + even_slope
        even_slope = even_slope * q + even
        even = even * q + a[k - 1]
    slope = odd + 2.0 * theta * (even_slope + theta * odd_slope)
    bend = even_slope + 4.0 * q * even_bend + theta * (3.0 * odd_slope + 4.0 * q * odd_bend)
    return even + theta * odd, slope, bend


@kernel
def polished(a: Any, order: int, left: float, right: float, start: float) -> float:
    """Compute the zero of a polynomial between a point with a positive value and a point with a negative value.

    Halley's method (W. Gander, American Mathematical Monthly 92 (1985) 131) starts from a guess between them;
    bisection replaces a step that leaves the interval.
    """
    theta = start
    for _ in range(_POLISH):
        value, slope, curvature = _expanded(a, order, theta)
        if value > 0.0:
            left = theta
        elif value < 0.0:
            right = theta
        else:
            return theta
        change = value / slope if slope != 0.0 else math.nan
        bend = change * curvature / slope  # the remaining error is about its square times the change
        if bend < 0.5:
            change /= 1.0 - bend
        moved = theta - change
        if left < moved < right:
            change = abs(change)
            if change <= _NEAR * theta and change * bend * bend <= 2.0**-53 * theta:
                return moved
        else:
            moved = 0.5 * (left + right)
            if abs(moved - theta) <= 2.0**-53 * theta or not left < moved < right:
                return moved
        theta = moved
    return theta
