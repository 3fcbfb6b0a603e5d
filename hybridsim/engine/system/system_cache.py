"""This module caches the systems of recent models, so that repeated runs bind a model once."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock
from hybridsim.model.parts.model import Model

_MAX_SYSTEMS = 16  # largest number of cached systems, enough for loops over several models

# the system of each model by its identity, and the runs that were prepared for it
_systems: dict[int, tuple[System, dict[Any, Any]]] = {}
_lock = SharedLock()


def runs_of(model: Model) -> dict[Any, Any]:
    """Return the stored settings of runs of a model; they are discarded with the model's system."""
    # a system keeps its model alive, so no other object has the same id
    known = _systems.get(id(model))
    return {} if known is None else known[1]


def bound(model: Model) -> System:
    """Bind a model to a new system.

    Raises
    ------
    ModelError
        With all faults of the model.
    """
    return System(model.validate())


def system_of(model: Model) -> System:
    """Return the system of a model from the cache, or bind the model to a new system, as `bound` does."""
    known = _systems.get(id(model))
    if known is not None and known[0].code.is_current:
        return known[0]
    system = bound(model)
    with _lock:
        while len(_systems) >= _MAX_SYSTEMS:
            del _systems[next(iter(_systems))]
        _systems[id(model)] = system, {}
    return system
