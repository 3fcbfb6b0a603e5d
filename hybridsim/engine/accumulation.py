"""Accumulation: events that follow each other ever faster, like the terms of a geometric series.

The events of one turn may be several, at distances of their own: a motion between two relays passes one, then the
other. So each interval is held against the one a few before it.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

import numpy as np

from hybridsim.engine.checkpoint import Pace
from hybridsim.engine.jit import kernel
from hybridsim.engine.system import Automaton
from hybridsim.engine.timepair import Instant

# So many intervals in a row must shrink by one factor before they count as a series: a transient does not.
_TERMS = 10
_MOST = 4  # events of one turn: two relays on either of their sides
_AHEAD = 16.0  # times its last intervals a series under way is looked ahead in
_FEW = 2  # intervals more than two turns after which one may be on its way
# How well the factor must repeat; a bouncing ball's does to rounding, a friction oscillator's decay does not.
SAME_FACTOR = 1e-3
# A series that has shrunk by so much may come to where rounding hides its events, and end in a stutter of them.
_FAR_DOWN = 1e-6
# Events closer than this many ulps of the time, so many in a row, are one, whatever their factor.
_ULPS = 16.0
# A series with so few ulps of the time to go has come to its end: states that rounding moves decide what follows.
_END = 1024.0


@kernel
def longest_fall(gaps: Any, high: float, low: float, instants: Any, shortest: float, work: Any) -> int:
    """How many times in a row an interval is shorter than the one a turn before it, or next to nothing.

    gaps (k,): intervals up to the instant (high, low), after which the instants (E, 2) follow. work (2, events of a
    turn at most) is written to.
    """
    longest, known = 0.0, gaps.shape[0]
    before, falls = work[0], work[1]  # the last intervals; falls in a row, for turns of 1, 2, ... events
    before[:], falls[:] = math.inf, 0.0
    for i in range(known + instants.shape[0]):
        if i < known:
            gap = gaps[i]
        else:
            gap = abs((instants[i - known, 0] - high) + (instants[i - known, 1] - low))
            high, low = instants[i - known, 0], instants[i - known, 1]
        is_nothing = gap <= max(shortest, _ULPS * 2.0**-52 * abs(high))
        for turn in range(min(i + 1, _MOST)):
            is_shorter = gap < (1.0 - 0.5 * SAME_FACTOR) * before[(i - turn - 1) % _MOST]
            falls[turn] = falls[turn] + 1.0 if is_shorter or is_nothing else 0.0
            longest = max(longest, falls[turn])
        before[i % _MOST] = gap
    return int(longest)


def turn_of(gaps: list[float], count: int, same: float) -> tuple[int, float]:
    """Events of a turn, and the factor by which the last `count` intervals and a turn's shrink; (0, 1) if they do not.

    same : how well the factor must repeat.
    """
    for turn in range(1, _MOST + 1):
        terms = count + turn - 1  # of every event of the turn
        if len(gaps) < terms + turn:
            break
        if not gaps[-1] < gaps[-1 - turn] * (1.0 - SAME_FACTOR):
            continue
        factor = gaps[-1] / gaps[-1 - turn]
        pairs = zip(gaps[-terms:], gaps[-terms - turn : -turn], strict=True)
        if all(abs(b - factor * a) <= same * factor * a for b, a in pairs):
            return turn, factor
    return 0, 1.0


class Accumulation:
    """Watches the intervals between events of one run."""

    def __init__(self, resolution: float = 0.0, shortest: float = 0.0) -> None:
        # a rest of the series shorter than this is the end of it, whatever rounding says
        self.resolution = resolution
        self.shortest = shortest  # what the method can tell apart; events that close, many in a row, are one
        self.last: Instant | None = None
        self.intervals: deque[float] = deque(maxlen=_TERMS + 2 * _MOST)
        self.longest = 0.0  # interval since which they shrink
        self.forecast: tuple[float, float] | None = (
            None  # limit of the series so far, and how far ahead it was
        )

    def is_under_way(self) -> bool:
        """Whether the last intervals shrink by one factor: what comes is to be watched event by event."""
        return turn_of(list(self.intervals), _FEW + 1, 2.0 * SAME_FACTOR)[0] > 0

    def reach(self) -> float:
        """How far ahead to look: what comes in a series under way is not judged by the roundings of a long run."""
        return _AHEAD * max(list(self.intervals)[-_MOST:]) if self.is_under_way() else math.inf

    def last_intervals(self, count: int) -> float:
        """What the last intervals add up to."""
        return sum(list(self.intervals)[-count:])

    def pace(self) -> Pace:
        """What is known so far."""
        return Pace(self.last, tuple(self.intervals), self.longest, self.forecast)

    def go_on(self, pace: Pace) -> None:
        """Take up what was known."""
        self.last, intervals, self.longest, self.forecast = pace
        self.intervals.clear()
        self.intervals.extend(intervals)

    def begin_anew(self) -> None:
        """Forget the intervals: what came before has been dealt with."""
        self.last, self.longest, self.forecast = None, 0.0, None
        self.intervals.clear()

    def limit_of_all(self, instants: np.ndarray) -> float | None:
        """Note events (E, 2) in a row; the limit time as soon as there is one, else None."""
        if len(instants) <= _TERMS + 2 * _MOST + 1:
            return self._one_by_one(instants)
        if self.last is None:
            self.last, instants = Instant(*instants[0].tolist()), instants[1:]
        gaps, work = np.array(self.intervals), np.empty((2, _MOST))
        if longest_fall(gaps, self.last.high, self.last.low, instants, self.shortest, work) >= _TERMS:
            return self._one_by_one(instants)  # worth a closer look
        tail = instants[-_TERMS - 2 * _MOST - 1 :]
        steps = tail[1:] - tail[:-1]
        self.intervals.extend(np.abs(steps[:, 0] + steps[:, 1]).tolist())
        self.last = Instant(*instants[-1].tolist())
        return None

    def _one_by_one(self, instants: np.ndarray) -> float | None:
        for high, low in instants.tolist():
            limit = self.limit(Instant(high, low))
            if limit is not None:
                return limit
        return None

    def limit(self, instant: Instant) -> float | None:
        """Note an event; the limit time once the rest of the series is below the resolution, else None."""
        if self.last is not None:
            self.intervals.append(abs(instant.minus(self.last)))
        self.last = instant
        gaps = list(self.intervals)
        if len(gaps) <= _TERMS:
            return None
        if max(gaps[-_TERMS - 1 :]) <= max(self.shortest, _ULPS * math.ulp(float(instant))):
            return float(instant)
        if min(gaps) <= 0.0:
            return None
        turn, factor = turn_of(gaps, _FEW + 1, 2.0 * SAME_FACTOR)
        if turn:
            self.longest = max(self.longest, *gaps)
            rest = sum(gaps[-turn:]) * factor / (1.0 - factor)
            self.forecast = (float(float(instant) + rest), rest)
            is_steady = turn_of(gaps, _TERMS, SAME_FACTOR)[0] > 0
            end = max(self.resolution, _END * math.ulp(float(instant)))
            return self.forecast[0] if is_steady and rest <= end else None
        self.longest = max(gaps) if gaps[-1] >= gaps[-2] else max(self.longest, *gaps)
        is_far = self.forecast is not None and self.forecast[1] <= _FAR_DOWN * self.longest
        limit = self.expected(instant) if is_far else None
        self.forecast = None
        return limit

    def expected(self, instant: Instant) -> float | None:
        """The limit of the series so far, where an instant that is not in step with it lies within its rest."""
        if self.forecast is None:
            return None
        limit, rest = self.forecast
        return limit if abs(float(instant) - limit) <= rest else None


def accumulated(limit: float, changed: list[Automaton]) -> str:
    """What a run says that ends where events of these components accumulate."""
    names = ", ".join(dict.fromkeys(a.name for a in changed))
    holding = [f"{a.name}.{a.modes[a.resting]}" for a in changed if a.resting >= 0]
    if not holding:
        return (
            f"events accumulate at t = {limit!r}, of {names}: declare the limit that they lead to, a mode of their "
            "component"
        )
    modes = " and ".join(dict.fromkeys(holding))
    return (
        f"events accumulate at t = {limit!r}, of {names}, and {modes} cannot be entered there: take a smaller rtol or "
        "another integrator, or let a monitor end the run before"
    )
