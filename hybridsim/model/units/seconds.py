"""This module converts measured times to seconds; no other values are converted between units."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from hybridsim.model.units.parse import read_unit
from hybridsim.model.units.unit import Unit

SECOND = Unit((("s", Fraction(1)),))
REMEDY = "use a unit of time, such as 'ms'"


def in_seconds(times: Iterable[float], unit: str) -> tuple[float, ...] | None:
    """Return times in seconds, or None if the text is not a unit of time.

    A unit that is a whole fraction of a second divides, so that 1 ms is the double next to 0.001 s.
    """
    found = read_unit(unit)
    if found is None or found.dimension != SECOND.dimension:
        return None
    parts = round(1.0 / found.scale)
    if parts > 1 and abs(parts * found.scale - 1.0) < 1e-9:
        return tuple(time / parts for time in times)
    return tuple(time * found.scale for time in times)
