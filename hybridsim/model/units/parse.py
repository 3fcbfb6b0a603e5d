"""This module reads and writes texts of units, such as "N s/m".

The parser is our own, because pint takes 0.8 s to import and build its registry, ours 8 ms, and as an optional extra it
could not check units by default.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from fractions import Fraction
from functools import cache

from hybridsim.expr.grammar import MAX_POWER
from hybridsim.model.units.unit import RADIAN, TURN, Unit, product_text

_PREFIXES = {
    "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "h": 1e2, "k": 1e3,
    "M": 1e6, "G": 1e9, "T": 1e12,
}  # fmt: skip
# Units that take prefixes, each by simpler ones. C is left out, because many write it for degC.
_PREFIXED = {
    "m": "", "g": "1e-3 kg", "s": "", "A": "", "K": "", "mol": "", "cd": "", "rad": "", "N": "kg m/s^2", "Pa": "N/m^2",
    "J": "N m", "W": "J/s", "V": "W/A", "ohm": "V/A", "Ohm": "V/A", "Ω": "V/A", "S": "A/V", "F": "A s/V",
    "Wb": "V s", "T": "Wb/m^2", "H": "Wb/A", "Hz": "turn/s", "bar": "1e5 Pa", "L": "1e-3 m^3", "l": "1e-3 m^3",
    "Nm": "N m", "Ns": "N s", "Wh": "3600 J",
}  # fmt: skip
# Units without prefixes. Only the size of degC is checked, not its zero.
_PLAIN = {
    "kg": "", "turn": "", "rev": "turn", "rpm": "turn/min", "min": "60 s", "h": "3600 s", "d": "86400 s", "t": "1e3 kg",
    "%": "0.01", "degC": "K", "°C": "K", "in": "0.0254 m", "ft": "0.3048 m", "lb": "0.45359237 kg",
    "lbf": "4.4482216152605 N", "psi": "lbf/in^2",
}  # fmt: skip
_DEGREE = Unit(((RADIAN, Fraction(1)),), math.pi / 180.0)
_BASE = {"m", "kg", "s", "A", "K", "mol", "cd", RADIAN, TURN}
# Units in which messages are written if they fit, the first ones preferred.
_SHOWN = (
    "m", "mm", "kg", "s", "N", "N/m", "N s/m", "N m", "m/s", "mm/s", "m/s^2", "mm/s^2", "rad/s", "Hz", "rpm", "deg",
    "W", "Pa", "MPa", "kN", "kN/m", "V", "A", "ohm", "F", "H", "ms", "N s", "N/s", "N s^2/m", "N m/s", "N/mm",
    "N s/mm", "N/kg", "1/s", "A/s", "V/s", "K/h", "h", "min", "N m/rad", "N m s/rad",
)  # fmt: skip
_LONGEST = 200  # characters of a text; parentheses are read recursively
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+\.?\d*(?:[eE][+-]?\d+)?)|(?P<symbol>[A-Za-zµΩ°%]+)|(?P<sign>\*\*|[*·/^()+-]))\s*"
)


class _NotAUnit(ValueError):
    """Raised if the text of a unit cannot be read."""


@cache
def read_unit(text: str) -> Unit | None:
    """Return the unit of a text, or None if the text is empty or not a known unit.

    A quotient followed by a product, as in "J/kg K", is ambiguous and therefore not known.
    """
    if len(text) > _LONGEST:
        return None
    try:
        return _Reader(text).unit()
    except (_NotAUnit, OverflowError, ZeroDivisionError):
        return None


def write_unit(unit: Unit, preferred: Iterable[str] = ()) -> str:
    """Return a unit as text, if possible as one of the preferred or usual texts."""
    if not unit.powers and unit.scale == 1.0:
        return "1"
    for text in (*preferred, *_SHOWN):
        shown = read_unit(text)
        if shown is not None and shown.powers == unit.powers and not unit.differs(shown):
            return text
    base = product_text(unit.powers)
    if math.isclose(unit.scale, 1.0, rel_tol=1e-9):
        return base
    return f"{unit.scale:g}" if base == "1" else f"{unit.scale:g} {base}"


@cache
def _of_symbol(symbol: str) -> Unit:
    """Return the unit of one symbol, with or without a prefix."""
    if symbol in ("deg", "°"):
        return _DEGREE
    if symbol in _BASE:
        return Unit(((symbol, Fraction(1)),))
    if definition := _PREFIXED.get(symbol) or _PLAIN.get(symbol):
        return _Reader(definition).unit()
    prefix, rest = symbol[:1], symbol[1:]
    if prefix in _PREFIXES and rest in _PREFIXED:
        return Unit((), _PREFIXES[prefix]) * _of_symbol(rest)
    raise _NotAUnit(symbol)


class _Reader:
    """Reads products, quotients and powers of units from left to right."""

    def __init__(self, text: str) -> None:
        text = re.sub(r"[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda found: f"^{found[0].translate(_SUPERSCRIPTS)}", text)
        text = text.replace("\u03bc", "\u00b5").replace("\u2126", "\u03a9")  # the same letters have two codes
        self._tokens: list[tuple[str, str]] = []
        at = 0
        while at < len(text):
            found = _TOKEN.match(text, at)
            if found is None:
                raise _NotAUnit(text)
            self._tokens.append((str(found.lastgroup), str(found[str(found.lastgroup)])))
            at = found.end()
        self._at = 0

    def unit(self) -> Unit:
        found = self._product()
        if self._at < len(self._tokens):
            raise _NotAUnit("the text continues after the unit")
        return found

    def _next(self) -> str:
        return self._tokens[self._at][1] if self._at < len(self._tokens) else ""

    def _take(self, *signs: str) -> bool:
        found = self._next() in signs
        self._at += found
        return found

    def _product(self) -> Unit:
        found, divided = self._power(), False
        while self._next() not in ("", ")"):
            if self._take("/"):
                found, divided = found / self._power(), True
            elif self._take("*", "·") or not divided:
                found *= self._power()
            else:
                raise _NotAUnit("a product follows a quotient without parentheses")
        return found

    def _power(self) -> Unit:
        symbol = self._next()
        base, exponent = self._atom(), Fraction(1)
        if self._take("^", "**"):
            exponent = self._exponent()
        else:
            kind, text = self._tokens[self._at] if self._at < len(self._tokens) else ("", "")
            if text == "-" or (kind == "number" and self._tokens[self._at - 1][0] == "symbol"):
                exponent = self._number()  # as in m s-1 and m2
        if symbol == "ms" and exponent < 0:
            raise _NotAUnit("'ms' with a negative exponent is ambiguous; write m s^-1 or 1/ms")
        return base.power(exponent)

    def _atom(self) -> Unit:
        if self._take("("):
            found = self._product()
            if not self._take(")"):
                raise _NotAUnit("a parenthesis is not closed")
            return found
        kind, text = self._tokens[self._at] if self._at < len(self._tokens) else ("", "")
        self._at += 1
        if kind == "number":
            size = float(text)
            if self._take("^", "**"):
                size = size ** float(self._exponent())
            if not (0.0 < size < math.inf):
                raise _NotAUnit(text)
            return Unit((), size)
        if kind != "symbol":
            raise _NotAUnit(text)
        return _of_symbol(text)

    def _exponent(self) -> Fraction:
        if not self._take("("):
            return self._number()
        found = self._number()
        if self._take("/"):
            found /= self._number()
        if not self._take(")"):
            raise _NotAUnit("a parenthesis is not closed")
        return found

    def _number(self) -> Fraction:
        sign = -1 if self._take("-") else 1
        kind, text = self._tokens[self._at] if self._at < len(self._tokens) else ("", "")
        if kind != "number" or "e" in text.lower() or float(text) > MAX_POWER:
            raise _NotAUnit(text)  # 1e-99999999 would take minutes as a fraction
        self._at += 1
        return sign * Fraction(text).limit_denominator(1000)
