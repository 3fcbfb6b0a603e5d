"""This module labels axes of physical quantities, with prefixes instead of powers of ten."""

from __future__ import annotations

import itertools
import math
import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence

from matplotlib.axis import Axis, YAxis
from matplotlib.ticker import Formatter

from hybridsim.plot.shared.symbols import label_of, unit_text

_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
# Units that take a prefix at their start: "m" and "m/s" do; "kg" (which has one) and "1/s" do not.
_TAKES_PREFIX = re.compile(r"(m|s|N|V|A|W|J|Pa|Hz|rad|g|C|F|H|K|Nm|N m)(?![A-Za-z])")

_LEAST, _MOST = -2.0, 5.0  # digits before the point that a shared prefix may give a quantity
_ALONG_Y = 20  # letters of a title along a vertical axis
_PREFIX_COST = 0.4  # digits: 0.5 m and 1 m are in metres


class Scaled(Formatter):
    """Formats tick labels in units of `factor`, with as many decimals as the tick spacing requires."""

    def __init__(self, factor: float) -> None:
        self.factor = factor

    def format_ticks(self, values: Sequence[float]) -> list[str]:
        scaled = [value / self.factor for value in values]
        steps = [abs(b - a) for a, b in itertools.pairwise(scaled) if b != a]
        decimals = 0
        # Use the fewest decimals for which every label is exact.
        while (
            decimals < 9
            and steps
            and any(abs(round(value, decimals) - value) > 1e-3 * min(steps) for value in scaled)
        ):
            decimals += 1
        return [f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}") for value in scaled]

    def __call__(self, value: float, pos: int | None = None) -> str:
        return f"{value / self.factor:.6g}".replace("-", "\N{MINUS SIGN}")


def label_axis(
    axis: Axis, name: str, unit: str, low: float, high: float, *, title: str = "", power: int | None = None
) -> None:
    """Label an axis "title name [unit]" with a prefix, or a power of ten, that suits values from low to high.

    A `power` that was chosen for several axes (`shared_powers`) replaces the one that suits this axis.
    """
    power, prefixed = scaled_unit(unit, low, high) if power is None else (power, _prefixed(unit, power))
    text = unit_text(prefixed)
    if power and prefixed == unit:  # the unit takes no prefix
        text = f"$10^{{{power}}}$ {text}".rstrip()
    heading, symbol = label_of(name, title)
    symbol = f"{symbol} [{text}]".strip() if text else symbol
    if isinstance(axis, YAxis) and heading:
        heading = "\n".join(_in_lines(heading)) + "\n"
    axis.set_label_text(f"{heading} {symbol}".replace("\n ", "\n").strip(), fontsize=9)
    axis.set_major_formatter(Scaled(10.0**power))


def _in_lines(heading: str) -> list[str]:
    """Return the lines of a title along a vertical axis; the last line has more than two letters if possible."""
    lines = textwrap.wrap(heading, _ALONG_Y)
    if len(lines) > 1 and len(lines[-1]) <= 2 and " " in lines[-2]:
        before, _, word = lines[-2].rpartition(" ")
        lines[-2:] = [before, f"{word} {lines[-1]}"]
    return lines


def shared_powers(quantities: Mapping[str, tuple[str, float, float]]) -> dict[str, int]:
    """Return one power of ten for all quantities of one base unit, such as m and m/s, if one power suits all of them.

    `quantities` has the unit and the least and the largest value of each name. A quantity without an entry in the
    result has a power of its own.
    """
    groups: dict[str, dict[str, float]] = {}
    for name, (unit, low, high) in quantities.items():
        base, size = _TAKES_PREFIX.match(unit), max(abs(low), abs(high))
        if base and size > 0 and math.isfinite(size):
            groups.setdefault(base[1], {})[name] = math.log10(size)
    powers: dict[str, int] = {}
    for unit, sizes in groups.items():
        usual = [power for power in _PREFIXES if power == 0 or _prefixed(unit, power) != unit]
        best = min(usual, key=lambda power: (_misfit(power, sizes.values()), abs(power)))
        if len(sizes) > 1 and all(_LEAST <= size - best < _MOST for size in sizes.values()):
            powers |= dict.fromkeys(sizes, best)
    return powers


def _misfit(power: int, sizes: Iterable[float]) -> float:
    """Return the sum of the powers of ten by which sizes lie outside 1 to 1000, plus a small penalty for a prefix."""
    over = (max(power - size, size - power - 3, 0.0) for size in sizes)
    return round(sum(over) + (_PREFIX_COST if power else 0.0), 9)


def _prefixed(unit: str, power: int) -> str:
    """Return a unit with the prefix of a power of ten, or the unit alone if it takes no such prefix, as krad."""
    is_large_angle = power > 0 and unit.startswith("rad")
    return f"{_PREFIXES[power]}{unit}" if _TAKES_PREFIX.match(unit) and not is_large_angle else unit


def scaled_unit(unit: str, low: float, high: float) -> tuple[int, str]:
    """Return a power of ten that suits values from low to high, and the unit, with a prefix if the unit accepts one."""
    size = max(abs(low), abs(high))
    power = 3 * math.floor(math.log10(size) / 3 + 1e-9) if size > 0 and math.isfinite(size) else 0
    power = min(max(power, -12), 9)
    if _prefixed(unit, power) != unit:
        return power, _prefixed(unit, power)
    return (0 if -3 <= math.log10(size or 1.0) < 4 else power), unit


def with_prefix(value: float, unit: str) -> str:
    """Return a positive quantity as text, with a prefix if its unit takes one, such as "50 mm"."""
    power = min(max(3 * math.floor(math.log10(value) / 3 + 1e-9), -12), 9)
    if _prefixed(unit, power) != unit:
        return f"{value / 10.0**power:g} {_PREFIXES[power]}{unit_text(unit)}"
    return f"{value:g} {unit_text(unit)}"
