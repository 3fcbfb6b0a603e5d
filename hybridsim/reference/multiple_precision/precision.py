"""This module chooses the number of digits and of terms, and the size below which a number counts as zero."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

Number = Any  # an mpmath.mpf of the precision's own context

# Extra digits for the losses in the sums over a series and at the events of a run.
_SPARE = 10
# Of the requested digits, this many lie below the size that counts as zero. An exact zero is wrong by
# rounding only, about 10^-(digits + _SPARE - 5) of its terms; a quantity that is not exactly zero is rarely
# that small.
_BELOW_ZERO = 12


@dataclass(frozen=True)
class Precision:
    """Arithmetic with its own mpmath context, independent of the global precision.

    Parameters
    ----------
    context : mpmath context.
    digits : the digits of the trajectory.
    order : degree of the Taylor series.
    zero : relative size below which a coefficient counts as zero.
    """

    context: Any
    digits: int
    order: int
    zero: Number

    @classmethod
    def of(cls, digits: int) -> Precision:
        """Return the arithmetic for a number of digits.

        The work for a given span grows like order^2 * 10^(digits/order), which has a flat minimum at an order
        of 1.15*digits (A. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99,
        doi:10.1080/10586458.2005.10128904).
        """
        import mpmath

        context = mpmath.mp.clone()
        context.dps = digits + _SPARE
        return cls(context, digits, math.ceil(1.15 * digits), context.mpf(10) ** -(digits - _BELOW_ZERO))

    @property
    def bits(self) -> float:
        """Return the truncation error of a step in bits, relative to the size of the quantity."""
        return (self.digits + 2) * math.log2(10)

    def number(self, value: Any) -> Number:
        """Return a number in this precision; doubles are converted exactly."""
        return self.context.mpf(value)

    def log2(self, value: Number) -> int:
        """Return the binary magnitude of a non-zero number: 2^(result - 1) <= |value| < 2^result."""
        return int(self.context.mag(value))
