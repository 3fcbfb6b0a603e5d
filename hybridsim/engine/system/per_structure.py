"""This module stores values that depend on a model's structure only, once for all systems of this structure."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, TypeVar, TypeVarTuple

Key = TypeVarTuple("Key")
Made = TypeVar("Made")


def per_structure(make: Callable[[Any, *Key], Made], most: int = sys.maxsize) -> Callable[[Any, *Key], Made]:
    """Cache the results of a function of a system, for as long as the code of the system is in use.

    If several threads make a value at the same time, all get the value of the first one. most: number of keys after
    which all values are made again, for keys such as the values of parameters.
    """

    @wraps(make, updated=())
    def of(system: Any, *key: *Key) -> Made:
        shared = system.code.shared
        try:
            known: Made = shared[of][key]
            return known
        except KeyError:
            found = make(system, *key)
        made: dict[tuple[*Key], Made] = shared.setdefault(of, {})
        if len(made) >= most:
            made.clear()
        return made.setdefault(key, found)

    return of


@per_structure
def spare_scratch(system: Any, *kind: Hashable) -> deque[Any]:
    """Return the pool of unused scratch arrays of one kind."""
    return deque()
