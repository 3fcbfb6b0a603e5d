"""This module follows a forced mechanical system until its states repeat from period to period.

A run of plain periods is followed as long as the states change. If the sequence of events is the same in
consecutive periods, the period map is smooth there, and the states are extrapolated to their limit. The motion
has settled if plain periods approach a limit within the tolerance. If it was extrapolated, a change of the
states in their slowest direction must not grow, because extrapolation also finds motions that repel.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hybridsim.analysis.steady.motion import Point
from hybridsim.analysis.steady.settling import Passings, relative
from hybridsim.analysis.structures.extrapolation import limit_of
from hybridsim.analysis.structures.period_map import PeriodMap

_FLOOR = 1e-3  # smallest scale of a position or a velocity, relative to the largest scale of its kind
_EVERY = 4  # periods between tests
_COUNTS = (4, 8, 16, 32, 64, 128)  # periods in an extrapolation
_BEYOND = (
    0.9  # the same if the change falls with the square of the distance, as of a contact that hardly slips
)
_FEWEST = 3  # periods for an extrapolation
_GAIN = 0.1  # expected ratio of changes that makes an extrapolation worthwhile
_FARTHEST = 1e3  # of the scale: a limit further away is that of a state that drifts
_CLOSER = 0.5  # an extrapolation that does not reduce the change by this factor is taken back
_CHANGE = 1e-6  # of the scale: the change of the states that must not grow
_DECAY, _GROWN = 8, 1.1  # periods of this test, and the growth that is allowed, as of a neutral direction
_NEARLY = 1e4  # multiple of the tolerance: below it, the motion may be about to repeat
_RESTS = 1e-12  # a smaller range relative to the size is rest


class Settled(NamedTuple):
    """The result of following a motion.

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


class Settling:
    """Follows a motion until it repeats; see the module."""

    def __init__(self, period_map: PeriodMap, tol: float, settle: int, max_periods: int) -> None:
        self.map, self.tol, self.settle, self.max_periods = period_map, tol, settle, max_periods
        self.extrapolations = 0
        self._may_extrapolate = True
        self._beyond = 0.0  # length of the next extrapolation beyond the limit
        self._slowest = np.zeros(0)  # change over a period before the last extrapolation
        self._states = [period_map.x]  # at consecutive periods since the last extrapolation
        self._pairs: list[
            tuple[np.ndarray, np.ndarray]
        ] = []  # states before and after periods with equal events
        self._events = b""  # changes of mode over these periods

    def run(self, progress: Callable[[float], None] | None) -> Settled:
        """Follow the motion to its end, at most for the allowed number of periods."""
        since = 0
        while True:
            self._follow(self.map.advance)
            since += 1
            if progress is not None:
                progress(min(self.map.periods / self.max_periods, 1.0))
            if self.map.periods < self.settle or since < _EVERY:
                continue
            since = 0
            passings, rests = self._passings()
            multiple = self._multiple(passings)
            if rests or (multiple is not None and self._attracts(passings)):
                return Settled(passings, multiple, rests, self.extrapolations)
            if self.map.periods >= self.max_periods:
                return Settled(passings, None, False, self.extrapolations)
            if multiple is None:
                self._extrapolate(passings.scale)

    def _multiple(self, passings: Passings) -> int | None:
        """Return after how many periods the motion repeats, or None; a motion that nearly repeats earlier waits."""
        found = passings.repeats_after(self.tol)
        shorter = (m for m in range(1, found or 0) if passings.residual(m) <= _NEARLY * self.tol)
        return found if next(shorter, None) is None else None

    def _follow(self, step: Callable[[], Any]) -> Any:
        """Follow the motion for one period by calling `step`, store the states, and return what `step` returned."""
        before = self.map.x
        found = step()
        self._states.append(self.map.x)
        if self.map.changes != self._events:
            self._pairs, self._events = [], self.map.changes
        self._pairs = [*self._pairs[-_COUNTS[-1] :], (before, self.map.x)]
        return found

    def _passings(self) -> tuple[Passings, bool]:
        """Return the passages of phase zero so far, and whether the motion has come to rest."""
        half, largest = self._follow(self.map.sizes)
        scale = np.maximum(half, _FLOOR * largest)
        for kind in np.split(np.arange(len(scale)), 2):
            scale[kind] = np.maximum(scale[kind], _FLOOR * scale[kind].max())
        last = Point(self.map.x, np.zeros(0), {}, self.map.modes)
        times = self.map.period * np.arange(len(self._states))
        return Passings(times, np.array(self._states), scale, last), bool((half <= _RESTS * largest).all())

    def _extrapolate(self, scale: np.ndarray) -> None:
        """Put the limit of the periods with equal events in place of the states, if the motion returns better."""
        if not self._may_extrapolate or len(self._pairs) < _FEWEST:
            return
        before, after = (np.array(part) for part in zip(*self._pairs, strict=True))
        change = relative(after[-1] - before[-1], scale)
        for count in _COUNTS:  # the latest periods show the map where the states are now
            limit, expected = limit_of(before[-count:], after[-count:], scale)
            if expected < _GAIN * change or count >= len(before):
                break
        if not (expected < _GAIN * change and relative(limit - after[-1], scale) < _FARTHEST):
            return
        former, events, states = self.map.snapshot(), self._events, self._states
        limit += self._beyond * (limit - after[-1])
        self.map.put(limit)
        self._states = [limit]
        self._follow(self.map.advance)
        left = relative(self.map.x - limit, scale) / change
        if self._events != events or not left < _CLOSER:
            self.map.restore(former)
            self._states, self._beyond = states, 0.0
            return
        self.extrapolations += 1
        self._slowest = after[-1] - before[-1]
        self._beyond = _BEYOND if left > _GAIN else 0.0

    def _attracts(self, passings: Passings) -> bool:
        """Return whether a change in the slowest direction does not grow; if it does, go on from the changed states."""
        if not (self.extrapolations and self._may_extrapolate):
            return True
        start, scale = self.map.snapshot(), passings.scale
        x = self.map.x
        by = _CHANGE * self._slowest / relative(self._slowest, scale)
        self.map.put(x + by)
        for _ in range(_DECAY):
            y = self.map.advance()
        if relative(y - x, scale) <= _GROWN * _CHANGE:
            self.map.restore(start)
            return True
        self._may_extrapolate, self._states = False, [y]
        return False
