"""This module defines functions of one argument by points, or of two arguments by a grid of points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from typing import Any

from hybridsim.errors import Place
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

    A table of two arguments has the second argument in ``across``, and the interpolation "linear". It is bilinear in
    each cell of the grid::

        f = (1 - p)*((1 - q)*f00 + q*f01) + p*((1 - q)*f10 + q*f11)

    with the values at the corners of the cell, and the fractions p and q of the cell in both directions. Crossing a
    line of the grid is an event.

    Parameters
    ----------
    name : str
        Name of the function in the law's expressions.
    at : sequence of float
        Arguments (k,), increasing.
    values : sequence of float
        Values (k,) at the arguments, or (k, m) for a table of two arguments.
    over : str or float, optional
        The argument, an expression of the names of the law; the default is the speed v.
    interpolation : str, optional
        "cubic" or "linear".
    across : str or float, optional
        The second argument, an expression of the names of the law.
    across_at : sequence of float, optional
        Numbers (m,) of the second argument, increasing.
    place : Place, optional
        Place of the declaration, for error messages.

    References
    ----------
    F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, doi:10.1137/0905021 (the slopes).

    Examples
    --------
    >>> LawTable("mu", at=[0, 1, 3], values=[0.5, 0.4, 0.4]).value(2.0)
    0.4
    >>> hot = LawTable("mu", [0, 1], [[0.5, 0.3], [0.4, 0.2]], interpolation="linear", across="T", across_at=[20, 80])
    >>> round(hot.value(0.5, 50.0), 9)
    0.35
    """

    name: str
    at: tuple[float, ...]
    values: tuple[Any, ...]
    over: Expression = _SPEED
    interpolation: str = "cubic"
    across: Expression | None = None
    across_at: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        self._texts("name")
        self._texts("interpolation", known=INTERPOLATIONS)
        if self.interpolation not in INTERPOLATIONS:
            remedy = f"use {' or '.join(map(repr, INTERPOLATIONS))}"
            raise self._fault(f"`interpolation` cannot be {self.interpolation!r}", remedy)
        self._numbers("at", "across_at")
        self._expressions("over", "across")
        if self.across is None:
            self._numbers("values")
        else:
            self._grid()
        if len(self.at) != len(self.values):
            raise self._fault(
                f"`at` has {len(self.at)} numbers, but `values` has {len(self.values)}",
                "use one value for each number in `at`",
            )
        self._ascending("at")

    def _ascending(self, field: str) -> None:
        """Raise an error unless a field has at least two numbers in ascending order."""
        numbers = getattr(self, field)
        if len(numbers) < 2:
            raise self._fault(f"the table has {len(numbers)} points in `{field}`", "use at least two points")
        for first, second in pairwise(numbers):
            if not first < second:
                raise self._fault(
                    f"`{field}` is not ascending: {second:g} follows {first:g}",
                    f"use ascending numbers in `{field}`",
                )

    def _grid(self) -> None:
        """Convert the values of a table of two arguments to rows of floats, and check them."""
        if self.interpolation != "linear":
            raise self._fault(
                "a table of two arguments cannot have cubic interpolation", 'set interpolation="linear"'
            )
        self._ascending("across_at")
        self._rows("values")
        for row in self.values:
            if len(row) != len(self.across_at):
                raise self._fault(
                    f"`across_at` has {len(self.across_at)} numbers, but a row of `values` has {len(row)}",
                    "use one value for each number in `across_at`",
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

    def value(self, argument: float, across: float = 0.0) -> float:
        """Return the value of the function at one argument, or at both arguments of a table of two."""
        if self.across is not None:
            return self._with_row(self._row_at(across)).value(argument)
        if argument <= self.at[0]:
            return float(self.values[0])
        if argument >= self.at[-1]:
            return float(self.values[-1])
        left, *c = next(p for p in reversed(self.pieces()) if p[0] <= argument)
        d = argument - left
        return c[0] + d * (c[1] + d * (c[2] + d * c[3]))

    def expression_at(self, argument: float, name: str) -> Expression:
        """Return the value at a number of the first argument.

        name: the variable of the table. A table of two arguments gives an expression of the variables of its rows.
        """
        if self.across is None:
            return parse(self.value(argument))
        names = self.row_names(name)
        shares = [self._with_row(unit).value(argument) for unit in _units(len(self.at))]
        return parse(" + ".join(f"{w!r}*{row}" for w, row in zip(shares, names, strict=True) if w != 0.0))

    def arguments(self) -> list[frozenset[str]]:
        """Return the names in each argument."""
        return [frozenset(e.names) for e in (self.over, self.across) if e is not None]

    @property
    def is_at_rest(self) -> bool:
        """Whether the table has a value in stick: its argument is the speed itself, or no argument contains it."""
        first, *second = self.arguments()
        return (self.over.text == "v" or "v" not in first) and not any("v" in names for names in second)

    def row_names(self, name: str) -> list[str]:
        """Return the variables with the values at each number in `at`, for a table of two arguments."""
        return [f"{name}_{k}" for k in range(1, len(self.at) + 1)] if self.across is not None else []

    def _row_at(self, across: float) -> list[float]:
        """Return the values at each number in `at`, for one number of the second argument."""
        return [
            LawTable(self.name, self.across_at, row, interpolation="linear").value(across)
            for row in self.values
        ]

    def _with_row(self, values: Sequence[float]) -> LawTable:
        """Return the table of the first argument alone, with these values."""
        return LawTable(self.name, self.at, tuple(values), self.over, "linear")

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

    def components(
        self, name: str, argument: Expression, across: Expression | None, from_zero: bool
    ) -> Iterator[Corner]:
        """Yield the automata of the table: one mode for each piece of an argument. They set the variable `name`.

        Parameters
        ----------
        argument, across : the arguments in the names of the model.
        from_zero : the first argument is never negative, so no piece below zero is needed.
        """
        rows = self.row_names(name)
        if across is not None:
            tables = [LawTable(self.name, self.across_at, row, interpolation="linear") for row in self.values]
            texts = dict(zip(rows, (table.texts() for table in tables), strict=True))
            yield _automaton(f"{name}_across", texts, self.across_at, across, self.place)
        texts = {name: _between(self.at, rows) if rows else self.texts()}
        if from_zero and self.at[0] <= 0.0:
            texts[name] = texts[name][1:]
        yield _automaton(name, texts, self.at, argument, self.place)

    def texts(self) -> list[str]:
        """Return the function of the argument `a` below the first point, between the points, and above the last."""
        found = [repr(self.values[0])]
        for x, *c in self.pieces():
            d = f"(a - ({x!r}))"
            curved = "" if self.interpolation == "linear" else f" + {d}*({c[2]!r} + {d}*({c[3]!r}))"
            found.append(f"{c[0]!r} + {d}*({c[1]!r}{curved})")
        return [*found, repr(self.values[-1])]


def _automaton(
    name: str, texts: dict[str, list[str]], at: Sequence[float], argument: Expression, place: Place | None
) -> Corner:
    """Return the automaton that sets some variables to functions of the argument `a`, which change at points."""
    count = len(next(iter(texts.values())))
    ends, modes = at[len(at) + 1 - count :], []
    for k in range(count):
        guards = []
        if k:
            guards.append(_guard("left", f"a - ({ends[k - 1]!r})", argument, str(k)))
        if k < len(ends):
            guards.append(_guard("right", f"{ends[k]!r} - a", argument, str(k + 2)))
        values = {of: substitute(parse(pieces[k]), {"a": argument}) for of, pieces in texts.items()}
        modes.append(Mode(str(k + 1), tuple(guards), set=values))
    return Corner(name, tuple(modes), initial="1", place=place)


def _between(at: Sequence[float], rows: Sequence[str]) -> list[str]:
    """Return linear functions of the argument `a` between variables, which are the values at points."""
    found = [rows[0]]
    for (x, row), (x1, row1) in pairwise(zip(at, rows, strict=True)):
        found.append(f"{row} + (a - ({x!r}))*(({row1} - {row})/{x1 - x!r})")
    return [*found, rows[-1]]


def _units(count: int) -> list[list[float]]:
    return [[float(i == k) for i in range(count)] for k in range(count)]


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
