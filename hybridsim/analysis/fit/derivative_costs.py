"""This module compares the costs of exact derivatives and of difference quotients for one record of a fit."""

from __future__ import annotations

import math
from collections.abc import Callable

from hybridsim.solution import Solution

# Seconds, from models with 4 to 400 ordinary events and 14 to 2800 steps. They count until the costs are measured.
_EXACT, _EXACT_SEGMENT, _EXACT_STEP = 1.8e-3, 0.02e-3, 0.005e-3  # of exact derivatives
_RUN, _RUN_STEP = 0.5e-3, 0.0015e-3  # of a run in a compiled loop


class DerivativeCosts:
    """Measured times of the runs of one record and of their exact derivatives.

    The least time counts, because the first run of a process loads code and other processes delay later runs.
    """

    def __init__(self) -> None:
        self._runs = self._exact = 0
        self._run_time = self._exact_time = math.inf

    def add_run(self, seconds: float) -> None:
        """Add the measured time of one run."""
        self._runs, self._run_time = self._runs + 1, min(self._run_time, seconds)

    def add_exact(self, seconds: float) -> None:
        """Add the measured time of one computation of exact derivatives."""
        self._exact, self._exact_time = self._exact + 1, min(self._exact_time, seconds)

    def is_exact_cheaper(self, solution: Solution, unknowns: int, run_again: Callable[[], object]) -> bool:
        """Return whether exact derivatives take less time than two runs for each unknown.

        run_again : repeats the run and adds its time. It is called if the choice depends on a single measured run.
        """
        exact, steps = self._exact_time, solution.stats["steps"]
        if self._exact < 2:
            exact = _EXACT + _EXACT_SEGMENT * len(solution._segments) + _EXACT_STEP * steps
        if (
            self._runs == 1
            and 2 * unknowns * (_RUN + _RUN_STEP * steps) <= exact < 2 * unknowns * self._run_time
        ):
            run_again()
        return exact < 2 * unknowns * self._run_time
