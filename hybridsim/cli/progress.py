"""This module shows progress on one line of a terminal, and erases the line at the end."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Self

from hybridsim.cli.session import Session
from hybridsim.presentation.progress_bar import ProgressLine

_WAIT = 1.0  # seconds before the first display; shorter work shows no progress


class Progress:
    """Shows the finished fraction and the current step, if stderr is a terminal."""

    def __init__(self, session: Session) -> None:
        self._session, self._line = session, ProgressLine(_WAIT)

    def __call__(self, fraction: float, what: str = "") -> None:
        self._session.stop_if_asked()
        if self._line.is_due() and sys.stderr.isatty():
            self._line.write(f"{100 * fraction:5.1f} %  {what}")

    def of_steps(self, done: int, total: int, what: str) -> None:
        """Show progress as the number of finished steps out of a total."""
        self(done / total, what)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._line.leave("\r" + " " * self._line.shown + "\r")
