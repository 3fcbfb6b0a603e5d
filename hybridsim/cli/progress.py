"""This module shows progress on one line of a terminal, and erases the line at the end."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

from hybridsim.cli.session import Session

_WAIT = 1.0  # seconds before the first display; shorter work shows no progress
_WIDTH = 79  # characters; a wrapped line could not be erased
_PAUSE = 0.1  # seconds between updates


class Progress:
    """Shows the finished fraction and the current step, if stderr is a terminal."""

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
        """Show progress as the number of finished steps out of a total."""
        self(done / total, what)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._shown:
            print("\r" + " " * self._shown + "\r", end="", file=sys.stderr, flush=True)
