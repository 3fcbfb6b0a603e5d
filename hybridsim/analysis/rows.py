"""One run in a comparison: what it was, how far off, and what it cost."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hybridsim.analysis.errors_against_reference import Errors

QUANTITIES = ("state", "state_last_period", "event_time", "graph")

# How a run ended that the budget of time did not allow.
NOT_STARTED, STOPPED = "not started", "stopped"


@dataclass(frozen=True)
class Cost:
    """What a run cost.

    Parameters
    ----------
    wall_times : seconds of each timed repetition; of the run that warmed up, where there was no time for more.
    rhs_evaluations, guard_evaluations, steps : counts of one run.
    compile_time : seconds that the first run spent on making and compiling the model's functions, apart.
    repetitions : how many of the wall times are of a run that others had warmed up.
    """

    wall_times: tuple[float, ...]
    rhs_evaluations: int
    guard_evaluations: int
    steps: int
    compile_time: float = 0.0
    repetitions: int = 0

    @property
    def work(self) -> int:
        """Evaluations and steps: what grows as the tolerance falls, and is the same on every machine."""
        return max(self.rhs_evaluations + self.guard_evaluations, self.steps, 1)

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
    form : the regularised form that was run in place of the model, or "".
    """

    integrator: str
    label: str
    setting: tuple[str, float]
    options: Mapping[str, Any]
    status: str
    message: str = ""
    errors: Errors | None = None
    cost: Cost | None = None
    form: str = ""

    def timed(self, wall_times: tuple[float, ...]) -> Row:
        """The row with the wall times of its repetitions; as it is, where there are none."""
        if self.cost is None or not wall_times:
            return self
        return replace(self, cost=replace(self.cost, wall_times=wall_times, repetitions=len(wall_times)))


@dataclass(frozen=True)
class Reading:
    """An error as it can be known: a value, or only that it is below the reference's own uncertainty."""

    value: float
    is_bound: bool

    def __str__(self) -> str:
        return f"< {self.value:.1e}" if self.is_bound else f"{self.value:.2e}"
