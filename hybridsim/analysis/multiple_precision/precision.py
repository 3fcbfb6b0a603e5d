"""How many digits, how many terms, and what counts as zero."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

Number = Any  # an mpmath.mpf of the precision's own context

# Digits carried beyond those asked for: what the sums over a series and the events of a run may lose.
_SPARE = 10
# Of the digits asked for, these remain below the size that counts as zero: an exact zero is off by rounding only, some
# 10^-(digits + _SPARE - 5) of its terms, and a quantity that is not zero by nature is hardly ever as small as that.
_BELOW_ZERO = 12


@dataclass(frozen=True)
class Precision:
    """Arithmetic with its own mpmath context, so that no global precision is read or changed.

    Parameters
    ----------
    context : mpmath context.
    digits : digits that the trajectory is meant to have.
    order : degree of the Taylor series.
    zero : relative size below which a coefficient counts as zero.
    """

    context: Any
    digits: int
    order: int
    zero: Number

    @classmethod
    def of(cls, digits: int) -> Precision:
        """The arithmetic for a number of digits.

        The work for a given span goes like order^2 * 10^(digits/order), which is least at an order of 1.15*digits
        (A. Jorba, M. Zou, Experimental Mathematics 14 (2005) 99, doi:10.1080/10586458.2005.10128904); it is flat there.
        """
        import mpmath

        context = mpmath.mp.clone()
        context.dps = digits + _SPARE
        return cls(context, digits, math.ceil(1.15 * digits), context.mpf(10) ** -(digits - _BELOW_ZERO))

    @property
    def bits(self) -> float:
        """The truncation error of a step is this many bits below the size of what is followed."""
        return (self.digits + 2) * math.log2(10)

    def number(self, value: Any) -> Number:
        """A number of this context; exact for doubles."""
        return self.context.mpf(value)

    def log2(self, value: Number) -> int:
        """The binary magnitude of a number that is not zero: 2^(result - 1) <= |value| < 2^result."""
        return int(self.context.mag(value))
