"""This module limits the cost of a run; a run that exceeds a limit stops and keeps its results."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from math import inf
from time import perf_counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hybridsim.engine.record.counters import Counters

_OFTEN = 64  # checks of the clock and the counters per check of the memory, which needs a system call


class LimitReached(Exception):
    """Raised when a limit of the run is exceeded; the message names the limit."""


@dataclass(frozen=True)
class Limits:
    """The limits on the cost of one run, such as steps and seconds."""

    events: float = inf
    steps: float = inf
    seconds: float = inf  # wall-clock time
    megabytes: float = inf  # growth of the process


UNLIMITED = Limits()


class LimitMonitor:
    """Compares the cost of one run with its limits."""

    def __init__(self, limits: Limits, counters: Counters) -> None:
        self.limits, self.counters = limits, counters
        self._events, self._steps = counters.events, counters.steps
        self._began = perf_counter()
        self._size = resident_megabytes() if limits.megabytes < inf else 0.0
        self._looks = 0

    def check(self) -> None:
        """Raise LimitReached if the run has exceeded a limit."""
        limits, counters = self.limits, self.counters
        if counters.events - self._events >= limits.events:
            raise LimitReached(
                f"{counters.events - self._events} events were reached, but at most {limits.events:g} are allowed"
            )
        if counters.steps - self._steps >= limits.steps:
            raise LimitReached(
                f"{counters.steps - self._steps} steps were taken, but at most {limits.steps:g} are allowed"
            )
        seconds = perf_counter() - self._began
        if seconds >= limits.seconds:
            raise LimitReached(f"{seconds:.3g} s have passed, but at most {limits.seconds:g} are allowed")
        if limits.megabytes < inf:
            if self._looks % _OFTEN == 0 and (grown := resident_megabytes() - self._size) >= limits.megabytes:
                raise LimitReached(
                    f"memory grew by {grown:.0f} MB since the start, but at most {limits.megabytes:g} MB are allowed"
                )
            self._looks += 1


def resident_megabytes() -> float:
    """Return the memory of this process in megabytes: the current use on Linux, elsewhere the peak."""
    try:
        with open("/proc/self/statm") as file:
            pages = int(file.read().split()[1])
        import resource

        return pages * resource.getpagesize() / 1e6
    except OSError:
        import resource

        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return most / 1e6 if sys.platform == "darwin" else most / 1e3
