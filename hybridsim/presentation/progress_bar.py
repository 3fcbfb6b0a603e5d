"""This module shows the progress of a long call as a bar on one line of a terminal or a notebook."""

from __future__ import annotations

import sys
import time
from typing import Any

from hybridsim.errors import UsageError

_WAIT = 0.5  # seconds before the first display; shorter calls show no bar
_PAUSE = 0.1  # seconds between updates
_CELLS = 24  # characters of the bar
_WIDTH = 79  # characters of the line


class ProgressLine:
    """A line on stderr that is overwritten regularly after an initial delay."""

    def __init__(self, wait: float) -> None:
        self.wait, self.began = wait, time.monotonic()
        self._next = self.began + wait
        self.shown = 0  # characters of the open line

    def is_due(self) -> bool:
        """Return whether the progress line is due to be updated."""
        return time.monotonic() >= self._next

    def write(self, text: str) -> None:
        """Write the line over its former text. A long line is cut, because a wrapped line could not be overwritten."""
        line = text[:_WIDTH].rstrip()
        print("\r" + line.ljust(self.shown), end="", file=sys.stderr, flush=True)
        self.shown, self._next = len(line), time.monotonic() + _PAUSE

    def leave(self, end: str) -> None:
        """End the line with a final text, if the line is open."""
        if self.shown:
            print(end, end="", file=sys.stderr, flush=True)
            self.shown, self._next = 0, time.monotonic() + self.wait


class ProgressBar:
    """A progress callback that shows a bar, the time left and the current step on stderr.

    It is called with the finished fraction, or with the numbers of finished and of all steps and the name of the
    next step. Output that is neither a terminal nor a notebook shows nothing.
    """

    def __init__(self) -> None:
        self._line = ProgressLine(_WAIT)

    def __call__(self, done: float, total: float = 1.0, what: str = "") -> None:
        fraction, line = min(max(done / total, 0.0), 1.0), self._line
        is_last = fraction == 1.0 and line.shown > 0
        if not is_last and not (line.is_due() and can_show()):
            return
        filled, left = round(_CELLS * fraction), ""
        if not (is_last or fraction == 0.0):
            left = _clock((time.monotonic() - line.began) * (1.0 - fraction) / fraction) + " left"
        line.write(f"{100 * fraction:5.1f} % |{'#' * filled}{' ' * (_CELLS - filled)}| {left}  {what}")
        if is_last:
            self.close()

    def close(self) -> None:
        """End the line of the bar, if the line is open."""
        self._line.leave("\n")

    def __del__(self) -> None:
        if hasattr(self, "_line") and sys.stderr is not None:
            self.close()


def can_show() -> bool:
    """Return whether stderr is a terminal, or the output of a notebook."""
    return sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)


def callback(progress: Any) -> Any:
    """Return the progress function of the argument `progress`: a bar for True, None for None and False.

    Raises
    ------
    UsageError
        For anything else that cannot be called.
    """
    if progress is None or progress is False:
        return None
    if progress is True:
        return ProgressBar()
    if not callable(progress):
        raise UsageError(
            f"`progress` cannot be {progress!r}",
            remedy="use True for a bar, or a function of the finished fraction",
        )
    return progress


def _clock(seconds: float) -> str:
    """Return a duration as minutes and seconds, or as hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
