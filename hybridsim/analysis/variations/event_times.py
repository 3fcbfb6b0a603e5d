"""This module computes derivatives of event times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hybridsim.analysis.variations.changes import Changes, Place
from hybridsim.analysis.variations.rounds import component_of, guard_number
from hybridsim.analysis.variations.values.parameters import expression_slope
from hybridsim.engine.record.segments import Occurrence, Segment
from hybridsim.errors import UsageError
from hybridsim.expr import evaluate

_ALIKE = 1e-7  # relative; events at one instant are one event if the derivatives of their times agree


@dataclass(frozen=True)
class Shift:
    """Derivatives (M,) of a time, and the sizes (M,) of the terms that were summed."""

    values: np.ndarray
    sizes: np.ndarray


class EventTimes:
    """Computes derivatives of event times in M directions."""

    def __init__(self, changes: Changes) -> None:
        self.system, self._changes = changes.system, changes
        parameters = self.system.model.parameters
        self._slopes = {p.name: row for p, row in zip(parameters, changes.G, strict=False)}

    def of(
        self,
        segment: Segment,
        happened: Sequence[Occurrence],
        s: float,
        x: np.ndarray,
        Y: np.ndarray,
        Yd: np.ndarray,
    ) -> np.ndarray:
        """Return the derivatives (M,) of the time of the events that were located at local time `s`."""
        width = self._changes.G.shape[1]
        at = segment.origin.plus(s)
        knots = self._changes.vector.knots(at)
        if not happened and not knots:
            return np.zeros(width)
        shifts = [
            Shift(row, np.abs(row))
            for one in happened
            if one.kind == "scheduled"
            for row in self.scheduled(one)
        ]
        shifts += [Shift(row, np.abs(row)) for row in (knot @ self._changes.G for _, knot in knots)]
        for one in happened:
            if one.kind == "monitor" or one.guard:
                shift = self._located(segment, one, s, x, Y, Yd, is_first=not shifts)
                shifts += [] if shift is None else [shift]
        if not shifts:
            raise UsageError(
                f"component {happened[0].component} changes at t = {float(happened[0].instant):.9g} for an unknown "
                "reason, so the time of this change has no derivatives",
                remedy="use other parameters, or a run that ends before this time",
            )
        first = shifts[0]
        if any(
            (np.abs(shift.values - first.values) > _ALIKE * np.maximum(shift.sizes, first.sizes)).any()
            for shift in shifts
        ):
            raise UsageError(
                f"several events coincide at t = {float(at):.9g} "
                f"({', '.join(sorted({*(o.component for o in happened), *(name for name, _ in knots)}))}), but "
                "separate after a small change of the run, so there is no derivative",
                remedy="use other parameters, or a run that ends before this time",
            )
        return first.values

    def recorded(
        self, segment: Segment, one: Occurrence, s: float, x: np.ndarray, Y: np.ndarray, Yd: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives (M,) of a recorded monitor's time, or NaN if the monitor only touches zero."""
        shift = self._located(segment, one, s, x, Y, Yd, is_first=False)
        return np.full(self._changes.G.shape[1], np.nan) if shift is None else shift.values

    def _located(
        self,
        segment: Segment,
        one: Occurrence,
        s: float,
        x: np.ndarray,
        Y: np.ndarray,
        Yd: np.ndarray,
        is_first: bool,
    ) -> Shift | None:
        """Return the derivatives of the time of an event, or None if the event was caused by another event."""
        system = self.system
        is_monitor = one.kind == "monitor"
        if is_monitor:
            number = system.monitor_names.index(one.component)
        else:
            c, automaton = component_of(system, one)
            number = guard_number(system, one)
            if number < 0 or automaton.modes[segment.z[c]] != one.source:
                return None
        fixed = np.zeros(Y.shape[1])
        at = Place(s, float(segment.origin), x, segment.p, segment.z, Y, Yd, fixed, np.abs(Y))
        (found,) = self._changes.of(at, *(((), (number,)) if is_monitor else ((number,), ())))
        if not is_first and not found.is_near:
            return None
        rate = found.along(self.system.flow(s, x, segment.p, segment.z))
        if rate == 0.0:
            if not is_first:
                return None
            raise UsageError(
                f"{one.component} has an event at t = {float(one.instant):.9g} at which its guard does "
                "not decrease, so the time of the event has no derivatives",
                remedy="use other parameters, or a run that ends before this time",
            )
        return Shift(-found.by / rate, found.sizes / abs(rate))

    def scheduled(self, one: Occurrence) -> list[np.ndarray]:
        """Return the derivatives (M,) of each declared time that may have caused a scheduled event."""
        width = self._changes.G.shape[1]
        declared = next((c for c in self.system.model.schedules if c.name == one.component), None)
        if declared is None:
            return [np.zeros(width)]
        values, t = self.system.values, float(one.instant)
        if declared.start is None or declared.period is None:
            away = [abs(evaluate(e, values) - t) for e in declared.times]
            return [
                expression_slope(e, values, self._slopes, width)
                for e, gap in zip(declared.times, away, strict=True)
                if gap == min(away)
            ]
        k = round((t - evaluate(declared.start, values)) / evaluate(declared.period, values))
        by_start = expression_slope(declared.start, values, self._slopes, width)
        return [by_start + k * expression_slope(declared.period, values, self._slopes, width)]
