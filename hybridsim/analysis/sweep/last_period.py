"""This module measures the last forcing period of a run, even if the motion does not repeat."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.analysis.steady.measures import Measures
from hybridsim.analysis.sweep.parameters import Setter
from hybridsim.analysis.sweep.work.job import DONE, Job, Outcome, Settings, Watch
from hybridsim.engine.system.period import common_period
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import SimulationError, UsageError
from hybridsim.model import Model
from hybridsim.simulate import simulate

if TYPE_CHECKING:
    from hybridsim.ensemble.runs import LastPeriods
    from hybridsim.solution import Solution

OF_MOTION = ("period", "residual", "word")
_OF_STATES = ("amplitude", "peak", "maximum", "minimum", "mean", "energy")
_OF_CONTACTS = ("stick_fraction", "stops_per_period")
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
        """Return the values stored for a point that has no result."""
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
    ) -> list[Outcome] | None:
        """Run all points in one compiled call, or return None; the function `alone` runs the points that fail in it.

        If the watch requests a stop, the outcomes are those of the first points, as far as they were run.
        """
        from hybridsim.ensemble.runs import Ensemble, can_run_together

        system = system_of(job.model)
        readers = [_reader(word, system) for word in self.reading_names]
        if not self._is_plain() or None in readers or not can_run_together(system):
            return None
        parameters, starts, sound = Setter(job.model, job.names, job.at).values(points)
        outcomes: list[Outcome | None] = [None] * len(points)
        for last in Ensemble(system, watch.may_continue).runs(parameters[sound], starts[sound], self.after):
            rows = np.array([read(last) for read in readers if read]).T.tolist()
            for number, row in zip(sound[last.numbers].tolist(), rows, strict=True):
                outcomes[number] = _outcome(dict(zip(self.reading_names, row, strict=True)))
            watch.tell(len(rows))
        known: list[Outcome] = []
        for outcome, settings in zip(outcomes, points, strict=True):
            if outcome is None:
                if not watch.may_continue():
                    break
                outcome = alone(settings)
                watch.tell(1)
            known.append(outcome)
        return known

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
            f"model {model.name} has no periodic forcing: there is no last period",
            remedy="remove `after`, or use hs.steady_state, which also finds unforced motions",
        )
    return period


def _outcome(found: dict[str, Any]) -> Outcome:
    missing = [word for word, value in found.items() if not math.isfinite(value)]
    return Outcome(f"not a number: {', '.join(missing)}" if missing else DONE, found)


def _reader(word: str, system: Any) -> Callable[[LastPeriods], np.ndarray] | None:
    """Return a function that computes one value from sums over the last periods, or None."""
    head, _, rest = word.partition(".")
    if head == "period":
        return lambda last: last.periods
    if head == "residual":
        return _residuals
    if head in _OF_STATES and rest in system.names:
        return _of_state(head, system.names.index(rest))
    contacts = [automaton.name for automaton in system.automata]
    if head in _OF_CONTACTS and rest in contacts:
        c = contacts.index(rest)
        if head == "stick_fraction":
            return lambda last: last.summary.held[:, 0, c] / last.periods
        # an interval across the end of the period counts once, permanent stick counts zero
        return lambda last: last.summary.held[:, 1, c] - last.summary.holding[:, :, c].all(axis=1)
    return None


def _of_state(head: str, i: int) -> Callable[[LastPeriods], np.ndarray]:
    def read(last: LastPeriods) -> np.ndarray:
        low, high = last.summary.extremes[:, :, i].T
        whole, squares = last.summary.integrals[:, :, i].T
        if head == "amplitude":
            return np.asarray(0.5 * (high - low))
        if head == "peak":
            return np.maximum(np.abs(low), np.abs(high))
        if head == "mean":
            return np.asarray(whole / last.periods)
        return {"maximum": high, "minimum": low, "energy": squares}[head]

    return read


def _residuals(last: LastPeriods) -> np.ndarray:
    extremes, ends = last.summary.extremes, last.summary.ends
    return _residual(extremes[:, 0], extremes[:, 1], ends[:, 0], ends[:, 1])


def _residual(low: np.ndarray, high: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the largest change of a state relative to half of the state's range, along the last axis."""
    scale = np.maximum(0.5 * (high - low), _SMALLEST * np.maximum(abs(low), abs(high)))
    change = np.abs(after - before)
    return np.divide(change, scale, out=np.zeros_like(change), where=scale > 0.0).max(axis=-1, initial=0.0)
