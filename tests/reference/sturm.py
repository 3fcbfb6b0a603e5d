"""How many real zeros a polynomial with double coefficients has in an interval, counted exactly (Sturm's theorem)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise


class Sturm:
    """Sturm's chain of sum a_k t**k in integers; multiple zeros count once."""

    def __init__(self, coefficients: Sequence[float]) -> None:
        parts = [Fraction(float(a)) for a in coefficients]
        scale = math.lcm(*(part.denominator for part in parts))
        p = _trimmed([int(part * scale) for part in parts])
        self.chain = [p, [k * a for k, a in enumerate(p)][1:]] if len(p) > 1 else [p]
        while len(self.chain[-1]) > 1:
            rest = _remainder(self.chain[-2], self.chain[-1])
            if not rest:
                break
            self.chain.append(rest)

    def count(self, low: Fraction, high: Fraction) -> int:
        """Zeros in (low, high]."""
        return self._changes(low) - self._changes(high)

    def _changes(self, t: Fraction) -> int:
        signs = [s for p in self.chain if (s := _sign(p, t.numerator, t.denominator))]
        return sum(a != b for a, b in pairwise(signs))


def _trimmed(p: list[int]) -> list[int]:
    while p and p[-1] == 0:
        p.pop()
    return p


def _sign(p: list[int], up: int, down: int) -> int:
    total, power = 0, 1
    for a in reversed(p):
        total = total * up + a * power
        power *= down
    return (total > 0) - (total < 0)


def _remainder(a: list[int], b: list[int]) -> list[int]:
    """Minus the remainder of a by b, times a positive number, without common factors."""
    a = list(a)
    lead, way = abs(b[-1]), 1 if b[-1] > 0 else -1
    while len(a) >= len(b):
        factor, shift = a[-1] * way, len(a) - len(b)
        a = [lead * value for value in a]
        for k, value in enumerate(b):
            a[shift + k] -= factor * value
        a = _trimmed(a[:-1])
    common = math.gcd(*a) if a else 1
    return [-value // common for value in a]
