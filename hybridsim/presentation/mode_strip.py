"""This module divides a strip of modes into bars such that no interval is too narrow to be seen."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import accumulate, pairwise
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
    """A rectangle of a mode strip: its times, its lower and upper edge as fractions of the height, and its mode."""

    start: float
    end: float
    low: float
    high: float
    mode: str


def bars_of(
    intervals: Sequence[Interval], t0: float, t1: float, columns: int, rows: int
) -> tuple[list[Bar], bool]:
    """Return the bars of a strip in the order of drawing, and whether any columns are divided.

    An interval that is narrower than three columns gets a whole column besides its own bar: a hairline. A column with
    several such intervals is divided among its modes. The height of a mode is its share of the time of the column, but
    at least one of the `rows` of pixels. From below, the modes are in the order in which they first occur.
    """
    width = (t1 - t0) / columns
    order: dict[str, None] = {}
    wide, narrow = [], Counter[int]()
    times: dict[int, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    hairlines: dict[int, str] = {}
    for interval in intervals:
        start, end = (min(max(t, t0), t1) for t in sorted((interval.t0, interval.t1)))
        if end <= start:
            continue
        order[interval.mode] = None
        wide.append(Bar(start, end, 0.0, 1.0, interval.mode))
        a, b = (start - t0) / width, (end - t0) / width
        covered = range(min(int(a), columns - 1), min(int(b), columns - 1) + 1)
        is_narrow = b - a < _WIDE
        if is_narrow:
            hairlines[min(int((a + b) / 2), columns - 1)] = interval.mode
            narrow.update(covered)
        for k in covered if is_narrow else {covered[0], covered[-1]}:  # no hairline is further inside
            times[k][interval.mode] += min(b, k + 1) - max(a, k)
    bars, is_divided = wide, False
    for k, mode in hairlines.items():
        modes = [one for one in order if one in times[k]] if narrow[k] > 1 else [mode]
        is_divided = is_divided or len(modes) > 1
        edges = [0.0, *accumulate(_heights([times[k][one] for one in modes], 1 / rows))]
        start, end = t0 + k * width, t0 + (k + 1) * width
        bars += [
            Bar(start, end, *low_high, one) for low_high, one in zip(pairwise(edges), modes, strict=True)
        ]
    return bars, is_divided


def _heights(times: Sequence[float], least: float) -> list[float]:
    """Return heights that are proportional to times and sum to 1; small heights are raised to a minimum if possible."""
    least = min(least, 1 / len(times))
    small = {i for i, time in enumerate(times) if time <= least * sum(times)}
    while True:
        rest = sum(time for i, time in enumerate(times) if i not in small)
        scale = (1 - least * len(small)) / rest if rest > 0 else 0.0
        more = {i for i, time in enumerate(times) if i not in small and time * scale < least}
        if not more:
            break
        small |= more
    return [least if i in small else time * scale for i, time in enumerate(times)]
