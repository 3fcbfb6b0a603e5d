"""What a program touches while it works: files that it opens for writing, programs that it starts, code of others."""

from __future__ import annotations

import builtins
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fuzz.nasty import CANARY

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
STARTING = (
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.fork",
    "subprocess.Popen",
    "socket.connect",
    "pty.spawn",
)
CHANGING = (
    "os.remove",
    "os.rename",
    "os.mkdir",
    "os.rmdir",
    "os.truncate",
    "os.link",
    "os.symlink",
    "os.chmod",
)


class _Watch:
    """What has been seen since it was last emptied; an audit hook cannot be taken off, so there is one for all."""

    def __init__(self) -> None:
        self.active = False
        self.installed = False
        self.code: list[str] = []
        self.written: list[Path] = []
        self.allowed: tuple[Path, ...] = ()

    def hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.active:
            return
        if event == "open":
            path, _, flags = arguments
            if isinstance(path, str | bytes | os.PathLike) and isinstance(flags, int) and flags & WRITING:
                self._wrote(path)
        elif event in CHANGING:
            self._wrote(arguments[1] if event == "os.rename" else arguments[0])
        elif event in STARTING:
            self.code.append(f"{event}{arguments[:2]!r}"[:300])
        elif event == "import" and arguments[0] == CANARY:
            self.code.append("the canary was imported")

    def _wrote(self, path: str | bytes | os.PathLike[Any]) -> None:
        place = Path(os.path.abspath(os.fsdecode(path)))
        if place != Path(os.devnull) and not any(place.is_relative_to(folder) for folder in self.allowed):
            self.written.append(place)

    def call(self, *arguments: object) -> float:
        """The canary."""
        self.code.append("the canary was called")
        return 1.0


_watch = _Watch()


@contextmanager
def watching(*allowed: Path) -> Iterator[_Watch]:
    """What is seen meanwhile; writing into the allowed folders (caches) is nothing."""
    if not _watch.installed:
        sys.addaudithook(_watch.hook)
        _watch.installed = True
    _watch.code, _watch.written, _watch.allowed = [], [], tuple(Path(os.path.abspath(a)) for a in allowed)
    setattr(builtins, CANARY, _watch.call)
    _watch.active = True
    try:
        yield _watch
    finally:
        _watch.active = False
        delattr(builtins, CANARY)
