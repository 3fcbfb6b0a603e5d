"""This module measures the last forcing period of a run, even if the motion does not repeat."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.analysis.steady.measures import Measures
from hybridsim.analysis.steady.period_readings import Reader, period_reader
from hybridsim.analysis.sweep.work.job import Job, Outcome, Settings, Together, Watch
from hybridsim.analysis.sweep.work.together import PointsTogether
from hybridsim.engine.system.period import common_period
from hybridsim.engine.system.system import System
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import SimulationError, UsageError
from hybridsim.model import Model
from hybridsim.simulate import simulate

if TYPE_CHECKING:
    from hybridsim.ensemble.runs import LastPeriods
    from hybridsim.solution import Solution

OF_MOTION = ("period", "residual", "word")
_SMALLEST = 1e-3  # relative to a state's size; the least range used to scale its change


@dataclass(frozen=True)
class MeasuredPeriod(Measures):
    """The last forcing period of a run, with the measures of a steady state."""

    solution: Solution
    period: float

    @property
    def residual(self) -> float:
        """The largest change of a state over the period, relative to half of the state's range."""
        low, high = self._orbit.extremes
        ends = self.solution.y[:, [0, -1]]
        n = len(ends)
        return float(_residual(low[:n], high[:n], ends[:, 0], ends[:, 1]))


@dataclass(frozen=True)
class LastPeriod:
    """A measure over the one forcing period that follows the first `after` periods."""

    reading_names: tuple[str, ...]
    after: int
    options: Mapping[str, Any]
    read_one: Callable[[Any, str], Any]

    def nothing(self) -> dict[str, float | str]:
        """Return placeholders, such as NaN, for the values of a point without a result."""
        return {word: "" if word == "word" else math.nan for word in self.reading_names}

    def run(self, model: Model, previous: Any) -> MeasuredPeriod:
        """Run the model up to the end of the measured period."""
        period = period_of(model)
        solution = simulate(model, (0.0, self.after * period), **{**self.options, "keep": period})
        if not solution.success:
            raise SimulationError(f"{solution.status}: {solution.message}")
        return MeasuredPeriod(solution, period)

    def read(self, result: MeasuredPeriod) -> dict[str, Any]:
        """Return the values in the order of their names."""
        return {word: self.read_one(result, word) for word in self.reading_names}

    def together(
        self,
        job: Job,
        points: Sequence[Settings],
        alone: Callable[[Settings], Outcome],
        watch: Watch,
    ) -> Together | None:
        """Run all points in compiled code and repeat failed points with `alone`; return None if this is impossible."""
        from hybridsim.ensemble.group import Ensemble, can_run_together
        from hybridsim.ensemble.runs import last_periods

        system = system_of(job.model)
        readers = [_reader(word, system) for word in self.reading_names]
        if not self._is_plain() or None in readers or not can_run_together(system):
            return None
        batch = PointsTogether(job, points, alone, watch)
        ensemble = Ensemble(system, watch.may_continue)
        for last in last_periods(ensemble, batch.parameters, batch.starts, self.after):
            rows = zip(*(read(last).tolist() for read in readers if read), strict=True)
            batch.put(last.numbers, [dict(zip(self.reading_names, row, strict=True)) for row in rows])
        return batch.finished()

    def _is_plain(self) -> bool:
        return self.options.get("integrator", "auto") in ("auto", "exact") and not self.options.keys() - {
            "integrator"
        }


def period_of(model: Model) -> float:
    """Return the common forcing period of a model.

    Raises
    ------
    UsageError
        If the model has no periodic forcing.
    """
    period = common_period(system_of(model))
    if period is None:
        raise UsageError(
            f"model {model.name} has no periodic forcing, so there is no last period",
            remedy="remove `after`, or use hs.steady_state, which also finds unforced motions",
        )
    return period


def _reader(word: str, system: System) -> Reader | None:
    """Return a function that computes a named value from the last periods, or None for an unsupported name."""
    if word == "period":
        return lambda last: last.periods
    if word == "residual":
        return _residuals
    return period_reader(word, system)


def _residuals(last: LastPeriods) -> np.ndarray:
    extremes, ends = last.summary.extremes, last.summary.ends
    return _residual(extremes[:, 0], extremes[:, 1], ends[:, 0], ends[:, 1])


def _residual(low: np.ndarray, high: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the largest change of a state relative to half of the state's range, along the last axis."""
    scale = np.maximum(0.5 * (high - low), _SMALLEST * np.maximum(abs(low), abs(high)))
    change = np.abs(after - before)
    return np.divide(change, scale, out=np.zeros_like(change), where=scale > 0.0).max(axis=-1, initial=0.0)
