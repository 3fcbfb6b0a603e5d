"""This module finds the events at known times: scheduled resets, clock ticks, knots of inputs."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

import numpy as np

from hybridsim.engine.system.instant import Instant, multiple, multiples
from hybridsim.engine.system.system import System
from hybridsim.expr import evaluate


@dataclass(frozen=True)
class Appointment:
    """A scheduled time that a step must reach exactly, and the schedules that are due at this time.

    A schedule that lists this time several times occurs as often. At a renewal only the local time is restarted.
    first: the nearest of the times that are merged here, if it is another one than the instant.
    """

    instant: Instant
    schedules: tuple[int, ...]
    is_renewal: bool = False
    first: Instant | None = None


class Timetable:
    """The scheduled times of one run that ends at a given instant.

    has_end: whether the end is an appointment as well, as for a run in steps.
    """

    def __init__(self, system: System, end: Instant, has_end: bool = False) -> None:
        self._end = end
        self.step_end = Appointment(end, ()) if has_end else None
        self.settled: Instant | None = None  # last completed appointment, or the start of the run
        values = system.values
        self._signals = system.signals
        self._schedules = []
        for schedule in system.model.schedules:
            times = sorted(Instant(float(evaluate(t, values))) for t in schedule.times)
            start = evaluate(schedule.start, values) if schedule.start is not None else 0.0
            period = evaluate(schedule.period, values) if schedule.period is not None else 0.0
            count = 1 if schedule.start is not None and schedule.period is None else schedule.count
            self._schedules.append((times, start, period, count))

    def mark_done(self, done: Instant | Appointment) -> None:
        """Mark an instant as done, so that times within rounding of it are not due again.

        An instant within rounding of the last one changes nothing, because times were merged with the last one.
        """
        if isinstance(done, Appointment):
            self.settled = done.first or done.instant
        elif not self._is_settled(done):
            self.settled = done

    def due_at_start(self, start: Instant) -> tuple[int, ...]:
        """Return the schedules that are due at the start of the run, such as a clock with zero offset."""
        return tuple(
            k
            for k in range(len(self._schedules))
            if (first := self._first(k)) is not None and self._are_equal(first, start)
            for _ in range(self._count(k, start))
        )

    def next(self, after: Instant, forward: bool) -> Appointment | None:
        """Return the nearest scheduled time after an instant; times equal within rounding are merged.

        Two clocks with rounded periods may differ by two ulps at a common time. The last time may coincide with the end
        of the run in the same way. The result is None if no time is left before the end.
        """
        found: list[tuple[Instant, int]] = []
        for k in range(len(self._schedules)):
            time = self._next(k, after, forward)
            if time is not None:
                found.append((time, k))
        for signal in self._signals:
            knot = signal.next_knot(after, forward)
            if knot is not None:
                found.append((knot, -1))
        if not found:
            return self.step_end
        nearest = min(found, key=lambda f: abs(f[0].minus(after)))[0]
        together = [(time, k) for time, k in found if self._are_equal(time, nearest)]
        latest = max((time for time, _ in together), key=lambda t: abs(t.minus(after)))
        if self._are_equal(self._end, nearest):
            latest = self._end
        elif (self._end.minus(nearest) < 0.0) == forward:
            return self.step_end
        due = sorted(k for _, k in together if k >= 0)
        return Appointment(
            latest, tuple(k for k in due for _ in range(self._count(k, nearest))), first=nearest
        )

    def ahead(self, k: int, after: Instant, most: int) -> np.ndarray:
        """Return at most `most` times (m, 2) of a schedule after an instant; times that occur twice are repeated."""
        times, start, period, count = self._schedules[k]
        if times:
            first = bisect_right(times, after)
            return np.array(times[first : first + most]).reshape(-1, 2)
        if period == 0.0:
            found = np.array([[start, 0.0]])
        else:
            near = max(math.floor((float(after) - start) / period) - 1, 0)
            end = near + most + 3 if count is None else min(near + most + 3, count)
            found = multiples(start, np.arange(near, end), period)
        return found[(found[:, 0] - after.high) + (found[:, 1] - after.low) > 0.0][:most]

    def slacks(self, near: np.ndarray) -> np.ndarray:
        """Return the rounding errors of scheduled times near the given times."""
        largest = max((abs(start) for _, start, _, _ in self._schedules), default=0.0)
        return np.asarray(2.0 * np.spacing(np.maximum(np.abs(near), largest)))

    def _count(self, k: int, instant: Instant) -> int:
        """Return how many pending times of a schedule equal an instant within rounding, or 1 for a clock."""
        times, wide = self._schedules[k][0], 2.0 * self._slack(instant)
        if not times:
            return 1
        first, last = bisect_left(times, instant.plus(-wide)), bisect_right(times, instant.plus(wide))
        return sum(
            self._are_equal(time, instant) and not self._is_settled(time) for time in times[first:last]
        )

    def _slack(self, near: Instant) -> float:
        """Return the rounding error of scheduled times near an instant."""
        return 2.0 * math.ulp(max(abs(near.high), *(abs(start) for _, start, _, _ in self._schedules), 0.0))

    def _first(self, k: int) -> Instant | None:
        times, start, _period, _ = self._schedules[k]
        return times[0] if times else Instant(start)

    def _next(self, k: int, after: Instant, forward: bool) -> Instant | None:
        times, start, period, count = self._schedules[k]
        if times:  # bisection, because a list may be long
            index, step = (bisect_right(times, after), 1) if forward else (bisect_left(times, after) - 1, -1)
            while 0 <= index < len(times):
                if not self._is_settled(times[index]):
                    return times[index]
                index += step
            return None
        last = math.inf if count is None else count - 1
        near = 0 if period == 0.0 else math.floor((float(after) - start) / period)
        ticks = range(int(max(min(near - 1, last), 0)), int(min(max(near, 0) + 3, last)) + 1)
        candidates = [multiple(start, i, period) for i in ticks]
        ahead = [c for c in candidates if (c.minus(after) > 0.0 if forward else c.minus(after) < 0.0)]
        ahead = [c for c in ahead if not self._is_settled(c)]
        return None if not ahead else (ahead[0] if forward else ahead[-1])

    def _is_settled(self, instant: Instant) -> bool:
        """Return whether an instant is within rounding of the last completed scheduled time."""
        return self.settled is not None and self._are_equal(instant, self.settled)

    def _are_equal(self, one: Instant, other: Instant) -> bool:
        """Return whether two instants differ by no more than the larger of their two rounding errors."""
        return abs(one.minus(other)) <= max(self._slack(one), self._slack(other))
