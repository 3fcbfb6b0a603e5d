"""This module assigns a key to each reset of a model, and another key to the amounts that the reset adds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hybridsim.expr import Expression, Increment


def added(key: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the key of the amounts that a reset adds."""
    return ("added", *key)


def is_added(key: tuple[Any, ...]) -> bool:
    """Return whether a key stands for additive resets, which add an amount to a variable."""
    return bool(key[0] == "added")


def amounts_of(reset: Mapping[str, Expression]) -> dict[str, Expression]:
    """Return the part of a reset that adds amounts to variables."""
    return {name: amount for name, amount in reset.items() if isinstance(amount, Increment)}


def resets_of(model: Any) -> list[tuple[tuple[Any, ...], Mapping[str, Expression]]]:
    """Return the key and the declaration of every reset of a model, in a fixed order.

    After them come the amounts of the resets that add, with keys from `added`.
    """
    components = list(enumerate(model.all_components()))
    found: list[tuple[tuple[Any, ...], Mapping[str, Expression]]] = [
        (("choice", c, m, g, k), choice.reset)
        for c, component in components
        for m, mode in enumerate(component.modes)
        for g, guard in enumerate(mode.guards)
        for k, choice in enumerate(guard.then)
    ]
    found += [(("limit", c), component.limit.reset) for c, component in components if component.limit]
    found += [(("monitor", k), monitor.reset) for k, monitor in enumerate(model.monitors)]
    found += [(("schedule", k), schedule.reset) for k, schedule in enumerate(model.schedules)]
    found = [(key, reset) for key, reset in found if reset]
    return found + [(added(key), amounts) for key, reset in found if (amounts := amounts_of(reset))]


def declared_reset(model: Any, key: tuple[Any, ...]) -> Mapping[str, Expression]:
    """Return the declaration of a model's reset, by its key."""
    kind, *numbers = key
    if kind == "choice":
        c, m, g, k = numbers
        return model.all_components()[c].modes[m].guards[g].then[k].reset
    if kind == "limit":
        return model.all_components()[numbers[0]].limit.reset
    return (model.monitors if kind == "monitor" else model.schedules)[numbers[0]].reset
