"""This module converts the result of a measure to named values: numbers, texts and arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hybridsim.arguments import is_row
from hybridsim.errors import UsageError

Reading = float | complex | str | np.ndarray
VALUE = "value"  # the name of a reading without one


def readings(found: Any) -> dict[str, Reading]:
    """Return named values from a number, an array (k,), or a mapping of numbers, arrays and texts.

    Raises
    ------
    UsageError
        For any other type.
    """
    if type(found) is float:
        return {VALUE: found}
    if isinstance(found, Mapping):
        return {str(name): _reading(str(name), value) for name, value in found.items()}
    return {VALUE: _reading(VALUE, found)}


def not_numbers(found: Mapping[str, Reading]) -> list[str]:
    """Return the names of the values that are NaN or contain NaN."""
    return [name for name, value in found.items() if _is_nan(value)]


def _is_nan(value: Reading) -> bool:
    if isinstance(value, float):
        return math.isnan(value)
    return not isinstance(value, str) and bool(np.isnan(value).any())


def _reading(name: str, value: Any) -> Reading:
    if isinstance(value, str):
        return value
    if is_row(value) or isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        if array.ndim <= 1 and array.dtype.kind in "fiubc":
            converted = array.astype(complex if array.dtype.kind == "c" else float)
            return converted if converted.ndim else converted.item()
    elif isinstance(value, complex):
        return value
    else:
        try:
            return float(value)
        except (TypeError, ValueError, OverflowError):
            pass
    raise UsageError(
        f"the measure returned a value of type {type(value).__name__} for {name}",
        remedy="return a number, a one-dimensional array, or a dict whose values are numbers, texts or arrays",
    )
