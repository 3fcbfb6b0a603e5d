"""This module defines the points of a sweep: values of parameters and initial values, as a grid or a list."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np

from hybridsim.arguments import cannot_be, is_row, number
from hybridsim.errors import ExpressionError, UsageError
from hybridsim.expr import Expression, parse, require_names, resolve
from hybridsim.model import Model
from hybridsim.model.checks.units import label_of
from hybridsim.model.parts.remedies import remedy_for_parameter

MODES = ("grid", "list")
POINT = "point"  # the dimension of a list
MOST_POINTS = 1 << 25  # each needs about a hundred bytes


@dataclass(frozen=True)
class Axis:
    """One axis of a sweep: a parameter or an initial value, with its values.

    Parameters
    ----------
    name, unit : as declared.
    settings : the values for the model, numbers or expressions.
    values : their numbers (k,), NaN for an expression without a value; texts if an expression depends on another
        axis, so that its number is not the same everywhere.
    is_start : whether it is the initial value of a state.
    """

    name: str
    unit: str
    settings: tuple[float | Expression, ...]
    values: np.ndarray
    is_start: bool


@dataclass(frozen=True)
class Points:
    """All points of a sweep, numbered in C order: the last axis varies fastest.

    Parameters
    ----------
    axes : in the order of the request.
    mode : "grid", all combinations; "list", the k-th values of all axes together.
    """

    axes: tuple[Axis, ...]
    mode: str

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the arrays of results."""
        lengths = tuple(len(axis.settings) for axis in self.axes)
        return lengths if self.mode == "grid" else lengths[:1]

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Name of each axis of `shape`."""
        return tuple(axis.name for axis in self.axes) if self.mode == "grid" else (POINT,)

    def settings(self, numbers: range) -> list[tuple[float | Expression, ...]]:
        """Return the values of all axes at some points."""
        if self.mode == "list":
            return [tuple(axis.settings[k] for axis in self.axes) for k in numbers]
        indices = np.unravel_index(np.asarray(numbers), self.shape)
        columns: list[list[float | Expression]] = [
            [row[i] for i in p.tolist()] for row, p in zip(self._parsed, indices, strict=True)
        ]
        return list(zip(*columns, strict=True))

    @cached_property
    def _parsed(self) -> list[list[Expression]]:
        """The values of the grid as parsed expressions."""
        return [[parse(setting) for setting in axis.settings] for axis in self.axes]


def points_of(model: Model, values: Any, mode: Any) -> Points:
    """Return the points of a sweep from its arguments.

    Raises
    ------
    UsageError
        For unknown names, invalid values, or lists of different lengths.
    """
    if not isinstance(mode, str) or mode not in MODES:
        raise cannot_be("mode", mode, "use 'grid' for all combinations, or 'list'")
    if not isinstance(values, Mapping) or not values:
        raise cannot_be(
            "values", values, "use a dict of parameter names and values, such as {'F0': [20, 30, 40]}"
        )
    units = {p.name: label_of(p.unit) for p in model.parameters}
    starts = {s.name: label_of(s.unit) for s in model.states}
    starts |= {d.name: label_of(d.unit) for d in model.discrete}
    for name in values:
        if name not in units and name not in starts:
            raise UsageError(
                f"model {model.name} has no parameter or state {name!r} to sweep over",
                remedy=remedy_for_parameter(model, str(name), tuple(starts)),
            )
    _refuse_too_many({name: _length(row) for name, row in values.items()}, mode)
    settings = {name: _settings(name, row) for name, row in values.items()}
    _refuse_too_many({name: len(row) for name, row in settings.items()}, mode)
    lengths = {name: len(row) for name, row in settings.items()}
    if mode == "list" and len(set(lengths.values())) > 1:
        counted = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise UsageError(
            f"the lists of the sweep have different lengths: {counted}",
            remedy="use lists of equal length, or mode='grid'",
        )
    axes = tuple(
        Axis(
            name,
            units.get(name, starts.get(name, "")),
            row,
            _values(model, name, row, frozenset(settings)),
            name in starts,
        )
        for name, row in settings.items()
    )
    return Points(axes, mode)


def _length(row: Any) -> int:
    """Return the number of values of an axis, or 1 for a single value."""
    try:
        return len(row)
    except TypeError:  # not a row, or an iterator
        return 1
    except OverflowError:  # a range beyond the largest integer
        return MOST_POINTS + 1


def _refuse_too_many(lengths: Mapping[str, int], mode: str) -> None:
    """Reject a sweep with too many points for the memory, before any point is built."""
    total = math.prod(lengths.values()) if mode == "grid" else max(lengths.values())
    if total > MOST_POINTS:
        counted = ", ".join(
            f"{name} {length if length <= MOST_POINTS else f'more than {MOST_POINTS}'}"
            for name, length in lengths.items()
        )
        raise UsageError(
            f"the sweep has more than {MOST_POINTS} points ({counted})",
            remedy="use fewer values, or sweep in parts",
        )


def _settings(name: str, row: Any) -> tuple[float | Expression, ...]:
    if not is_row(row):
        raise UsageError(
            f"the values of {name} cannot be {row!r}", remedy="use a list of numbers or expressions"
        )
    found = tuple(_setting(name, value) for value in islice(row, MOST_POINTS + 1))
    if not found:
        raise UsageError(f"the list of values of {name} is empty", remedy="use at least one value")
    return found


def _setting(name: str, value: Any) -> float | Expression:
    if isinstance(value, Expression):
        return value
    if isinstance(value, str):
        return parse(value)
    found = number(value, f"a value of {name}", "use a number or an expression")
    if not math.isfinite(found):
        raise cannot_be(f"a value of {name}", value, "use finite numbers")
    return found


def _values(model: Model, name: str, row: Sequence[float | Expression], swept: frozenset[str]) -> np.ndarray:
    """Return the values of an axis as numbers, or as text if a value depends on another axis."""
    declared = {p.name: p.value for p in model.parameters}
    dependencies = {}
    for setting in row:
        if isinstance(setting, Expression):
            require_names(setting, declared)
            dependencies[setting] = _dependencies({**declared, name: setting}, name)
    if any(parameters.keys() & (swept - {name}) for parameters in dependencies.values()):
        return np.array([s.text if isinstance(s, Expression) else f"{s!r}" for s in row], dtype=np.str_)
    return np.array(
        [_number(name, dependencies[s]) if isinstance(s, Expression) else s for s in row], dtype=float
    )


def _dependencies(declared: Mapping[str, Expression], name: str) -> dict[str, Expression]:
    """Return a parameter and all parameters that its value depends on."""
    found: dict[str, Expression] = {}
    waiting = {name}
    while waiting:
        found |= {known: declared[known] for known in waiting}
        waiting = {other for known in waiting for other in declared[known].names} - found.keys()
        waiting &= declared.keys()
    return found


def _number(name: str, dependencies: Mapping[str, Expression]) -> float:
    """Return the value of a parameter, or NaN for a missing value, so that only this point fails."""
    try:
        return resolve(dependencies)[name]
    except ExpressionError:
        return math.nan
