"""This module ensures that only one thread, and only one call, uses a simulator at a time."""

from __future__ import annotations

import threading

from hybridsim.errors import UsageError


class Ownership:
    """The thread that owns a simulator, and whether one of its calls is in progress.

    ``with ownership("advance"):`` surrounds the work of a call; `name` is that of the model.
    """

    def __init__(self, name: str) -> None:
        self._name, self._owner, self._is_busy = name, threading.current_thread(), False

    def __call__(self, call: str) -> Ownership:
        """Raise an error for calls from other threads, and for calls during another call."""
        here = threading.current_thread()
        if self._owner is not here:
            raise UsageError(
                f"the simulator of model {self._name} belongs to thread {self._owner.name!r}, and {here.name!r} "
                f"called {call}()",
                remedy="use a separate sim.copy() in the other thread",
            )
        if self._is_busy:
            raise UsageError(
                f"{call}() was called during another call of the same simulator",
                remedy="use a separate sim.copy() for the inner call",
            )
        return self

    def __enter__(self) -> None:
        self._is_busy = True

    def __exit__(self, *_: object) -> None:
        self._is_busy = False
