"""This module stops a computation after a time limit, through its progress callback."""

from __future__ import annotations

import time
from collections.abc import Callable

from hybridsim.engine.native.compiler import seconds_compiling


class OutOfTime(Exception):
    """Raised when a computation has passed its time limit; the text states the limit."""


class Stopwatch:
    """A stopwatch that excludes the time that this thread spends compiling."""

    def __init__(self) -> None:
        self._began, self._compiled = time.perf_counter(), seconds_compiling()

    @property
    def seconds(self) -> float:
        """The elapsed seconds, without compiling."""
        return time.perf_counter() - self._began - (seconds_compiling() - self._compiled)


class TimeBudget:
    """A progress callback that raises `OutOfTime` after a given time.

    Parameters
    ----------
    seconds : the time limit from now on, without compiling.
    report : called at each check, to show progress.
    """

    def __init__(self, seconds: float, report: Callable[[], None] | None = None) -> None:
        self.seconds, self._report, self._watch = seconds, report, Stopwatch()

    def __call__(self, fraction: float = 0.0) -> None:
        if self._report is not None:
            self._report()
        if self._watch.seconds > self.seconds:
            raise OutOfTime(f"not finished after {self.seconds:.2g} s")
