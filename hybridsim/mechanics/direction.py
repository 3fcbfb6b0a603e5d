"""Numbers and directions of the contacts of a mechanical system, as they are declared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from hybridsim.model.declared import Declared


_MOVES = "; what depends on time or place is for a Model, to which system.to_model() is a beginning"


def finite(part: Declared, what: str, value: Any) -> float:
    """A finite number, or the part's error that names it."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not np.isfinite(number):
        raise part._fault(f"{what} is {value!r}", "give finite numbers" + _MOVES * isinstance(value, str))
    return number


def weights(part: Declared, direction: Any) -> tuple[tuple[tuple[int, float], ...], int]:
    """(coordinate, weight) of a row of weights or a mapping, zeros left out; how many were given in a row, else 0."""
    is_mapping = isinstance(direction, Mapping)
    given = direction.items() if is_mapping else enumerate(direction)
    pairs = tuple((int(i), finite(part, "direction", w)) for i, w in given if w != 0)
    if not pairs:
        raise part._fault("the direction is zero", "give at least one weight that is not zero")
    return pairs, 0 if is_mapping else len(direction)
