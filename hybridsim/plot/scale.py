"""This module labels axes of physical quantities, with prefixes instead of powers of ten."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence

from matplotlib.axis import Axis
from matplotlib.ticker import Formatter

from hybridsim.plot.style import literal

_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
# Units that take a prefix at their start: "m" and "m/s" do; "kg" (which has one) and "1/s" do not.
_TAKES_PREFIX = re.compile(r"(m|s|N|V|A|W|J|Pa|Hz|rad|g|C|F|H|K|Nm|N m)(?![A-Za-z])")


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


def label_axis(axis: Axis, name: str, unit: str, low: float, high: float) -> None:
    """Label an axis "name [unit]" with a prefix, or a power of ten, that suits values from low to high."""
    power, prefixed = scaled_unit(unit, low, high)
    text = literal(prefixed)
    if power and prefixed == unit:  # the unit takes no prefix
        text = f"$10^{{{power}}}$ {text}".rstrip()
    axis.set_label_text(f"{literal(name)} [{text}]" if text else literal(name))
    axis.set_major_formatter(Scaled(10.0**power))


def scaled_unit(unit: str, low: float, high: float) -> tuple[int, str]:
    """Return a power of ten that suits values from low to high, and the unit with its prefix if it takes one."""
    size = max(abs(low), abs(high))
    power = 3 * math.floor(math.log10(size) / 3 + 1e-9) if size > 0 and math.isfinite(size) else 0
    power = min(max(power, -12), 9)
    if power and _TAKES_PREFIX.match(unit):
        return power, f"{_PREFIXES[power]}{unit}"
    return (0 if -3 <= math.log10(size or 1.0) < 4 else power), unit


def with_prefix(value: float, unit: str) -> str:
    """Return a positive quantity as text, with a prefix if its unit takes one, such as "50 mm"."""
    power = min(max(3 * math.floor(math.log10(value) / 3 + 1e-9), -12), 9)
    if power and _TAKES_PREFIX.match(unit):
        return f"{value / 10.0**power:g} {_PREFIXES[power]}{unit}"
    return f"{value:g} {unit}"
