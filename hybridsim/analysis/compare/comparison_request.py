"""This module checks the arguments of comparisons; every error names the argument and its value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hybridsim.arguments import is_row, number
from hybridsim.errors import UsageError

MOST = 10**6  # for quantities that are counted one by one: periods, samples, repetitions
MOST_STEPS = 10**9  # per period


def positive(value: Any, what: str) -> float:
    """Return a number above zero."""
    remedy = "give a number above zero"
    found = number(value, what, remedy)
    if not found > 0:
        raise UsageError(f"{what} cannot be {value!r}", remedy=remedy)
    return found


def whole(value: Any, what: str, most: int = MOST) -> int:
    """Return a whole number above zero, up to a limit beyond which memory and time do not suffice."""
    remedy = f"give a whole number above zero, {most} at most"
    found = number(value, what, remedy)
    if not (1 <= found <= most and found.is_integer()):
        raise UsageError(f"{what} cannot be {value!r}", remedy=remedy)
    return int(found)


def positives(values: Any, what: str) -> tuple[float, ...] | None:
    """Return numbers above zero, or None if nothing is given."""
    return None if values is None else tuple(positive(value, what) for value in _row(values, what))


def wholes(values: Any, what: str) -> tuple[int, ...] | None:
    """Return whole numbers above zero, or None if nothing is given."""
    return None if values is None else tuple(whole(value, what, MOST_STEPS) for value in _row(values, what))


def mapping(value: Any, what: str) -> Mapping[str, Any]:
    """Return a mapping from names; None becomes an empty one."""
    if value is None:
        return {}
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        raise UsageError(f"{what} cannot be {value!r}", remedy="give a mapping from names to values")
    return value


def checked_names(values: Any, what: str) -> tuple[str, ...]:
    """Return a tuple of names; a single name becomes a tuple of length one."""
    found = (values,) if isinstance(values, str) else tuple(_row(values, what, "give names"))
    for value in found:
        if not isinstance(value, str):
            raise UsageError(f"{what} cannot contain {value!r}", remedy="give names")
    return found


def named_options(item: Any) -> tuple[str, Mapping[str, Any]]:
    """Return the name of an integrator and its options, from a name or a pair."""
    if isinstance(item, str):
        return item, {}
    if isinstance(item, tuple | list) and len(item) == 2 and isinstance(item[0], str):
        return item[0], mapping(item[1], f"options of {item[0]}")
    raise UsageError(
        f"integrators cannot contain {item!r}",
        remedy="give names, pairs of a name and a mapping of options, or Series objects",
    )


def row_of_integrators(value: Any) -> tuple[Any, ...]:
    """Return the requested integrators; a single name becomes a tuple of length one."""
    return (value,) if isinstance(value, str) else tuple(_row(value, "integrators", "give a list of names"))


def _row(values: Any, what: str, remedy: str = "give a list of numbers") -> Any:
    if not is_row(values):
        raise UsageError(f"{what} cannot be {values!r}", remedy=remedy)
    return values
