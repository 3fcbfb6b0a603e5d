"""This module defines locks that a forked child process finds released, even if a thread held them."""

from __future__ import annotations

import os
import sys
from functools import cached_property
from threading import Lock, RLock
from types import TracebackType
from typing import Any
from weakref import WeakSet


class SharedLock:
    """A lock for short critical sections that is free in a newly forked child process."""

    __slots__ = ("__weakref__", "_lock")

    def __init__(self) -> None:
        self._lock = Lock()
        _locks.add(self)

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def renew(self) -> None:
        """Replace the lock by a new one, even if a thread holds the old one."""
        self._lock = Lock()


_locks: WeakSet[SharedLock] = WeakSet()


def _renew_all() -> None:
    """Replace all locks by new ones in a newly forked child process."""
    for lock in list(_locks):
        lock.renew()
    if sys.version_info < (3, 12):  # older versions keep one lock per cached property in the class
        for name, module in list(sys.modules.items()):
            if name.partition(".")[0] == "hybridsim":
                _renew_properties(module)


def _renew_properties(module: Any) -> None:
    for kind in list(vars(module).values()):
        if isinstance(kind, type):
            for part in list(vars(kind).values()):
                if isinstance(part, cached_property):
                    part.lock = RLock()  # type: ignore[attr-defined]  # of Python 3.11


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_all)
