"""This module lists the times known in advance: schedules, clock ticks, knots of inputs, the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hybridsim.expr import evaluate
from hybridsim.model import Model
from hybridsim.model.parts.schedule import Schedule
from hybridsim.reference.multiple_precision.precision import Number, Precision
from hybridsim.reference.multiple_precision.signals import Signal

# Times are declared as doubles. 0.1*3 and 0.3 differ by one unit in the last place but are one instant.
_SAME = 2.0**-51


@dataclass(frozen=True)
class Appointment:
    """A time at which a step must end, with the numbers of the schedules that are due."""

    t: Number
    schedules: tuple[int, ...]


class Appointments:
    """The scheduled times of one run over (t0, t1]; the first time of a schedule may be t0."""

    def __init__(
        self, model: Model, signals: Sequence[Signal], precision: Precision, t0: Number, t1: Number
    ) -> None:
        self._signals, self._t1 = signals, t1
        values = model.parameter_values()
        self._clocks = [_Clock(schedule, values, precision) for schedule in model.schedules]
        self.due_at_start = tuple(
            k for k, clock in enumerate(self._clocks) for _ in range(clock.times_at(0, t0))
        )
        for clock in self._clocks:
            while (time := clock.next) is not None and (time < t0 or _same(time, t0)):
                clock.count += 1

    def next(self, t: Number) -> Appointment:
        """Return the next scheduled time after t, or the end of the run if no time is left."""
        ahead = [(time, k) for k, clock in enumerate(self._clocks) if (time := clock.next) is not None]
        nearest = min((time for time, _ in ahead), default=self._t1)
        knots = [knot for signal in self._signals if (knot := signal.next_knot(t)) is not None]
        if knots and min(knots) < nearest and not _same(min(knots), nearest):
            nearest = min(knots)
        if nearest > self._t1 or _same(nearest, self._t1):
            nearest = self._t1
        due = tuple(
            k for _, k in ahead for _ in range(self._clocks[k].times_at(self._clocks[k].count, nearest))
        )
        return Appointment(nearest, due)

    def mark_done(self, appointment: Appointment) -> None:
        """Mark the schedules that are due at a time as done."""
        for k in appointment.schedules:
            self._clocks[k].count += 1


class _Clock:
    """The times of one schedule, and how many of these times have passed."""

    def __init__(self, schedule: Schedule, values: dict[str, float], precision: Precision) -> None:
        self._times = sorted(precision.number(evaluate(time, values)) for time in schedule.times)
        self._start = precision.number(evaluate(schedule.start, values) if schedule.start else 0)
        self._period = precision.number(evaluate(schedule.period, values)) if schedule.period else None
        self._most = len(self._times) if self._times else schedule.count
        if not self._times and self._period is None:
            self._most = 1
        self.count = 0

    def time(self, k: int) -> Number | None:
        """Return the k-th time of the schedule, or None."""
        if self._most is not None and k >= self._most:
            return None
        if self._times:
            return self._times[k]
        return self._start if self._period is None else self._start + k * self._period

    def times_at(self, k: int, t: Number) -> int:
        """Return how many consecutive times of the schedule, from the k-th on, are equal to t."""
        count = 0
        while (time := self.time(k + count)) is not None and _same(time, t):
            count += 1
        return count

    @property
    def next(self) -> Number | None:
        return self.time(self.count)


def _same(a: Number, b: Number) -> bool:
    return bool(abs(a - b) <= _SAME * max(abs(a), abs(b)))
