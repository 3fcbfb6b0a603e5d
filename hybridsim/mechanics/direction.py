"""Numbers and directions of the contacts of a mechanical system, as they are declared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral
from typing import TYPE_CHECKING, Any

from hybridsim.arguments import as_real, is_row

if TYPE_CHECKING:
    from hybridsim.model.declared import Declared


_MOVES = "; what depends on time or place is for a Model, to which system.to_model() is a beginning"


def finite(part: Declared, what: str, value: Any) -> float:
    """A finite number, or the part's error that names it."""
    number = as_real(value)
    if number is None or not math.isfinite(number):
        raise part._fault(f"{what} is {value!r}", "give finite numbers" + _MOVES * isinstance(value, str))
    return number


def weights(part: Declared, direction: Any) -> tuple[tuple[tuple[int, float], ...], int]:
    """(coordinate, weight) of a row of weights or a mapping, zeros left out; how many were given in a row, else 0."""
    is_mapping = isinstance(direction, Mapping)
    if not (is_mapping or is_row(direction)):
        raise part._fault(
            f"direction is {direction!r}", "give a row of weights, or a mapping from coordinates"
        )
    row = list(direction.items() if is_mapping else enumerate(direction))
    given = [(i, finite(part, "direction", w)) for i, w in row]
    for i, _ in given:
        if not isinstance(i, Integral):
            raise part._fault(f"direction names the coordinate {i!r}", "give whole numbers, counted from 0")
    pairs = tuple((int(i), w) for i, w in given if w != 0.0)
    if not pairs:
        raise part._fault("the direction is zero", "give at least one weight that is not zero")
    return pairs, 0 if is_mapping else len(row)
