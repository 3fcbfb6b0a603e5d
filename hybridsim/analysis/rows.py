"""One run in a comparison: what it was, how far off, and what it cost."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hybridsim.analysis.errors_against_reference import Errors

QUANTITIES = ("state", "state_last_period", "event_time")


@dataclass(frozen=True)
class Cost:
    """What a run cost: wall times in seconds over the timed repetitions, and counts of one run."""

    wall_times: tuple[float, ...]
    rhs_evaluations: int
    guard_evaluations: int
    steps: int

    @property
    def wall_time(self) -> float:
        """The median."""
        return statistics.median(self.wall_times)


@dataclass(frozen=True)
class Row:
    """One integrator at one setting.

    Parameters
    ----------
    integrator, label : its registered name, and the name of its line in the table and the chart.
    setting : name and value of what is varied along the line, such as ("rtol", 1e-9).
    options : everything it was called with.
    status, message : how the run ended; of a failure there is no error and no cost.
    """

    integrator: str
    label: str
    setting: tuple[str, float]
    options: Mapping[str, Any]
    status: str
    message: str = ""
    errors: Errors | None = None
    cost: Cost | None = None

    def timed(self, wall_times: tuple[float, ...]) -> Row:
        """The row with its wall times."""
        return replace(self, cost=replace(self.cost, wall_times=wall_times) if self.cost else None)


@dataclass(frozen=True)
class Reading:
    """An error as it can be known: a value, or only that it is below the reference's own uncertainty."""

    value: float
    is_bound: bool

    def __str__(self) -> str:
        return f"< {self.value:.1e}" if self.is_bound else f"{self.value:.2e}"
