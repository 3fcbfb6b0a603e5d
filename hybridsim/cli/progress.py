"""A line that shows how far long work has come: on a terminal only, and gone when the work is done."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

from hybridsim.cli.session import Session

_WAIT = 1.0  # seconds; what is done sooner needs no progress
_WIDTH = 79  # a line that wraps cannot be taken back
_PAUSE = 0.1  # seconds between updates, so that showing costs nothing


class Progress:
    """Callable with the finished fraction and what comes next; silent where stderr is no terminal."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._shown = 0
        self._next = time.monotonic() + _WAIT

    def __call__(self, fraction: float, what: str = "") -> None:
        self._session.stop_if_asked()
        if time.monotonic() >= self._next and sys.stderr.isatty():
            line = f"{100 * fraction:5.1f} %  {what}"[:_WIDTH].rstrip()
            print("\r" + line.ljust(self._shown), end="", file=sys.stderr, flush=True)
            self._shown = len(line)
            self._next = time.monotonic() + _PAUSE

    def of_steps(self, done: int, total: int, what: str) -> None:
        """The same, from a count of steps."""
        self(done / total, what)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._shown:
            print("\r" + " " * self._shown + "\r", end="", file=sys.stderr, flush=True)
