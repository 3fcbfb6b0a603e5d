"""This module divides a strip of modes into bars such that no interval is too narrow to be seen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

_WIDE = 3  # columns: an interval of this width remains visible between two hairlines


class Interval(Protocol):
    """A time interval that a component spends in one mode."""

    @property
    def mode(self) -> str: ...
    @property
    def t0(self) -> float: ...
    @property
    def t1(self) -> float: ...


class Bar(NamedTuple):
    """A rectangle of a strip: its times, its lower and upper edge as fractions of the height, and its mode."""

    start: float
    end: float
    low: float
    high: float
    mode: str


def bars_of(intervals: Sequence[Interval], t0: float, t1: float, columns: int) -> tuple[list[Bar], bool]:
    """Return the bars of a strip in the order of drawing, and whether any bars share a column.

    An interval that is narrower than three columns gets a whole column besides its own bar: a hairline. Where several
    such intervals fall into one column, their modes share its height.
    """
    width = (t1 - t0) / columns
    wide, narrow = [], dict[int, dict[str, None]]()
    for interval in intervals:
        start, end = sorted((interval.t0, interval.t1))
        start, end = max(start, t0), min(end, t1)
        if end <= start:
            continue
        wide.append(Bar(start, end, 0.0, 1.0, interval.mode))
        if end - start < _WIDE * width:
            column = min(int((0.5 * (start + end) - t0) / width), columns - 1)
            narrow.setdefault(column, {})[interval.mode] = None
    hairlines = [
        Bar(t0 + k * width, t0 + (k + 1) * width, i / len(modes), (i + 1) / len(modes), mode)
        for k, modes in narrow.items()
        for i, mode in enumerate(modes)
    ]
    return wide + hairlines, any(len(modes) > 1 for modes in narrow.values())
