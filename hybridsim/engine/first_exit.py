"""The first time at which a polynomial goes negative, isolated in Bernstein form with a bound of its error.

In Bernstein form on [0, 1] the coefficients of a power series are sums of its own with weights in [0, 1], so that the
change of basis loses nothing; no root lies where they share a sign (R. T. Farouki, Computer Aided Geometric Design 29
(2012) 379, doi:10.1016/j.cagd.2012.03.001).
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.jit import kernel

NEVER, FOUND, OPEN = 0, 1, 2  # outcomes: stays positive, a root, a question of rounding
_DEEPEST = 40  # halvings; a piece that narrow and still open is a touch
_POLISH = 100  # iterations: bisection alone needs 53
_NEAR = 1e-10  # relative change by Newton's method that leaves an error below rounding, even where the slope halves


@kernel
def to_bernstein(a: Any, b: Any) -> None:
    """Bernstein coefficients b_j = sum_{k<=j} C(j, k)/C(n, k) a_k of sum_k a_k theta**k, n the degree."""
    n = a.shape[0] - 1
    b[0] = a[0]
    binomial = 1.0
    for k in range(1, n + 1):
        binomial *= (n - k + 1.0) / k
        b[k] = a[k] / binomial
    for k in range(1, n + 1):  # from differences to values: sums over Pascal's triangle
        for j in range(n, k - 1, -1):  # backward, so that no sum waits for another
            b[j] += b[j - 1]


@kernel
def first_exit(a: Any, error: float, order: int, b: Any, stack: Any) -> tuple[int, float]:
    """Where p(theta) = sum_k a_k theta**k first goes negative on (0, 1].

    The first `order` coefficients are zero by decree and the next is positive; error bounds the distance of p from the
    function that it stands for. (NEVER, 1) where p stays above the bound; (FOUND, theta); (OPEN, theta) where it comes
    within the bound without a certain change of sign up to the next certain one, or at the end. b (m,), stack (64, m +
    2): room for m coefficients, and for pieces with their left ends and widths.
    """
    m = a.shape[0] - order
    for i in range(m):
        b[i] = a[order + i]
    rest = 0.0
    for i in range(1, m):
        rest += abs(b[i])
    if b[0] - rest > error:
        return NEVER, 1.0
    if order > 0:
        b[0] = max(b[0], 2.0 * error)  # positive by decree, whatever rounding made of it
    to_bernstein(b[:m], stack[0, :m])
    stack[0, m], stack[0, m + 1] = 0.0, 1.0
    top, touched, last = 1, -1.0, 0.0
    while top > 0:
        top -= 1
        left, width = stack[top, m], stack[top, m + 1]
        low, high = math.inf, -math.inf
        for i in range(m):
            low, high = min(low, stack[top, i]), max(high, stack[top, i])
        if low > error:
            if touched >= 0.0:
                return OPEN, touched
            last = left + width
            continue
        if high < -error:
            start = last if touched < 0.0 else touched
            return FOUND, polished(a, order, min(last, start), left)
        if touched < 0.0 and changes_once(stack[top, :m], error):
            return FOUND, polished(a, order, left, left + width)
        if width <= 2.0**-_DEEPEST or (low >= -error and high <= error):
            if touched < 0.0:
                touched = left
            continue
        for i in range(m):
            b[i] = stack[top, i]
        for step in range(m):
            stack[top + 1, step] = b[0]
            stack[top, m - 1 - step] = b[m - 1 - step]
            for i in range(m - 1 - step):
                b[i] = 0.5 * (b[i] + b[i + 1])
        stack[top, m], stack[top, m + 1] = left + 0.5 * width, 0.5 * width
        stack[top + 1, m], stack[top + 1, m + 1] = left, 0.5 * width
        top += 2
    return (NEVER, 1.0) if touched < 0.0 else (OPEN, touched)


@kernel
def changes_once(b: Any, error: float) -> bool:
    """Whether a piece certainly begins positive, ends negative and has one zero: its coefficients change sign once."""
    if not (b[0] > error and b[b.shape[0] - 1] < -error):
        return False
    changes = 0
    for i in range(1, b.shape[0]):
        if (b[i] < 0.0) != (b[i - 1] < 0.0):
            changes += 1
    return changes == 1


@kernel
def polished(a: Any, order: int, left: float, right: float) -> float:
    """The zero of the deflated polynomial between a point where it is positive and one where it is negative."""
    n = a.shape[0] - 1
    theta = 0.5 * (left + right)
    for _ in range(_POLISH):
        value, slope = a[n], 0.0
        for k in range(n - 1, order - 1, -1):
            slope = slope * theta + value
            value = value * theta + a[k]
        if value > 0.0:
            left = theta
        elif value < 0.0:
            right = theta
        else:
            return theta
        moved, near = theta - value / slope if slope != 0.0 else math.nan, _NEAR
        if not left < moved < right:
            moved, near = 0.5 * (left + right), 2.0**-53
        if abs(moved - theta) <= near * theta or not left < moved < right:
            return moved
        theta = moved
    return theta
