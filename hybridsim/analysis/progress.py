"""Counts the steps of long work for whoever wants to see how far it has come."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called as progress(done, total, what is next)."""


class Steps:
    """Called with what is next before each of `total` steps; passes that on with the count."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self._total, self._done, self._progress = total, 0, progress

    def __call__(self, what: str) -> None:
        if self._progress is not None:
            self._progress(min(self._done, self._total), self._total, what)
        self._done += 1

    def finish(self) -> None:
        """Say that all is done, also where some of the steps fell away."""
        if self._progress is not None:
            self._progress(self._total, self._total, "done")
