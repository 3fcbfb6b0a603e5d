"""This module follows a forced motion until its states repeat from period to period.

A run of plain periods is followed as long as the states change. If the sequence of events is the same in
consecutive periods, the period map is smooth there, and the states are extrapolated to their limit. The
extrapolation counts only if the following plain periods change the states less than those before it. It is taken back
otherwise, and also if no motion is possible from the extrapolated states.

A contact that slips less in each period, until its force only just reaches the limit, approaches its place like
1/k after k periods. There the change falls with the square of the distance, and the extrapolation has to go
twice as far in the direction of the change.

The motion has settled if plain periods approach a limit within the tolerance, or if their change is within the
tolerance and no extrapolation reduces it. If the motion was extrapolated, two further conditions hold. The plain
periods must approach it from the states before the first extrapolation; the numbers for this are those of `nearness`.
A small change must not grow, as `growth` decides. Otherwise the plain periods continue.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hybridsim.analysis.extrapolation.growth import grows
from hybridsim.analysis.extrapolation.limit import limit_of
from hybridsim.analysis.extrapolation.period_map import PeriodMap
from hybridsim.analysis.steady.approach import followed, is_near
from hybridsim.analysis.steady.motion import Point
from hybridsim.analysis.steady.settling import Passings, relative
from hybridsim.ensemble.nearness import CLOSE, LINEAR, MOST
from hybridsim.errors import SimulationError

_EVERY = 4  # periods between tests
_COUNTS = (4, 8, 16, 32, 64, 128)  # periods in an extrapolation
_FEWEST, _ENOUGH = 3, 16  # periods for an extrapolation, and to say that none would help
_GAIN = 0.1  # expected ratio of changes that makes an extrapolation worthwhile
_FARTHEST = 1e3  # of the scale: a limit further away is that of a state that drifts
_NEAR = 1.0  # the same if contacts slip after the extrapolation that did not slip before
_CLOSER = 0.5  # an extrapolation that does not reduce the change by this factor is taken back
_SQUARED = (0.1, 0.5)  # reduction of the change by an extrapolation that covers about half of the distance
_TWICE = 0.9  # additional length of the next extrapolation, which must not go beyond the limit
_HALF = 0.5  # of the distance remains then after an extrapolation; it is a third for an exact square
_NEARLY = 1e4  # multiple of the tolerance: below it, the motion may be about to repeat


class Settled(NamedTuple):
    """The result of a search for a repeating motion.

    Parameters
    ----------
    passings : the states at the last periods, with their scale.
    multiple : periods after which the states repeat, or None.
    rests : whether nothing moves.
    extrapolations : number of extrapolations.
    """

    passings: Passings
    multiple: int | None
    rests: bool
    extrapolations: int


class _Trial(NamedTuple):
    """The data before an extrapolation, which are restored if the extrapolation fails."""

    former: Any
    states: list[np.ndarray]
    pairs: list[tuple[np.ndarray, np.ndarray]]
    fresh: int
    slips: dict[tuple[int, int], int]
    events: bytes
    is_near: bool

    @property
    def change(self) -> np.ndarray:
        """The last change of the states over a period."""
        before, after = self.pairs[-1]
        return after - before


class Settling:
    """Follows a forced motion until it repeats."""

    def __init__(self, period_map: PeriodMap, tol: float, settle: int, max_periods: int) -> None:
        self.map, self.tol, self.settle, self.max_periods = period_map, tol, settle, max_periods
        self.extrapolations = 0
        self._may_extrapolate = True
        self._trial: _Trial | None = None
        self._plain: Any = None  # snapshot at the end of the plain periods, before any extrapolation
        self._is_squared = False  # whether the change falls with the square of the distance
        self._beyond = 0.0  # additional length of the next extrapolation
        self._wait = self._waited = 0  # periods until the next extrapolation, and since the last one
        self._is_exhausted = False  # whether the last extrapolation did not help
        self._slowest = np.zeros(0)  # change over a period before the last extrapolation
        self._states = [period_map.x]  # at consecutive periods since the last extrapolation
        self._pairs: list[tuple[np.ndarray, np.ndarray]] = []  # around periods with equal events
        self._fresh = 0  # pairs since the last extrapolation
        self._events = b""  # changes of mode over these periods

    def run(self, progress: Callable[[float], None] | None) -> Settled:
        """Follow the motion to its end, at most for the allowed number of periods."""
        while True:
            try:
                for _ in range(max(_EVERY, self.settle - self.map.periods)):
                    self._follow(self.map.advance)
                    if progress is not None:
                        progress(min(self.map.periods / self.max_periods, 1.0))
                passings, rests = self._passings()
            except SimulationError:
                if self._trial is None:
                    raise
                self._take_back(self._trial)  # no motion is possible from the extrapolated states
                continue
            if not self._end_trial(passings.scale):
                continue
            multiple = 1 if rests else self._multiple(passings)
            if multiple is not None:
                if self._is_reached(passings, multiple):
                    return Settled(passings, multiple, rests, self.extrapolations)
                continue
            if self.map.periods >= self.max_periods:
                return Settled(passings, None, False, self.extrapolations)
            self._extrapolate(passings.scale)

    def _multiple(self, passings: Passings) -> int | None:
        """Return the number of periods after which the motion repeats, or None while this number is not certain."""
        found = passings.repeats_after(self.tol)
        if found is None and self._is_exhausted and passings.residual(1) <= self.tol:
            return 1
        shorter = (m for m in range(1, found or 0) if passings.residual(m) <= _NEARLY * self.tol)
        return found if next(shorter, None) is None else None

    def _follow(self, step: Callable[[], Any]) -> Any:
        """Follow the motion for one period by a call of `step`, store the states, and return the result of the call."""
        before = self.map.x
        found = step()
        self._states.append(self.map.x)
        self._waited += 1
        if self.map.changes != self._events:
            self._pairs, self._fresh, self._events = [], 0, self.map.changes
        self._pairs = [*self._pairs[-_COUNTS[-1] :], (before, self.map.x)]
        self._fresh += 1
        return found

    def _passings(self) -> tuple[Passings, bool]:
        """Return the states at the starts of all periods so far, and whether the motion has come to rest."""
        scale, rests = self._follow(self.map.measure)
        last = Point(self.map.x, np.zeros(0), {}, self.map.modes)
        times = self.map.period * np.arange(len(self._states))
        return Passings(times, np.array(self._states), scale, last), rests

    def _extrapolate(self, scale: np.ndarray) -> None:
        """Replace the states by their extrapolated limit, computed from periods with equal events."""
        pairs = self._pairs[-self._fresh :] if self._is_squared else self._pairs
        if not self._may_extrapolate or len(pairs) < _FEWEST or self._waited < self._wait:
            return
        before, after = (np.array(part) for part in zip(*pairs, strict=True))
        change = relative(after[-1] - before[-1], scale)
        for count in _COUNTS:  # the latest periods show the map where the states are now
            limit, expected = limit_of(before[-count:], after[-count:], scale)
            if expected < _GAIN * change or count >= len(before):
                break
        if not (expected < _GAIN * change and relative(limit - after[-1], scale) < _FARTHEST):
            self._is_exhausted = len(pairs) >= _ENOUGH
            self._wait, self._waited = max(_EVERY, len(pairs) // 2), 0
            return
        limit += self._beyond * (limit - after[-1])
        is_near = relative(limit - after[-1], scale) <= _NEAR
        self._trial = _Trial(
            self.map.snapshot(), self._states, self._pairs, self._fresh, self.map.slips, self._events, is_near
        )
        if self._plain is None:
            self._plain = self._trial.former
        self.map.put(limit)
        self._states, self._fresh = [limit], 0

    def _end_trial(self, scale: np.ndarray) -> bool:
        """Keep the last extrapolation only if the next period confirms it; return whether it was kept."""
        trial, self._trial = self._trial, None
        if trial is None:
            return True
        ratio = relative(self._states[-1] - self._states[-2], scale) / relative(trial.change, scale)
        slips = self.map.slips
        is_lost = any(slips.get(slip, 0) < count for slip, count in trial.slips.items())
        if ratio < _CLOSER and (self._events == trial.events or (trial.is_near and not is_lost)):
            self.extrapolations += 1
            self._slowest, self._wait, self._is_exhausted = trial.change, 0, False
            self._is_squared = self._beyond > 0.0 or _SQUARED[0] < ratio < _SQUARED[1]
            self._beyond = _TWICE if self._is_squared else 0.0
            return True
        self._take_back(trial)
        return False

    def _take_back(self, trial: _Trial) -> None:
        """Return to the states before an extrapolation that failed."""
        self._trial = None
        if self._plain is trial.former:
            self._plain = None
        self.map.restore(trial.former)
        self._states, self._pairs, self._fresh = trial.states, trial.pairs, trial.fresh
        self._events = trial.events
        self._beyond, self._is_exhausted = 0.0, True
        self._wait, self._waited = max(_EVERY, self._fresh // 2), 0

    def _is_reached(self, passings: Passings, multiple: int) -> bool:
        """Return whether plain periods approach a repeating motion that attracts; otherwise make them continue."""
        if not (self.extrapolations and self._may_extrapolate):
            return True
        distance = 0.0 if self._plain is None else self._follow_plain(passings.scale, multiple)
        is_repelled = distance < math.inf and grows(self.map, passings.scale, multiple, self._slowest)
        if distance < math.inf and not is_repelled:
            return True
        if distance > CLOSE:
            self.map.restore(self._plain)
        else:
            self._may_extrapolate = False  # the map goes on from the changed states
        self._plain, self._states, self._pairs, self._fresh, self._events = None, [self.map.x], [], 0, b""
        self._wait, self._waited, self._is_exhausted = self.map.periods if is_repelled else 0, 0, False
        return False

    def _follow_plain(self, scale: np.ndarray, multiple: int) -> float:
        """Return the distance from which plain periods approach the present motion, or infinity if they do not.

        They continue from the states before the first extrapolation, at most until the number of periods has doubled.
        The map returns to its present states.
        """
        orbit = []
        for _ in range(multiple):
            self.map.advance()
            orbit.append((self.map.changes, self.map.x))
        present = self.map.snapshot()
        self.map.restore(self._plain)
        most = max(min(2 * self.map.periods, self.max_periods), self.map.periods + MOST)

        def distance(x: np.ndarray) -> float:
            return min(relative(x - y, scale) for _, y in orbit)

        def step() -> float | None:
            self.map.advance()
            self._plain = self.map.snapshot()
            states.append(self.map.x)
            return distance(self.map.x) if any(self.map.changes == word for word, _ in orbit) else None

        found = math.inf
        while found == math.inf and self.map.periods < most:
            states = [self.map.x]
            try:
                distances = followed(step, distance(self.map.x))
            except SimulationError:  # plain periods end here
                break
            if distances and (is_near(distances) or self._leads(states[::-multiple], scale, distance)):
                found = distances[-1]
        self.map.restore(present)
        return found

    def _leads(
        self, latest: list[np.ndarray], scale: np.ndarray, distance: Callable[[np.ndarray], float]
    ) -> bool:
        """Return whether the limit of states at repeated periods, the latest first, is much closer to a motion."""
        states = np.array(latest[::-1])
        limit, _ = limit_of(states[:-1], states[1:], scale)
        return distance(limit) <= (_HALF if self._is_squared else LINEAR) * distance(states[-1])
