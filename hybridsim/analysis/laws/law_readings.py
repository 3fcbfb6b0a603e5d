"""This module selects the readings that `compare_laws` takes from each run, by the names that `sweep` uses."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from hybridsim.analysis.steady.over_run import OverRun
from hybridsim.analysis.sweep.last_period import MeasuredPeriod
from hybridsim.analysis.sweep.named_measures import named_measure
from hybridsim.arguments import cannot_be, is_row
from hybridsim.errors import UsageError
from hybridsim.model import Model
from hybridsim.solution import Solution

OF_RUNS = ("final", "first_passage", "stops")


@dataclass(frozen=True)
class LawReadings:
    """The readings of a comparison of laws: their names, and the period of the forcing, or None for whole runs."""

    names: tuple[str, ...]
    period: float | None

    def of(self, solution: Solution) -> dict[str, Any]:
        """Return the readings of a run; a reading is None if the run failed, or if the model lacks its quantity."""
        found: dict[str, Any] = dict.fromkeys(self.names)
        if solution.success:
            run = OverRun(solution) if self.period is None else MeasuredPeriod(solution, self.period)
            for name in self.names:
                try:
                    measure = named_measure(name, solution.model, _options(self.period))
                    found |= measure.read(run)  # type: ignore[arg-type]  # of this kind of measure
                except UsageError:  # a law without stick, or without this state
                    continue
        return found


def law_readings(measure: Any, models: Iterable[Model], period: float | None) -> LawReadings:
    """Return the readings with the given names; each name must be valid for at least one model."""
    if measure is None:
        return LawReadings((), period)
    names = (measure,) if isinstance(measure, str) else tuple(measure) if is_row(measure) else ()
    if not names or not all(isinstance(name, str) for name in names):
        remedy = "use the name of a reading, such as 'amplitude.x', or a list of names"
        raise cannot_be("measure", measure, remedy)
    found: dict[str, None] = {}
    for name in names:
        if period is not None and name.partition(".")[0] in OF_RUNS:
            message = (
                f"`measure` {name!r} belongs to a whole run, but this model is measured over its last period"
            )
            raise UsageError(
                message, remedy="use a measure of one period, such as 'amplitude.x' or 'stops_per_period.f'"
            )
        found |= dict.fromkeys(_first_valid(name, models, period))
    return LawReadings(tuple(found), period)


def _first_valid(name: str, models: Iterable[Model], period: float | None) -> tuple[str, ...]:
    """Return the reading names of a measure, according to the first model that supports it."""
    faults = []
    for model in models:
        try:
            return named_measure(name, model, _options(period)).reading_names
        except UsageError as fault:
            faults.append(fault)
    raise faults[0]


def _options(period: float | None) -> dict[str, Any]:
    return {"t_span": None} if period is None else {"after": 1}
