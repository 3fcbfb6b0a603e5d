"""This module defines units: powers of base units, and a scale."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

Powers = tuple[tuple[str, Fraction], ...]

# Angles have no dimension. They are kept as powers only to tell turns from radians.
RADIAN, TURN = "rad", "turn"
_ANGLES = frozenset({RADIAN, TURN})
_ORDER = ("kg", "m", "s", "A", "K", "mol", "cd", RADIAN, TURN)
# Two scales that differ by less are equal: conversion factors such as pi/180 are rounded.
_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Unit:
    """A unit as a multiple of a product of powers of base units.

    Parameters
    ----------
    powers : base units in alphabetical order, each with its power, which is not zero.
    scale : the size of the unit in these base units, such as 1e-3 for mm.
    """

    powers: Powers = ()
    scale: float = 1.0

    def __mul__(self, other: Unit) -> Unit:
        return Unit(_sum((*self.powers, *other.powers)), self.scale * other.scale)

    def __truediv__(self, other: Unit) -> Unit:
        return self * other.power(Fraction(-1))

    def power(self, exponent: Fraction) -> Unit:
        """Return a power of the unit."""
        powers = _sum((name, power * exponent) for name, power in self.powers)
        try:
            return Unit(powers, self.scale ** float(exponent))
        except (OverflowError, ZeroDivisionError):
            return Unit(powers, math.nan)

    def without_angles(self) -> Unit:
        """Return the unit without radians and turns."""
        return Unit(self.dimension, self.scale)

    @property
    def dimension(self) -> Powers:
        """The powers of those base units that have a dimension, so without angles."""
        return tuple((name, power) for name, power in self.powers if name not in _ANGLES)

    @property
    def is_number(self) -> bool:
        """Whether a value in this unit is a pure number, such as an argument of a sine."""
        return not self.differs(ONE) and TURN not in dict(self.powers)

    def differs(self, other: Unit) -> str:
        """Return "dimension" or "scale" if values in two units cannot be added, otherwise an empty string.

        Radians and turns agree with pure numbers, but not with each other.
        """
        if self.dimension != other.dimension:
            return "dimension"
        own, others = dict(self.powers), dict(other.powers)
        mixed = (TURN in own and RADIAN in others) or (RADIAN in own and TURN in others)
        if not all(0.0 < scale < math.inf for scale in (self.scale, other.scale)):
            return ""  # a power that no double holds
        return "" if not mixed and math.isclose(self.scale, other.scale, rel_tol=_TOLERANCE) else "scale"

    def factor(self, other: Unit) -> float:
        """Return the factor that converts a value in this unit to another unit of the same dimension."""
        turns = dict((self / other).powers).get(TURN, Fraction(0))
        return self.scale / other.scale * math.tau ** float(turns)


ONE = Unit()


def most_frequent(units: Sequence[Unit]) -> Unit:
    """Return the unit that agrees with most of some units, or the first of several such units."""
    return max(dict.fromkeys(units), key=lambda unit: sum(not unit.differs(other) for other in units))


def _sum(powers: Iterable[tuple[str, Fraction]]) -> Powers:
    """Return powers with one entry for each base unit."""
    total: dict[str, Fraction] = {}
    for name, power in powers:
        total[name] = total.get(name, Fraction(0)) + power
    return tuple(sorted((name, power) for name, power in total.items() if power))


def product_text(powers: Powers) -> str:
    """Return powers of base units as text, such as "kg m/s^2"."""
    known = sorted(powers, key=lambda pair: _ORDER.index(pair[0]))
    above = [_power_text(name, power) for name, power in known if power > 0]
    below = [_power_text(name, -power) for name, power in known if power < 0]
    if not below:
        return " ".join(above) or "1"
    return f"{' '.join(above) or '1'}/{below[0] if len(below) == 1 else '(' + ' '.join(below) + ')'}"


def _power_text(name: str, power: Fraction) -> str:
    if power == 1:
        return name
    return f"{name}^{power}" if power.denominator == 1 else f"{name}^({power})"
