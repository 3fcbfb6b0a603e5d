"""Checks of arrays that were read from a file: their types, their shapes and the indices that they hold.

A kernel goes by the indices that it is given. In a file that somebody made they may be anything.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

Arrays = Mapping[str, np.ndarray]
Form = tuple[
    type, tuple[int | str, ...]
]  # of an array: what it holds, and its lengths; "N+1" is one more than "N"


def check_forms(
    title: str, arrays: Arrays, forms: Mapping[str, Form], sizes: Mapping[str, int]
) -> dict[str, int]:
    """Refuse arrays of other types or lengths; return the sizes, with those that only the arrays say.

    Raises
    ------
    ValueError
        It names the array.
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
        for length, wanted in zip(array.shape, lengths, strict=True):
            if isinstance(wanted, str):
                size, _, more = wanted.partition("+")
                wanted = known.setdefault(size, length - int(more or 0)) + int(more or 0)
            if length != wanted:
                raise ValueError(f"{title}: '{name}' has the wrong shape {array.shape}")
    return known


def check_range(what: str, array: np.ndarray, low: float, high: float) -> None:
    """Refuse numbers outside of what they may be; NaN is outside of everything."""
    if array.size and not (array.min() >= low and array.max() <= high):
        raise ValueError(f"{what} is not within {low} to {high}")


def check_finite(what: str, *arrays: np.ndarray) -> None:
    """Refuse what is not a finite number."""
    if not all(np.isfinite(array).all() for array in arrays):
        raise ValueError(f"{what} is not finite")


def check_ascending(what: str, array: np.ndarray, *, strictly: bool = False) -> None:
    """Refuse numbers that fall, or stand still."""
    steps = np.diff(array)
    if not ((steps > 0).all() if strictly else (steps >= 0).all()):
        raise ValueError(f"{what} is not in ascending order")


def check_modes(what: str, modes: np.ndarray, counts: Sequence[int], lowest: int = 0) -> None:
    """Refuse numbers (..., C) of modes that the components, with so many each, do not have."""
    if not ((modes >= lowest) & (modes < np.asarray(counts, dtype=np.int64))).all():
        raise ValueError(f"{what} is not a mode of its component")


def check_instant(what: str, instant: object) -> tuple[float, float]:
    """A time as the sum of two finite doubles; anything else is refused."""
    if not isinstance(instant, list | tuple) or len(instant) != 2:
        raise ValueError(f"{what} is not a time")
    return check_number(what, instant[0]), check_number(what, instant[1])


def check_number(what: str, value: object, low: float = -math.inf, *, is_finite: bool = True) -> float:
    """A number from a text, not below `low`; anything else is refused."""
    if type(value) not in (int, float):
        raise ValueError(f"{what} is {value!r}")
    found = float(value)  # type: ignore[arg-type]  # it is a number
    if not found >= low or (is_finite and not math.isfinite(found)):
        raise ValueError(f"{what} is {value!r}")
    return found


def check_count(what: str, value: object, most: float = 2**62) -> int:
    """A whole number that is not negative; anything else is refused."""
    if type(value) is not int or not 0 <= value <= most:
        raise ValueError(f"{what} is {value!r}")
    return value
