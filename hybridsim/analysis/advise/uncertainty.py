"""This module computes how much a quantity varies if parameters are only known within ranges."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hybridsim.analysis.advise.question import Number, Question
from hybridsim.arguments import cannot_be, is_row, number
from hybridsim.errors import UsageError
from hybridsim.model import Model
from hybridsim.model.parts.remedies import remedy_for_parameter

_MAX_RANGES = 6  # ranges; 2**6 corners need as many runs


@dataclass(frozen=True)
class Spread:
    """The variation of a quantity over a box of parameter ranges.

    low, high : least and greatest value. relative : half of their difference, relative to the full model's value.
    """

    ranges: Mapping[str, tuple[float, float]]
    low: float
    high: float
    relative: float


def ranges_of(model: Model, declared_ranges: Any) -> dict[str, tuple[float, float]]:
    """Return the checked ranges by parameter; each range must contain the model's own value."""
    if not isinstance(declared_ranges, Mapping) or not declared_ranges:
        raise cannot_be(
            "uncertain",
            declared_ranges,
            "use a dict of parameter names and ranges, such as {'mu': (0.28, 0.32)}",
        )
    if len(declared_ranges) > _MAX_RANGES:
        raise UsageError(
            f"`uncertain` has {len(declared_ranges)} ranges", remedy=f"use at most {_MAX_RANGES} ranges"
        )
    found, known = {}, model.parameter_values()
    for name, ends in declared_ranges.items():
        if not is_row(ends) or len(ends) != 2:
            raise cannot_be(f"the range of {name}", ends, "use (low, high)")
        low, high = (number(end, f"an end of the range of {name}") for end in ends)
        if not low < high:
            raise cannot_be(f"the range of {name}", ends, "use (low, high) with low < high")
        if name not in known:
            raise UsageError(
                f"`uncertain` contains {name!r}, which is not a parameter of model {model.name}",
                remedy=remedy_for_parameter(model, str(name)),
            )
        if not low <= known[name] <= high:
            raise UsageError(
                f"the range [{low:g}, {high:g}] of {name} does not contain the model's value {known[name]:g}",
                remedy="use a range that contains the model's value, or change the model's value with "
                "`params`",
            )
        found[str(name)] = (low, high)
    return found


def spread(
    model: Model,
    question: Question,
    full: Number,
    ranges: Mapping[str, tuple[float, float]],
    watch: Callable[[float], None] | None = None,
) -> Spread:
    """Evaluate the quantity at all corners of the ranges, and at both ends of one range at a time."""
    values = [abs(full) if isinstance(full, complex) else full]
    for point in _points(ranges):
        value = question.ask(model.with_(**point), watch).value
        values.append(abs(value) if isinstance(value, complex) else value)
    low, high = min(values), max(values)
    half = 0.5 * (high - low)
    relative = half / abs(full) if full != 0 else float("inf") if half else 0.0
    return Spread(dict(ranges), low, high, relative)


def _points(ranges: Mapping[str, tuple[float, float]]) -> Sequence[dict[str, float]]:
    names = list(ranges)
    corners = [dict(zip(names, ends, strict=True)) for ends in itertools.product(*ranges.values())]
    alone = [{name: end} for name in names for end in ranges[name]] if len(names) > 1 else []
    return [*corners, *alone]
