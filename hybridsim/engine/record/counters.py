"""This module counts the work of a run, such as steps and evaluations."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Counters:
    """Counts of the work of a run, summed over all segments."""

    steps: int = 0
    rejected: int = 0
    rhs_evaluations: int = 0
    guard_evaluations: int = 0
    events: int = 0
    restarts: int = 0
    kernel_time: float = 0.0  # seconds in the compiled mode loop

    def copy(self) -> Counters:
        """Return a separate copy of the counters."""
        other = object.__new__(Counters)
        other.__dict__.update(self.__dict__)
        return other
