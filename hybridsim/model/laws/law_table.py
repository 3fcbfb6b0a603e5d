"""This module defines functions of one argument by points, or of two arguments by a grid of points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import pairwise
from typing import Any

from hybridsim.errors import Place, UsageError
from hybridsim.expr import Expression, evaluate, parse, substitute
from hybridsim.model.laws.point_interpolation import CUBIC, LINEAR, texts, texts_of_names, value
from hybridsim.model.parts.component import Choice, Corner, Guard, Mode
from hybridsim.model.parts.declared import Declared, as_tuple

_SPEED = parse("v")
INTERPOLATIONS = (CUBIC, LINEAR)


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
    values : sequence of float or str
        Values (k,) at the arguments, or (k, m) for a table of two arguments. With one argument and linear
        interpolation they may be expressions of the parameters of the law. `fit` then finds these parameters.
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
        if self.across is not None:
            self._grid()
        elif any(isinstance(entry, str | Expression) for entry in as_tuple(self.values)):
            self._parse_values()
        else:
            self._numbers("values")
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

    def _parse_values(self) -> None:
        """Parse the values of a table of one argument, which may contain expressions."""
        parsed = [self._parsed(entry, "values", functions=False) for entry in as_tuple(self.values)]
        if self.interpolation != LINEAR:
            text = next((e.text for e in parsed if e.names), None)
            if text is not None:
                raise self._fault(
                    f"`values` contains {text}, but cubic interpolation needs numbers",
                    'set interpolation="linear"',
                )
        object.__setattr__(self, "values", tuple(e if e.names else evaluate(e, {}) for e in parsed))

    def bound(self, values: Mapping[str, Expression]) -> LawTable:
        """Return the table with expressions in place of the parameters of the law."""
        if not any(isinstance(entry, Expression) for entry in self.values):
            return self
        found = [substitute(e, values) if isinstance(e, Expression) else e for e in self.values]
        return replace(self, values=tuple(found))

    def expressions(self) -> Iterator[Expression]:
        """Yield the values that are expressions."""
        yield from (entry for entry in self.values if isinstance(entry, Expression))

    def _grid(self) -> None:
        """Convert the values of a table of two arguments to rows of floats, and check them."""
        if self.interpolation != LINEAR:
            raise self._fault(
                "`across` cannot be combined with cubic interpolation", 'set interpolation="linear"'
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

    def value(self, argument: float, across: float | None = None) -> float:
        """Return the value of the function at its argument, or at both arguments if the table has two."""
        for entry in self.expressions():
            raise UsageError(
                f"table {self.name} has the value {entry.text}, which depends on parameters",
                remedy="use a table whose values are numbers",
            )
        values = self.values
        if self.across is not None:
            if across is None:
                raise UsageError(
                    f"table {self.name} has two arguments, but `across` is missing",
                    remedy=f"use value(argument, across) with a value of {self.across.text}",
                )
            values = tuple(value(self.across_at, row, LINEAR, across) for row in self.values)
        return value(self.at, values, self.interpolation, argument)

    def expression_at(self, argument: float, name: str) -> Expression:
        """Return the value of the table for a number as first argument.

        name: the variable of the table. A table of two arguments gives an expression of the variables of its rows,
        and a table with parameters an expression of them.
        """
        named = self._named(name)
        if not named:
            return parse(self.value(argument))
        count, terms = len(self.at), []
        for k, row in enumerate(named):
            share = value(self.at, [float(i == k) for i in range(count)], LINEAR, argument)
            terms += [f"{share!r}*{row}"] * (share != 0.0)
        return substitute(parse(" + ".join(terms)), named)

    def arguments(self) -> list[frozenset[str]]:
        """Return the names that occur in each argument of the table."""
        return [frozenset(e.names) for e in (self.over, self.across) if e is not None]

    @property
    def is_at_rest(self) -> bool:
        """Whether the table has a value in stick: it is a table of the speed, or it does not depend on the velocity."""
        first, *second = self.arguments()
        return (self.over.text == "v" or "v" not in first) and not any("v" in names for names in second)

    def row_names(self, name: str) -> list[str]:
        """Return one variable name for each row of a table of two arguments, and no name for a table of one."""
        return [f"{name}_{k}" for k in range(1, len(self.at) + 1)] if self.across is not None else []

    def _named(self, name: str) -> dict[str, Expression]:
        """Return the values by name as expressions; a table of one argument that contains only numbers has none."""
        if self.across is not None:
            return {row: parse(row) for row in self.row_names(name)}
        if not any(self.expressions()):
            return {}
        return {f"value_{k}": parse(entry) for k, entry in enumerate(self.values, 1)}

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
            found = {
                row: texts(self.across_at, values, LINEAR)
                for row, values in zip(rows, self.values, strict=True)
            }
            yield _automaton(f"{name}_across", found, self.across_at, {"a": across}, self.place)
        named = self._named(name)
        own = (
            texts_of_names(self.at, list(named)) if named else texts(self.at, self.values, self.interpolation)
        )
        skipped = 1 if from_zero and self.at[0] <= 0.0 else 0
        yield _automaton(name, {name: own[skipped:]}, self.at, {"a": argument, **named}, self.place)


def _automaton(
    name: str,
    pieces: dict[str, list[str]],
    at: Sequence[float],
    parts: Mapping[str, Expression],
    place: Place | None,
) -> Corner:
    """Return the automaton that sets variables to piecewise functions, with one mode per piece.

    parts : the argument `a`, and expressions for other names in the pieces.
    """
    count = len(next(iter(pieces.values())))
    ends, modes = at[len(at) + 1 - count :], []
    for k in range(count):
        guards = []
        if k:
            guards.append(_guard("left", f"a - ({ends[k - 1]!r})", parts["a"], str(k)))
        if k < len(ends):
            guards.append(_guard("right", f"{ends[k]!r} - a", parts["a"], str(k + 2)))
        values = {of: substitute(parse(own[k]), parts) for of, own in pieces.items()}
        modes.append(Mode(str(k + 1), tuple(guards), set=values))
    return Corner(name, tuple(modes), initial="1", place=place)


def _guard(name: str, text: str, argument: Expression, to: str) -> Guard:
    return Guard(name, substitute(parse(text), {"a": argument}), (Choice(to),))
