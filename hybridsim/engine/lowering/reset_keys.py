"""Keys of resets, which identify a reset of a model and the parts of it that add to a variable."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hybridsim.expr import Expression, Increment


def added(key: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the key of the amounts that a reset adds."""
    return ("added", *key)


def is_added(key: tuple[Any, ...]) -> bool:
    """Return whether a key denotes amounts to add instead of new values."""
    return bool(key[0] == "added")


def amounts_of(reset: Mapping[str, Expression]) -> dict[str, Expression]:
    """Return the part of a reset that adds amounts to variables."""
    return {name: amount for name, amount in reset.items() if isinstance(amount, Increment)}


def declared_reset(model: Any, key: tuple[Any, ...]) -> Mapping[str, Expression]:
    """Return the declaration of a model's reset, by its key."""
    kind, *numbers = key
    if kind == "choice":
        c, m, g, k = numbers
        return model.all_components()[c].modes[m].guards[g].then[k].reset
    if kind == "limit":
        return model.all_components()[numbers[0]].limit.reset
    return (model.monitors if kind == "monitor" else model.schedules)[numbers[0]].reset
