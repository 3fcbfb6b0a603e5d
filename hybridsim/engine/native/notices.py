"""This module prints on stderr, once in a process, that parts of the engine are being compiled."""

from __future__ import annotations

import sys
from functools import cache

from hybridsim.engine.native.cache import cache_root, kernel_folder, store

_announced: set[str] = set()  # once per process


@cache
def announce_engine() -> None:
    """Print, once for each cache, that the engine is being compiled."""
    # an existing folder is no proof, because it is created when a kernel is defined
    folder = kernel_folder()
    if folder is None or not (folder / "announced").exists():
        store(folder and folder / "announced", b"")
        _tell("compiling the engine (once, about 30 s per integrator)")


def announce_part(module: str) -> None:
    """Print that an additional part of the engine is being compiled, with the folder of its module."""
    folder = "/".join(module.split(".")[:-1])
    _tell(f"compiling another part of the engine, {folder} (once, 10 to 30 s)")


def _tell(what: str) -> None:
    if not _announced:
        _announced.add(what)
        state = "not cached" if kernel_folder() is None else f"cached in {cache_root()}"
        print(f"hybridsim: {what}; {state} ...", file=sys.stderr, flush=True)
