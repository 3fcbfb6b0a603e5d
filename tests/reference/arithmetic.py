"""The few functions a closed-form solution needs, once in floating point and once in mpmath.

A reference is written once over a `Numbers` object and runs in double precision or with any number of
digits; the difference of the two is the rounding error of the double run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mpmath

Real = Any  # a float or an mpmath.mpf


@dataclass(frozen=True)
class Numbers:
    """Elementary functions over one kind of number, its unit roundoff and its 2 pi as a sum hi + lo."""

    number: Callable[[Any], Real]
    sin: Callable[[Real], Real]
    cos: Callable[[Real], Real]
    exp: Callable[[Real], Real]
    expm1: Callable[[Real], Real]
    sqrt: Callable[[Real], Real]
    asin: Callable[[Real], Real]
    turn_hi: Real
    turn_lo: Real
    eps: Real
    digits: int

    def phase(self, w: Real, t: Real) -> tuple[int, Real]:
        """Split w t = 2 pi n + theta with 0 <= theta < 2 pi; exact up to the last digit for any t."""
        with mpmath.workdps(self.digits + 30):
            turns, rest = mpmath.mpf(w) * mpmath.mpf(t), 2 * mpmath.pi
            n = int(mpmath.floor(turns / rest))
            theta = turns - n * rest
        return n, self.number(theta)

    def wrap(self, n: int, theta: Real) -> tuple[int, Real]:
        """Bring a phase back into one turn; 2 pi is taken off in two parts, so nothing drifts."""
        while theta >= self.turn_hi:
            n, theta = n + 1, (theta - self.turn_hi) - self.turn_lo
        while theta < 0:
            n, theta = n - 1, (theta + self.turn_hi) + self.turn_lo
        return n, theta


FLOAT = Numbers(
    number=float,
    sin=math.sin,
    cos=math.cos,
    exp=math.exp,
    expm1=math.expm1,
    sqrt=math.sqrt,
    asin=math.asin,
    turn_hi=2 * math.pi,
    turn_lo=2.4492935982947064e-16,  # 2 pi minus its double
    eps=2.0**-53,
    digits=16,
)


def multiprecision(digits: int = 30) -> Numbers:
    """`Numbers` over mpmath with its own context, so that no global precision is touched."""
    context = mpmath.mp.clone()
    context.dps = digits
    return Numbers(
        number=context.mpf,
        sin=context.sin,
        cos=context.cos,
        exp=context.exp,
        expm1=context.expm1,
        sqrt=context.sqrt,
        asin=context.asin,
        turn_hi=2 * context.pi,
        turn_lo=context.mpf(0),
        eps=context.mpf(10) ** (-digits),
        digits=digits,
    )
