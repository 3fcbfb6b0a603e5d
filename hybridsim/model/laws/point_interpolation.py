"""This module interpolates a function between points, linearly or by monotone cubics, as numbers and as text.

Source of the slopes of the cubics: F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300,
doi:10.1137/0905021.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

LINEAR, CUBIC = "linear", "cubic"
Piece = tuple[float, float, float, float, float]
"""Left end of the piece, and the coefficients of 1, d, d**2, d**3, with d the distance from the left end."""


def pieces(at: Sequence[float], values: Sequence[float], way: str) -> list[Piece]:
    """Return the polynomials between the points, from left to right."""
    if way == LINEAR:
        points = list(zip(at, values, strict=True))
        return [(x, y, (y1 - y) / (x1 - x), 0.0, 0.0) for (x, y), (x1, y1) in pairwise(points)]
    slopes, found = _slopes(at, values), []
    for k, x in enumerate(at[:-1]):
        h, first, last = at[k + 1] - x, slopes[k], slopes[k + 1]
        chord = (values[k + 1] - values[k]) / h
        found.append(
            (x, values[k], first, (3.0 * chord - 2.0 * first - last) / h, (first + last - 2.0 * chord) / h**2)
        )
    return found


def value(at: Sequence[float], values: Sequence[float], way: str, argument: float) -> float:
    """Return the function at an argument, or NaN at NaN; the function is constant beyond both ends."""
    if math.isnan(argument):
        return math.nan
    if argument <= at[0]:
        return values[0]
    if argument >= at[-1]:
        return values[-1]
    left, *c = next(p for p in reversed(pieces(at, values, way)) if p[0] <= argument)
    d = argument - left
    return c[0] + d * (c[1] + d * (c[2] + d * c[3]))


def texts(at: Sequence[float], values: Sequence[float], way: str) -> list[str]:
    """Return the function of the argument `a` below the first point, between the points, and above the last point."""
    found = [repr(values[0])]
    for x, *c in pieces(at, values, way):
        d = f"(a - ({x!r}))"
        curved = "" if way == LINEAR else f" + {d}*({c[2]!r} + {d}*({c[3]!r}))"
        found.append(f"{c[0]!r} + {d}*({c[1]!r}{curved})")
    return [*found, repr(values[-1])]


def texts_of_names(at: Sequence[float], names: Sequence[str]) -> list[str]:
    """Return linear functions as text, between points whose values are variables."""
    found = [names[0]]
    for (x, name), (x1, name1) in pairwise(zip(at, names, strict=True)):
        found.append(f"{name} + (a - ({x!r}))*(({name1} - {name})/{x1 - x!r})")
    return [*found, names[-1]]


def _slopes(at: Sequence[float], values: Sequence[float]) -> list[float]:
    """Return the slopes at the points: weighted harmonic means of the slopes of adjacent intervals."""
    h = [b - a for a, b in pairwise(at)]
    chord = [(b - a) / w for a, b, w in zip(values, values[1:], h, strict=False)]
    if len(h) == 1:
        return [chord[0], chord[0]]
    inner = []
    for k in range(1, len(h)):
        before, after = chord[k - 1], chord[k]
        w1, w2 = 2.0 * h[k] + h[k - 1], h[k] + 2.0 * h[k - 1]
        inner.append((w1 + w2) / (w1 / before + w2 / after) if before * after > 0.0 else 0.0)
    first = _end_slope(h[0], h[1], chord[0], chord[1])
    last = _end_slope(h[-1], h[-2], chord[-1], chord[-2])
    return [first, *inner, last]


def _end_slope(h: float, other: float, chord: float, next_chord: float) -> float:
    """Return the three-point slope at an end, limited so that the cubic stays monotone."""
    slope = ((2.0 * h + other) * chord - h * next_chord) / (h + other)
    if slope * chord <= 0.0:
        return 0.0
    if chord * next_chord <= 0.0 and abs(slope) > 3.0 * abs(chord):
        return 3.0 * chord
    return slope
