"""How long something may take: checked from time to time by what takes the time, compiling apart."""

from __future__ import annotations

import time
from collections.abc import Callable

from hybridsim.engine.jit import seconds_compiling


class OutOfTime(Exception):
    """Something has used up the time that it was given; the text says how long that was."""


class Stopwatch:
    """Seconds since it was made, without those that this thread has spent on compiling."""

    def __init__(self) -> None:
        self._began, self._compiled = time.perf_counter(), seconds_compiling()

    @property
    def seconds(self) -> float:
        """Seconds so far."""
        return time.perf_counter() - self._began - (seconds_compiling() - self._compiled)


class Allowance:
    """Given as `progress` to what is not to take longer: raises `OutOfTime` when it does.

    Parameters
    ----------
    seconds : from now on, without those for compiling.
    told : called at every look, for whoever wants to see that something goes on.
    """

    def __init__(self, seconds: float, told: Callable[[], None] | None = None) -> None:
        self.seconds, self._told, self._watch = seconds, told, Stopwatch()

    def __call__(self, fraction: float = 0.0) -> None:
        if self._told is not None:
            self._told()
        if self._watch.seconds > self.seconds:
            raise OutOfTime(f"not done after {self.seconds:.2g} s")
