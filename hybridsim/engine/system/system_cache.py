"""The systems of the models that were run last: a model that is run again and again is validated and bound once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model

_MOST = 16  # kept with their models; a loop over a few models finds them all

_kept: dict[int, System] = {}
_lock = SharedLock()


def known_system(model: Model) -> System | None:
    """The system of a model that was run lately."""
    # a system holds its model, so nothing else has that number while it is kept
    return _kept.get(id(model))


def system_of(model: Model) -> System:
    """The system of a valid model, the same for the same object: models are frozen and systems keep nothing of a run.

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
        while len(_kept) >= _MOST:
            del _kept[next(iter(_kept))]
        _kept[id(model)] = system
    return system
