"""This module defines the row of one run in a comparison: its setting, its errors and its cost."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hybridsim.analysis.compare.errors_against_reference import Errors

QUANTITIES = ("state", "state_last_period", "event_time", "graph")

# Statuses of runs that did not fit into the time budget.
NOT_STARTED, STOPPED = "not started", "stopped"


@dataclass(frozen=True)
class Cost:
    """The cost of a run.

    Parameters
    ----------
    wall_times : seconds of each timed repetition; of the warm-up run if there was no time for more.
    rhs_evaluations, guard_evaluations, steps : counts of one run.
    compile_time : seconds of the first run for building and compiling the model's functions; not in wall_times.
    repetitions : the number of wall times that were measured after a warm-up.
    """

    wall_times: tuple[float, ...]
    rhs_evaluations: int
    guard_evaluations: int
    steps: int
    compile_time: float = 0.0
    repetitions: int = 0

    @property
    def work(self) -> int:
        """The numbers of evaluations and steps, which are equal on every machine."""
        return max(self.rhs_evaluations + self.guard_evaluations, self.steps, 1)

    @property
    def wall_time(self) -> float:
        """The median wall time."""
        return statistics.median(self.wall_times)


@dataclass(frozen=True)
class Row:
    """The run of one integrator at one setting.

    Parameters
    ----------
    integrator, label : its registered name, and the name of its line in the table and the chart.
    setting : name and value of the option varied along the line, such as ("rtol", 1e-9).
    options : all options of the call.
    status, message : how the run ended; a failed run has no errors and no cost.
    form : the regularised form that was run instead of the model, or "".
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
        """Return the row with the measured wall times, or the unchanged row if no times were measured."""
        if self.cost is None or not wall_times:
            return self
        return replace(self, cost=replace(self.cost, wall_times=wall_times, repetitions=len(wall_times)))


@dataclass(frozen=True)
class Reading:
    """An error, or an upper bound of an error that is below the uncertainty of the reference."""

    value: float
    is_bound: bool

    def __str__(self) -> str:
        return f"< {self.value:.1e}" if self.is_bound else f"{self.value:.2e}"
