"""This module counts the steps of long computations for progress callbacks."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""The type of progress callbacks, called as progress(done, total, name of the next item)."""


class Steps:
    """A progress counter of `total` steps; each call reports the step that begins and the number of finished steps."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self._total, self._done, self._progress = total, 0, progress

    def __call__(self, what: str) -> None:
        if self._progress is not None:
            self._progress(min(self._done, self._total), self._total, what)
        self._done += 1

    def finish(self) -> None:
        """Report that all steps are done, even if some were skipped."""
        if self._progress is not None:
            self._progress(self._total, self._total, "done")
