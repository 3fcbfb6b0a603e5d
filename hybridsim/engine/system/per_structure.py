"""Values that depend on a model's structure alone, made once for all systems that share it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

Key = ParamSpec("Key")
Made = TypeVar("Made")


def per_structure(
    make: Callable[Concatenate[Any, Key], Made],
) -> Callable[Concatenate[Any, Key], Made]:
    """Keep what a function of a system makes, for each key of further arguments, as long as the system's code lives.

    If several threads make a value at the same time, all get the value of the first one.
    """

    @wraps(make)
    def of(system: Any, *key: Key.args, **named: Key.kwargs) -> Made:
        made, place = system.code.shared, (of, *key)
        if place not in made:
            made.setdefault(place, make(system, *key, **named))
        found: Made = made[place]
        return found

    return of


@per_structure
def spare_scratch(system: Any, *kind: Hashable) -> deque[Any]:
    """Return the pool of unused scratch arrays of one kind."""
    return deque()
