"""This module computes the residuals of a fit, and their derivatives with respect to the unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hybridsim.analysis.fit.derivative_costs import DerivativeCosts
from hybridsim.analysis.fit.effort import Effort
from hybridsim.analysis.fit.record import Record
from hybridsim.analysis.fit.slopes_of_run import NoDerivative, slopes_of_run
from hybridsim.analysis.fit.unknown import Unknown, start_of
from hybridsim.analysis.time_budget import Stopwatch
from hybridsim.errors import ModelError
from hybridsim.model import Model
from hybridsim.simulate import simulate
from hybridsim.solution import Solution

_STEP = 1e-4  # of an unknown's size: difference quotients have errors of about 1e-8, and of 1e4 times rtol
_OF_BOUNDS = 1e-3  # smallest size of an unknown, relative to the distance of its bounds
_COARSE = 2e-2  # the same, to move jumps over samples
_JUMP = 1e-6  # of a quantity's deviation: smaller differences of the sides of an event are no jump


@dataclass(frozen=True)
class _Point:
    """The runs of all records for one choice of the coordinates, and the simulated sample values (m,).

    A run is None if the model is wrong with these coordinates.
    """

    runs: list[Solution | None]
    values: np.ndarray


class Residuals:
    """The differences between measured and simulated quantities of all records, as a function of the unknowns.

    Parameters
    ----------
    model, records, unknowns : as in `fit`, checked.
    settings : options of `simulate`.
    effort : counts the runs. By default there is a new one without reports.
    """

    def __init__(
        self,
        model: Model,
        records: tuple[Record, ...],
        unknowns: Mapping[str, Unknown],
        settings: Mapping[str, Any],
        effort: Effort | None = None,
    ) -> None:
        self.model, self.records, self.unknowns, self._settings = model, records, unknowns, dict(settings)
        self._starts = {start_of(s.name): s.name for s in model.states}
        self._effort = effort or Effort(reports=False)
        self.without: dict[int, str] = {}  # numbers of the records without exact derivatives, and the reasons
        self._costs = [DerivativeCosts() for _ in records]
        self._points: dict[
            bytes, _Point
        ] = {}  # by coordinates: the latest point, and the one of the latest slopes
        self._slopes: tuple[bytes, bool, np.ndarray] | None = None  # coordinates, `is_coarse`, derivatives
        self.failure = ""  # why the last run did not reach the end of its record
        self.present = [np.isfinite(values) for record in records for values in record.columns.values()]
        counts = [sum(int(np.isfinite(v).sum()) for v in record.columns.values()) for record in records]
        self._rows = np.cumsum([0, *counts])  # first sample of each record, and their number
        self.measured = np.concatenate(
            [values[np.isfinite(values)] for record in records for values in record.columns.values()]
        )
        self.quantity = np.concatenate(
            [np.full(np.isfinite(v).sum(), name) for record in records for name, v in record.columns.items()]
        )
        self._scale = np.array([self._size(name, unknown) for name, unknown in unknowns.items()])

    def _size(self, name: str, unknown: Unknown) -> float:
        """Return the scale of an unknown: its guess or a fraction of its range, or 1 if both are zero."""
        if unknown.log:
            return 1.0
        guess = abs(unknown.guess or 0.0)
        spread = unknown.high - unknown.low if unknown.is_bounded else 0.0
        return max(guess, _OF_BOUNDS * spread) or 1.0

    @property
    def runs(self) -> int:
        """Number of simulations."""
        return self._effort.runs

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the measured quantities."""
        return tuple(dict.fromkeys(str(name) for name in self.quantity))

    @property
    def sizes(self) -> np.ndarray:
        """Sizes (n,) of the coordinates of the unknowns."""
        return self._scale

    def values(self, coordinates: np.ndarray) -> dict[str, float]:
        """Return the values of the unknowns by name."""
        pairs = zip(self.unknowns.items(), coordinates, strict=True)
        return {name: unknown.value(coordinate) for (name, unknown), coordinate in pairs}

    def solution(self, record: Record, values: Mapping[str, float]) -> Solution:
        """Simulate the experiment of a record with the given values of the unknowns."""
        self._effort.add_run()
        starts = {self._starts[name]: value for name, value in values.items() if name in self._starts}
        params = {name: value for name, value in values.items() if name not in self._starts}
        begin = record.t[0] if record.t0 is None else record.t0
        return simulate(
            self.model,
            (float(begin), float(record.t[-1])),
            params={**record.params, **params},
            x0={**record.x0, **starts},
            **self._settings,
        )

    def predicted(self, coordinates: np.ndarray) -> np.ndarray:
        """Return the simulated value (m,) of each sample.

        It is NaN after the end of a run that stopped early, and NaN if the model is wrong with these coordinates.
        """
        return self._point(coordinates).values

    def _point(self, coordinates: np.ndarray) -> _Point:
        """Simulate all records with the given coordinates, unless the last call had the same coordinates."""
        key = coordinates.tobytes()
        if key not in self._points:
            of_slopes = self._slopes[0] if self._slopes is not None else b""
            self._points = {each: point for each, point in self._points.items() if each == of_slopes}
            values = self.values(coordinates)
            runs = [self._timed_run(number, values) for number in range(len(self.records))]
            samples = [self._samples(record, run) for record, run in zip(self.records, runs, strict=True)]
            self._points[key] = _Point(runs, np.concatenate(samples))
        return self._points[key]

    def _timed_run(self, number: int, values: Mapping[str, float]) -> Solution | None:
        """Simulate the record with the given number and note the time; return None if the model is invalid.

        With some values between the bounds a model may be wrong, such as with a limit of stick below the slip force.
        """
        watch = Stopwatch()
        try:
            solution = self.solution(self.records[number], values)
        except ModelError as error:
            self.failure = str(error)
            return None
        self._costs[number].add_run(watch.seconds)
        return solution

    def _samples(self, record: Record, solution: Solution | None) -> np.ndarray:
        """Return the simulated values (m,) of the samples of one record."""
        reached, found = np.full(len(record.t), False), []
        if solution is not None:
            reached = record.t <= solution.t_end
            if not reached.all():
                self.failure = solution.message
        for name, measured in record.columns.items():
            column = np.full(len(record.t), np.nan)
            if solution is not None:
                column[reached] = solution.output(name, record.t[reached])
            found.append(column[np.isfinite(measured)])
        return np.concatenate(found)

    def has_jumps(self, coordinates: np.ndarray) -> bool:
        """Return whether a measured quantity jumps in a run, as a friction force does."""
        for record, solution in zip(self.records, self._point(coordinates).runs, strict=True):
            if solution is None:
                continue
            times = np.unique([event.t for event in solution.events])
            for name in record.columns if len(times) else ():
                jumps = np.abs(solution.output(name, times, "+") - solution.output(name, times, "-"))
                if jumps.max() > _JUMP * float(np.std(self.measured[self.quantity == name])):
                    return True
        return False

    def slopes(self, coordinates: np.ndarray, is_coarse: bool = False) -> np.ndarray:
        """Return the derivatives (m, n) of the m simulated values with respect to the n coordinates of the fit.

        They are those of the runs. A record whose run has none gets central differences.

        is_coarse : whether to use coarse differences, which include jumps. Their mean over neighbouring samples shows
            how the jumps move.
        """
        key = coordinates.tobytes()
        if self._slopes is not None and self._slopes[:2] == (key, is_coarse):
            return self._slopes[2]
        point = self._point(coordinates)
        if not is_coarse:
            self.without = {}
        parts = []
        for number, (begin, end) in enumerate(pairwise(self._rows)):
            part = None if is_coarse else self._exact(coordinates, number)
            if part is None:
                part = self._differences(coordinates, number, point.values[begin:end], is_coarse)
            parts.append(part)
        found = np.concatenate(parts)
        self._slopes = key, is_coarse, found
        return found

    def _exact(self, coordinates: np.ndarray, number: int) -> np.ndarray | None:
        """Return the derivatives (m, n) of the samples of one record, or None if there are none."""
        record, values, costs = self.records[number], self.values(coordinates), self._costs[number]
        solution = self._point(coordinates).runs[number]
        if solution is None:
            return None
        present = {name: np.isfinite(measured) for name, measured in record.columns.items()}
        if not costs.is_exact_cheaper(solution, len(values), lambda: self._timed_run(number, values)):
            self.without[number] = "they take less time"
            return None
        watch = Stopwatch()
        try:
            found = slopes_of_run(solution, record, list(values), present)
        except NoDerivative as reason:
            self.without[number] = str(reason)
            return None
        costs.add_exact(watch.seconds)
        units = [values[name] if unknown.log else 1.0 for name, unknown in self.unknowns.items()]
        return found * np.array(units)

    def _differences(
        self, coordinates: np.ndarray, number: int, base: np.ndarray, is_coarse: bool
    ) -> np.ndarray:
        """Return the derivatives (m, n) of the samples of one record by central differences.

        A sample that a jump of its quantity passes on one side has the difference of the other side.
        """
        record, found = self.records[number], np.empty((len(base), len(coordinates)))
        for k, unknown in enumerate(self.unknowns.values()):
            low, high = unknown.coordinate_bounds
            size = self._scale[k] if unknown.log else max(self._scale[k], abs(coordinates[k]))
            step = min((_COARSE if is_coarse else _STEP) * size, 0.25 * (high - low))
            one_sided = []
            for move in (step, -step):
                moved = coordinates.copy()
                moved[k] += move
                if low <= moved[k] <= high:
                    run = self._timed_run(number, self.values(moved))
                    one_sided.append((self._samples(record, run) - base) / move)
            found[:, k] = _central(one_sided, is_coarse)
        return found

    @property
    def derivatives(self) -> str:
        """Text that states whether derivatives were exact, and the reason if they were not."""
        if not self.without:
            return "exact"
        reason = next(iter(self.without.values()))
        if len(self.without) == len(self.records):
            return f"central differences, because {reason}"
        listed = ", ".join(str(number) for number in self.without)
        return f"exact, and central differences for the records {listed}, because {reason}"


def _central(one_sided: list[np.ndarray], is_coarse: bool) -> np.ndarray:
    """Combine derivatives from both sides: return their mean, or the smaller one if they differ much."""
    one_sided = [each for each in one_sided if np.isfinite(each).all()] or [
        np.full_like(one_sided[0], np.nan)
    ]
    if len(one_sided) == 1:
        return one_sided[0]
    up, down = one_sided
    if is_coarse:
        return 0.5 * (up + down)
    differ = np.abs(up - down) > 0.5 * (np.abs(up) + np.abs(down))
    return np.where(differ, np.where(np.abs(up) < np.abs(down), up, down), 0.5 * (up + down))
