"""Detect accumulation: events whose intervals shrink like the terms of a geometric series.

Each component has its own series. One turn may have several events at different distances: a motion between two relays
crosses each of them from both sides. Each interval is therefore compared with the one a few events before it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.record.checkpoint import BEGINNING, Pace
from hybridsim.engine.system.automaton import Automaton
from hybridsim.engine.system.instant import Instant

# Number of consecutive intervals that must shrink by one factor before they count as a series, unlike a transient.
_TERMS = 10
MAX_EVENTS_PER_TURN = 4  # largest number of events in one turn
_MAX_TRACKED_COMPONENTS = 32  # largest number of components whose events are all tracked
NOBODY = -1  # component of events without one, such as resets of monitors
_STORED_INTERVALS = _TERMS + 2 * MAX_EVENTS_PER_TURN  # number of stored intervals
_LOOK_AHEAD_INTERVALS = 16.0  # look-ahead in a series, in units of its last intervals
_TERMS_BEYOND_TURNS = 2  # intervals beyond two turns after which a series may have begun
# Relative accuracy with which the factor must repeat. A bouncing ball repeats it within rounding; the decay of a
# friction oscillator does not.
SAME_FACTOR = 1e-3
# A series with a factor closer to 1 may be a motion that settles, such as an oscillation at resonance.
CLOSING_IN = 0.995
# After shrinking by this factor, rounding may hide the events of a series.
_FAR_DOWN = 1e-6
# Many consecutive events closer than this many ulps of the time count as one, whatever their factor.
_ULPS = 16.0
# A series with this many ulps of the time left has ended, because rounding errors of the states decide what follows.
_END = 1024.0
_NO_INTERVALS = np.empty(0)


@inlined
def _follow(
    gap: float, now: float, i: int, known: int, longest: float, shortest: float, resolution: float, work: Any
) -> bool:
    """Process interval `i` between events; return whether shrinking intervals may have reached their limit."""
    before, falls, ended = work[0], work[1], False
    is_nothing = gap <= max(shortest, _ULPS * 2.0**-52 * abs(now))
    end = max(resolution, _END * 2.0**-52 * abs(now), _FAR_DOWN * longest)
    for turn in range(min(i + 1, MAX_EVENTS_PER_TURN)):
        earlier = before[(i - turn - 1) % MAX_EVENTS_PER_TURN]
        is_shorter = gap < (1.0 - 0.5 * SAME_FACTOR) * earlier
        falls[turn] = falls[turn] + 1.0 if is_shorter or is_nothing else 0.0
        if falls[turn] >= _TERMS and i >= known:
            ended = ended or is_nothing or gap * gap <= end * (earlier - gap)
    before[i % MAX_EVENTS_PER_TURN] = gap
    return ended


@inlined
def _is_shrinking(work: Any) -> bool:
    """Return whether the last intervals between events form a shrinking series."""
    for turn in range(MAX_EVENTS_PER_TURN):
        if work[1, turn] >= _TERMS:
            return True
    return False


@kernel
def may_end(
    gaps: Any,
    at: Any,
    is_begun: bool,
    instants: Any,
    owners: Any,
    component: int,
    shortest: float,
    resolution: float,
    work: Any,
    last: Any,
) -> tuple[bool, int]:
    """Return whether a component's intervals still shrink or may have reached their limit, and how many there are.

    In a series an interval is shorter than the one a turn before it, or negligible, many times in a row. The series has
    not ended while the next interval, predicted by the last factor, exceeds the threshold.

    gaps (k,): intervals up to the instant in `at` (2,), if is_begun. They are followed by those of the instants (E, 2)
    whose owner (E,) is the component; `at` becomes the last instant. work (2, largest number of events in a turn):
    scratch. last (m,): receives the last intervals, number i at index i % m.
    """
    longest, known, ended, i = 0.0, gaps.shape[0], False, 0
    high, low = at[0], at[1]
    # the last intervals, and the consecutive decreases for turns of 1, 2, ... events
    work[0, :], work[1, :] = math.inf, 0.0
    for e in range(-known, instants.shape[0]):
        if e < 0:
            gap = gaps[e + known]
        elif owners[e] != component:
            continue
        else:
            gap = abs((instants[e, 0] - high) + (instants[e, 1] - low))
            high, low = instants[e, 0], instants[e, 1]
            if not is_begun:
                is_begun = True
                continue
        longest = max(longest, gap)
        ended = _follow(gap, high, i, known, longest, shortest, resolution, work) or ended
        last[i % last.shape[0]] = gap
        i += 1
    at[0], at[1] = high, low
    return ended or _is_shrinking(work), i


@kernel
def cannot_accumulate(instants: Any, fires: Any, owner: Any, components: int, work: Any) -> bool:
    """Return whether the first events of a run, at instants (E, 2), certainly do not accumulate.

    fires (E,): the guards that fired; owner: the component of each guard. work (2, largest number of events in a turn):
    scratch. If the result is False, `Accumulation.limit_of_all` decides.
    """
    count = instants.shape[0]
    if count <= _TERMS:  # too few for a series
        return True
    if count <= _STORED_INTERVALS + 1 or components > _MAX_TRACKED_COMPONENTS:
        return False
    for c in range(components):
        work[0, :], work[1, :] = math.inf, 0.0
        longest, i, last = 0.0, -1, 0
        for e in range(count):
            if owner[fires[e]] != c:
                continue
            if i >= 0:
                gap = abs((instants[e, 0] - instants[last, 0]) + (instants[e, 1] - instants[last, 1]))
                longest = max(longest, gap)
                if _follow(gap, instants[e, 0], i, 0, longest, 0.0, 0.0, work):
                    return False
            last, i = e, i + 1
        if _is_shrinking(work):
            return False
    return True


def turn_of(gaps: Sequence[float], count: int, same: float) -> tuple[int, float]:
    """Return the number of events per cycle, and the factor by which intervals shrink per cycle.

    same : relative accuracy with which the factor must repeat.
    """
    for turn in range(1, MAX_EVENTS_PER_TURN + 1):
        terms = count + turn - 1  # each event of the turn counts
        if len(gaps) < terms + turn:
            break
        if not gaps[-1] < gaps[-1 - turn] * (1.0 - SAME_FACTOR):
            continue
        factor = gaps[-1] / gaps[-1 - turn]
        pairs = zip(gaps[-terms:], gaps[-terms - turn : -turn], strict=True)
        if all(abs(b - factor * a) <= same * factor * a for b, a in pairs):
            return turn, factor
    return 0, 1.0


class Limit(NamedTuple):
    """The limit of accumulating events: its time and its components."""

    time: float
    components: tuple[int, ...]  # NOBODY for resets of monitors
    passed: float  # duration of the last events before the limit


class Accumulation:
    """Monitors the intervals between the events of one run, separately for each component."""

    def __init__(self, resolution: float = 0.0, shortest: float = 0.0, forward: bool = True) -> None:
        self._sign = 1.0 if forward else -1.0
        # a series whose rest is shorter than this has ended
        self.resolution = resolution
        # shortest interval that the method can resolve; many consecutive events that close count as one
        self.shortest = shortest
        self.paces: dict[int, Pace] = {}
        self._shrinking: set[int] = set()
        self._unjudged: set[int] = set()  # components whose series have not been judged yet

    @property
    def under_way(self) -> set[int]:
        """Return the components whose last intervals shrink by a common factor."""
        for c in self._unjudged:
            self._update_shrinking(c)
        self._unjudged.clear()
        return self._shrinking

    def is_under_way(self, now: float) -> bool:
        """Return whether the last intervals of a component shrink by a common factor."""
        for c in sorted(self.under_way):
            limit, rest = self._ahead(self.paces[c])
            if self._sign * (now - limit) > rest + _END * math.ulp(
                now
            ):  # the series has ended without a limit
                self.under_way.discard(c)
        return bool(self.under_way)

    def is_closing_in(self, now: float) -> bool:
        """Return whether the intervals shrink so fast that the events have to be resolved one by one."""
        return self.is_under_way(now) and any(
            _next_turn(self.paces[c])[1] < CLOSING_IN for c in self.under_way
        )

    def reach(self, now: float) -> float:
        """Return how long the next segment may be, so that rounding does not hide accumulating events."""
        if not self.is_under_way(now):
            return math.inf
        return min(
            _LOOK_AHEAD_INTERVALS * max(self.paces[c].intervals[-MAX_EVENTS_PER_TURN:])
            for c in self.under_way
        )

    def go_on(self, paces: dict[int, Pace]) -> None:
        """Restore the intervals from a checkpoint."""
        self.paces = dict(paces)
        self._shrinking, self._unjudged = set(), set(paces)

    def forget(self, components: tuple[int, ...]) -> None:
        """Discard the stored intervals of some components."""
        for c in components:
            self.paces.pop(c, None)
            self._shrinking.discard(c)
            self._unjudged.discard(c)

    def limit_of_all(self, instants: np.ndarray, owners: np.ndarray) -> Limit | None:
        """Add the times (E, 2) of events and their components (E,); return the first limit of events, or None."""
        count = len(instants)
        is_short = count <= _STORED_INTERVALS + 1  # a series there has forecasts, which need single events
        if count < 2 or (is_short and self.paces):
            return self._one_by_one(instants, owners)
        counts = np.bincount(owners).tolist()
        among = [c for c, events in enumerate(counts) if events]
        if len(among) > _MAX_TRACKED_COMPONENTS:  # a component with few of so many events is not near a limit
            among = [c for c in among if counts[c] > _TERMS]
            self.forget(tuple(set(self.paces).difference(among)))
        paces = []
        for component in among:
            may_have_ended, pace = self._paced(instants, owners, component)
            if may_have_ended or (is_short and _next_turn(pace)[0]):  # examine the events one by one
                selected = np.isin(owners, among)
                return self._one_by_one(instants[selected], owners[selected])
            paces.append((component, pace))
        self.paces.update(paces)
        self._unjudged.update([component for component, _ in paces])
        return None

    def _paced(self, instants: np.ndarray, owners: np.ndarray, component: int) -> tuple[bool, Pace]:
        """Return whether the events of a component may have reached their limit, and its updated intervals."""
        pace = self.paces.get(component, BEGINNING)
        known = np.array(pace.intervals) if pace.intervals else _NO_INTERVALS
        at = np.array(pace.last or (0.0, 0.0))
        work, last = np.empty((2, MAX_EVENTS_PER_TURN)), np.empty(_STORED_INTERVALS)
        ended, count = may_end(
            known, at, pace.last is not None, instants, owners, component, self.shortest, self.resolution, work, last
        )  # fmt: skip
        newest, oldest = last.tolist(), count % _STORED_INTERVALS
        intervals = newest[:count] if count <= _STORED_INTERVALS else newest[oldest:] + newest[:oldest]
        return ended, Pace(Instant(*at.tolist()), tuple(intervals), pace.longest)

    def _one_by_one(self, instants: np.ndarray, owners: np.ndarray) -> Limit | None:
        for (high, low), c in zip(instants.tolist(), owners.tolist(), strict=True):
            limit = self.limit(Instant(high, low), (c,))
            if limit is not None:
                return limit
        return None

    def limit(self, instant: Instant, components: tuple[int, ...]) -> Limit | None:
        """Add an event of some components; return the limit of accumulating events if this limit is close."""
        times = {c: self._limit_of(instant, c) for c in components}
        ended = [(self._sign * time, c) for c, time in times.items() if time is not None]
        return self._shared(self._sign * min(ended)[0], min(ended)[1]) if ended else None

    def expected(self, instant: Instant) -> Limit | None:
        """Return the limit of accumulating events if it is close to `instant`, the time of another event, else None."""
        for c in sorted(self.under_way):
            time = _expected(self.paces[c], instant)
            if time is not None:
                return self._shared(time, c)
        return None

    def _shared(self, time: float, first: int) -> Limit:
        """Return the limit of accumulation, with all components whose events accumulate there."""
        among = {first}
        for c in self.under_way:
            forecast = self.paces[c].forecast
            if forecast is not None and abs(forecast[0] - time) <= max(forecast[1], _END * math.ulp(time)):
                among.add(c)
        passed = max(sum(self.paces[c].intervals[-2:]) for c in among)
        return Limit(time, tuple(sorted(among)), passed)

    def _note(self, component: int, pace: Pace) -> None:
        self.paces[component] = pace
        self._unjudged.discard(component)
        self._update_shrinking(component)

    def _update_shrinking(self, component: int) -> None:
        if _next_turn(self.paces[component])[0]:
            self._shrinking.add(component)
        else:
            self._shrinking.discard(component)

    def _ahead(self, pace: Pace) -> tuple[float, float]:
        """Return the limit predicted by the last intervals, and its distance from the last event."""
        turn, factor = _next_turn(pace)
        rest = sum(pace.intervals[-turn:]) * factor / (1.0 - factor)
        assert pace.last is not None
        return float(pace.last) + self._sign * rest, rest

    def _limit_of(self, instant: Instant, component: int) -> float | None:
        before = self.paces.get(component, BEGINNING)
        gaps = before.intervals
        if before.last is not None:
            gaps = (*gaps, abs(instant.minus(before.last)))[-_STORED_INTERVALS:]
        pace = Pace(instant, gaps, before.longest)
        self._note(component, pace)
        if len(gaps) <= _TERMS:
            return None
        if max(gaps[-_TERMS - 1 :]) <= max(self.shortest, _ULPS * math.ulp(float(instant))):
            return float(instant)
        if min(gaps) <= 0.0:
            return None
        if component in self.under_way:
            limit, rest = self._ahead(pace)
            steadiest = _steadier(before, limit, math.ulp(limit))
            self.paces[component] = pace._replace(
                longest=max(before.longest, *gaps), forecast=(limit, rest), steadiest=steadiest
            )
            is_steady = turn_of(gaps, _TERMS, SAME_FACTOR)[0] > 0
            end = max(self.resolution, _END * math.ulp(float(instant)))
            return steadiest[2] if is_steady and rest <= end else None
        longest = max(gaps) if gaps[-1] >= gaps[-2] else max(before.longest, *gaps)
        self.paces[component] = pace._replace(longest=longest)
        is_far = before.forecast is not None and before.forecast[1] <= _FAR_DOWN * longest
        return _expected(before, instant) if is_far else None


def _next_turn(pace: Pace) -> tuple[int, float]:
    return turn_of(pace.intervals, _TERMS_BEYOND_TURNS + 1, 2.0 * SAME_FACTOR)


def _expected(pace: Pace, instant: Instant) -> float | None:
    """Return the limit of accumulating events if it is close to `instant`, the time of another event, else None."""
    if pace.forecast is None:
        return None
    limit, rest = pace.forecast
    if abs(float(instant) - limit) > rest:
        return None
    return pace.steadiest[2] if pace.steadiest else limit


def _steadier(before: Pace, limit: float, least: float) -> tuple[float, float, float]:
    """Return the forecast of the limit that changed least so far, with the last change and the least change.

    The first forecasts miss the deviation of the series from a geometric one. The last ones are dominated by rounding,
    unless the events are located at zero.
    """
    if before.forecast is None or before.steadiest is None:
        return math.inf, math.inf, limit
    moved = max(abs(limit - before.forecast[0]), least)
    last, least_so_far, best = before.steadiest
    spread = max(moved, last)
    return (moved, spread, limit) if spread <= least_so_far else (moved, least_so_far, best)


def accumulated(limit: Limit, automata: Sequence[Automaton], has_rtol: bool) -> str:
    """Return the message of a run that ends at accumulating events without a declared limit."""
    changed = [automata[c] for c in limit.components if c != NOBODY]
    names = ", ".join(a.name for a in changed) or "monitors with resets"
    holding = [f"{a.name}.{a.modes[a.limit_mode]}" for a in changed if a.limit_mode >= 0]
    head = f"infinitely many events of {names} accumulate at t = {limit.time:.9g}"
    if not changed:
        return f"{head}: let a monitor end the run before that time"
    if not holding:
        return f'{head}: declare the mode after this time, limit = "MODE" of the component'
    other = (
        "a smaller rtol or another integrator"
        if has_rtol
        else "a shorter step or an integrator of higher order"
    )
    return (
        f"{head}, and {' and '.join(holding)} cannot be entered there: use {other}, or let a monitor end "
        "the run before that time"
    )
