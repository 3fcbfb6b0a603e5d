"""This module defines functions of one argument by points, with linear or monotone cubic interpolation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise

from hybridsim.expr import Expression, parse, substitute
from hybridsim.model.parts.component import Choice, Corner, Guard, Mode
from hybridsim.model.parts.declared import Declared

_SPEED = parse("v")
INTERPOLATIONS = ("cubic", "linear")
Piece = tuple[float, float, float, float, float]
"""Left end of the piece, and the coefficients of 1, d, d**2, d**3, with d the distance from the left end."""


@dataclass(frozen=True)
class LawTable(Declared):
    """A table of a friction law: ``values`` at increasing arguments ``at``, constant beyond both ends.

    The cubic interpolation is monotone between the points and has a continuous slope. With linear interpolation, a
    force that is linear in its other quantities stays linear between the points, so that ``exact`` can integrate it.

    Parameters
    ----------
    name : str
        Name of the function in the law's expressions.
    at : sequence of float
        Arguments (k,), increasing.
    values : sequence of float
        Values (k,) at the arguments.
    over : str or float, optional
        The argument, an expression of the names of the law; the default is the speed v.
    interpolation : str, optional
        "cubic" or "linear".
    place : Place, optional
        Place of the declaration, for error messages.

    References
    ----------
    F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, doi:10.1137/0905021 (the slopes).

    Examples
    --------
    >>> LawTable("mu", at=[0, 1, 3], values=[0.5, 0.4, 0.4]).value(2.0)
    0.4
    """

    name: str
    at: tuple[float, ...]
    values: tuple[float, ...]
    over: Expression = _SPEED
    interpolation: str = "cubic"

    def __post_init__(self) -> None:
        self._texts("name")
        self._texts("interpolation", known=INTERPOLATIONS)
        if self.interpolation not in INTERPOLATIONS:
            remedy = f"use {' or '.join(map(repr, INTERPOLATIONS))}"
            raise self._fault(f"`interpolation` cannot be {self.interpolation!r}", remedy)
        self._numbers("at", "values")
        self._expressions("over")
        if len(self.at) != len(self.values):
            raise self._fault(
                f"`at` has {len(self.at)} numbers, but `values` has {len(self.values)}",
                "use one value for each number in `at`",
            )
        if len(self.at) < 2:
            raise self._fault(f"the table has {len(self.at)} points", "use at least two points")
        for first, second in zip(self.at, self.at[1:], strict=False):
            if not first < second:
                raise self._fault(
                    f"`at` is not ascending: {second:g} follows {first:g}", "use ascending numbers in `at`"
                )

    @classmethod
    def fit(
        cls,
        at: Sequence[float],
        values: Sequence[float],
        knots: int = 6,
        *,
        name: str = "mu",
        over: Expression | str = _SPEED,
    ) -> LawTable:
        """Return the table with linear interpolation that fits measured points best, by least squares.

        Parameters
        ----------
        at, values : sequence of float
            Measured arguments (k,) in any order, and the value (k,) at each.
        knots : int, optional
            Number of points of the table. The first and last lie at the ends of the data, and the others where the
            sum of squares is smallest.
        name, over : str, optional
            As of a table.

        Returns
        -------
        LawTable
            The table.

        Examples
        --------
        >>> speeds, found = [0, 1, 2, 3, 4, 5], [0.5, 0.4, 0.3, 0.3, 0.3, 0.3]
        >>> [round(v, 6) for v in LawTable.fit(speeds, found, knots=3).at]
        [0.0, 2.0, 5.0]
        """
        # The analysis package, which may use SciPy, is a layer above this one, so it is imported only on demand.
        fit = import_module("hybridsim.analysis.laws.fit").piecewise_linear
        at, values = fit(at, values, knots)
        return cls(name, at, values, over, "linear")  # type: ignore[arg-type]  # they are converted

    def value(self, argument: float) -> float:
        """Return the value of the function at one argument."""
        if argument <= self.at[0]:
            return self.values[0]
        if argument >= self.at[-1]:
            return self.values[-1]
        left, *c = next(p for p in reversed(self.pieces()) if p[0] <= argument)
        d = argument - left
        return c[0] + d * (c[1] + d * (c[2] + d * c[3]))

    def pieces(self) -> list[Piece]:
        """Return the polynomials between the points, from left to right."""
        if self.interpolation == "linear":
            points = list(zip(self.at, self.values, strict=True))
            return [(x, y, (y1 - y) / (x1 - x), 0.0, 0.0) for (x, y), (x1, y1) in pairwise(points)]
        slopes, found = self._slopes(), []
        for k, x in enumerate(self.at[:-1]):
            h, first, last = self.at[k + 1] - x, slopes[k], slopes[k + 1]
            chord = (self.values[k + 1] - self.values[k]) / h
            found.append(
                (
                    x,
                    self.values[k],
                    first,
                    (3.0 * chord - 2.0 * first - last) / h,
                    (first + last - 2.0 * chord) / h**2,
                )
            )
        return found

    def _slopes(self) -> list[float]:
        """Return the slopes at the points: weighted harmonic means of the slopes of adjacent intervals."""
        h = [b - a for a, b in zip(self.at, self.at[1:], strict=False)]
        chord = [(b - a) / w for a, b, w in zip(self.values, self.values[1:], h, strict=False)]
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

    def component(self, name: str, argument: Expression, from_zero: bool) -> Corner:
        """Return an automaton with one mode for each piece of the table, which sets the variable `name`.

        Parameters
        ----------
        from_zero : the argument is never negative, so no piece below zero is needed.
        """
        texts = []
        if not (from_zero and self.at[0] <= 0.0):
            texts.append(repr(self.values[0]))
        for x, *c in self.pieces():
            d = f"(a - ({x!r}))"
            curved = "" if self.interpolation == "linear" else f" + {d}*({c[2]!r} + {d}*({c[3]!r}))"
            texts.append(f"{c[0]!r} + {d}*({c[1]!r}{curved})")
        texts.append(repr(self.values[-1]))
        ends = self.at[len(self.at) + 1 - len(texts) :]
        modes = []
        for k, text in enumerate(texts):
            guards = []
            if k:
                guards.append(_guard("left", f"a - ({ends[k - 1]!r})", argument, str(k)))
            if k < len(ends):
                guards.append(_guard("right", f"{ends[k]!r} - a", argument, str(k + 2)))
            value = substitute(parse(text), {"a": argument})
            modes.append(Mode(str(k + 1), tuple(guards), set={name: value}))
        return Corner(name, tuple(modes), initial="1", place=self.place)


def _guard(name: str, text: str, argument: Expression, to: str) -> Guard:
    return Guard(name, substitute(parse(text), {"a": argument}), (Choice(to),))


def _end_slope(h: float, other: float, chord: float, next_chord: float) -> float:
    """Return the three-point slope at an end, limited so that the cubic stays monotone."""
    slope = ((2.0 * h + other) * chord - h * next_chord) / (h + other)
    if slope * chord <= 0.0:
        return 0.0
    if chord * next_chord <= 0.0 and abs(slope) > 3.0 * abs(chord):
        return 3.0 * chord
    return slope
