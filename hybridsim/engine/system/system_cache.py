"""This module caches the systems of recent models, so that repeated runs bind a model once."""

from __future__ import annotations

from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock
from hybridsim.model.parts.model import Model

_MAX_SYSTEMS = 16  # largest number of cached systems, enough for loops over several models

_systems: dict[int, System] = {}
_lock = SharedLock()


def known_system(model: Model) -> System | None:
    """Return the cached system of a model, or None."""
    # a system keeps its model alive, so no other object has the same id
    return _systems.get(id(model))


def system_of(model: Model) -> System:
    """Return the system of a valid model from the cache, or bind the model to a new system.

    Raises
    ------
    ModelError
        With all faults of the model.
    """
    system = known_system(model)
    if system is not None and system.code.is_current:
        return system
    system = System(model.validate())
    with _lock:
        while len(_systems) >= _MAX_SYSTEMS:
            del _systems[next(iter(_systems))]
        _systems[id(model)] = system
    return system
