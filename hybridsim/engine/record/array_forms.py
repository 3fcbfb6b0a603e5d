"""This module checks arrays that were read from a file: types, shapes and indices.

Kernels do not check indices, and those in a file may be arbitrary.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

Arrays = Mapping[str, np.ndarray]
Form = tuple[type, tuple[int | str, ...]]  # type of an array, and its lengths; "N+1" is one more than "N"


def check_forms(
    title: str, arrays: Arrays, forms: Mapping[str, Form], sizes: Mapping[str, int]
) -> dict[str, int]:
    """Check the types and lengths of arrays, and return the sizes that their shapes imply.

    Raises
    ------
    ValueError
        With the name of the array.
    """
    known = dict(sizes)
    for name, (kind, lengths) in forms.items():
        if name not in arrays:
            raise ValueError(f"{title} lacks the array '{name}'")
        array = arrays[name]
        if array.dtype != np.dtype(kind) or array.ndim != len(lengths):
            raise ValueError(
                f"{title}: '{name}' has the type {array.dtype} and {array.ndim} dimensions, instead of {kind} and "
                f"{len(lengths)}"
            )
        for length, expected in zip(array.shape, lengths, strict=True):
            if isinstance(expected, str):
                size, _, more = expected.partition("+")
                expected = known.setdefault(size, length - int(more or 0)) + int(more or 0)
            if length != expected:
                raise ValueError(f"{title}: '{name}' has the wrong shape {array.shape}")
    return known


def check_range(title: str, array: np.ndarray, low: float, high: float) -> None:
    """Raise an error for numbers outside a range; NaN is outside every range."""
    if array.size and not (array.min() >= low and array.max() <= high):
        raise ValueError(f"{title} is not within {low} to {high}")


def check_finite(title: str, *arrays: np.ndarray) -> None:
    """Raise an error for numbers that are not finite."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise ValueError(f"{title} is not finite")


def check_ascending(title: str, array: np.ndarray, *, strictly: bool = False) -> None:
    """Raise an error unless numbers are in ascending order; with `strictly`, equal numbers are also rejected."""
    steps = np.diff(array)
    if not ((steps > 0).all() if strictly else (steps >= 0).all()):
        raise ValueError(f"{title} is not in ascending order")


def check_modes(title: str, modes: np.ndarray, counts: Sequence[int], lowest: int = 0) -> None:
    """Raise an error for mode numbers that the components do not have."""
    if not ((modes >= lowest) & (modes < np.asarray(counts, dtype=np.int64))).all():
        raise ValueError(f"{title} contains a number that is not a mode of its component")


def check_instant(title: str, instant: object) -> tuple[float, float]:
    """Return a time given as two finite doubles, or raise an error."""
    if not isinstance(instant, list | tuple) or len(instant) != 2:
        raise ValueError(f"{title} is not a time")
    return check_number(title, instant[0]), check_number(title, instant[1])


def check_number(title: str, value: object, low: float = -math.inf, *, is_finite: bool = True) -> float:
    """Return a number that is at least `low`, or raise an error."""
    if type(value) not in (int, float):
        raise ValueError(f"{title} is {value!r}")
    found = float(value)  # type: ignore[arg-type]  # it is a number
    if not found >= low or (is_finite and not math.isfinite(found)):
        raise ValueError(f"{title} is {value!r}")
    return found


def check_count(title: str, value: object, most: float = 2**62) -> int:
    """Return a whole number that is not negative, or raise an error."""
    if type(value) is not int or not 0 <= value <= most:
        raise ValueError(f"{title} is {value!r}")
    return value
