"""This module checks the numbers and directions in the declaration of a mechanical system."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral
from typing import Any

from hybridsim.arguments import as_real, is_row
from hybridsim.model.parts.declared import Declared

_MOVES = "; for coefficients that vary in time or space write an hs.Model, starting from system.to_model()"


def finite(part: Declared, argument: str, value: Any) -> float:
    """Return a finite number, or raise an error that names the argument."""
    number = as_real(value)
    if number is None or not math.isfinite(number):
        raise part._fault(
            f"`{argument}` cannot be {value!r}", "use finite numbers" + _MOVES * isinstance(value, str)
        )
    return number


def weights(part: Declared, direction: Any) -> tuple[tuple[tuple[int, float], ...], int]:
    """Return the non-zero weights as (coordinate, weight) pairs, and the row length (0 for a mapping)."""
    is_mapping = isinstance(direction, Mapping)
    if not (is_mapping or is_row(direction)):
        raise part._fault(
            f"`direction` cannot be {direction!r}",
            "use a row of weights, or a mapping from coordinates to weights",
        )
    row = list(direction.items() if is_mapping else enumerate(direction))
    entries = [(i, finite(part, "direction", w)) for i, w in row]
    for i, _ in entries:
        if not isinstance(i, Integral):
            raise part._fault(
                f"`direction` contains the coordinate {i!r}", "use whole numbers, counted from 0"
            )
    pairs = tuple((int(i), w) for i, w in entries if w != 0.0)
    if not pairs:
        raise part._fault("the direction is zero", "use at least one weight that is not zero")
    return pairs, 0 if is_mapping else len(row)
