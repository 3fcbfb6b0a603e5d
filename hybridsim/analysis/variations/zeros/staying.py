"""This module follows guards and surfaces that are zero with zero rate, so that a small change makes them nonzero.

Such a function g may stay zero for a time. A change that moves it to its other side then runs in other modes. If the
rates or their derivatives differ there before the run leaves the zero, the run on the other side is another one.

Where the run leaves the zero as g = G t**k, a change dg returns to the side of the run at t**k = -dg/G. If the rates of
the two sides are equal at first, the states on the other side change by D t**p until then. For p > k this is no effect
of first order. For p = k the states change by -D dg/G. For p < k there is no derivative.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from hybridsim.analysis.variations.changes import EXACT, Changed, Changes, Place
from hybridsim.analysis.variations.off_zero import OffZero, rates_of
from hybridsim.analysis.variations.rounds import Rounds
from hybridsim.analysis.variations.tapes import tangent_tape
from hybridsim.analysis.variations.zeros.monitors import monitors_reached
from hybridsim.analysis.variations.zeros.zero_function import StaysZero, ZeroFunction
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.series.bounded import ORDER, UNIT
from hybridsim.engine.system.system import System

_SAME = 1e-9  # of their terms: rates, or effects of a change, that differ by less are equal on both sides
_FRACTIONS = np.array(
    [0.0, 0.013, 0.11, 0.29, 0.53, 0.71, 0.89, 1.0]
)  # of a segment; irregular, to miss no difference
_EARLY = 1e-3  # of a segment: time after its start at which the order of a change is measured


Over = Callable[[np.ndarray], np.ndarray]
"""The type of derivatives (k, n, M) of the states at local times (k,) of a segment."""


class Staying:
    """The functions, and the numbers of the monitors, that are zero with zero rate at an instant of a run.

    stays_zero : the functions that stay zero along a segment, each with the number of the segment.
    """

    def __init__(self) -> None:
        self.zeros: list[ZeroFunction] = []
        self.monitors: list[int] = []
        self.stays_zero: list[tuple[int, StaysZero]] = []

    def __bool__(self) -> bool:
        return bool(self.zeros or self.monitors)

    def settle(self, zeros: list[ZeroFunction]) -> None:
        """Replace the functions after an event with a jump; keep those with directions that never return to zero."""
        self.zeros = [one for one in self.zeros if one.gone is not None] + zeros

    def follow(
        self, changes: Changes, number: int, segment: Segment, Yd: np.ndarray, shift: np.ndarray, over: Over
    ) -> list[OffZero]:
        """Follow the functions and monitors along a segment, and return the effects on the derivatives."""
        if not self or len(segment.s) < 2:
            return []
        follower = Follower(changes, segment, Yd, shift, over)
        followed = [follower.follow(one) for one in self.zeros]
        self.stays_zero += [(number, one) for one in follower.stays_zero]
        self.zeros = [one for one, _ in followed if one is not None]
        off, self.monitors = monitors_reached(changes, follower.at_start(), segment, self.monitors)
        return [one for _, found in followed for one in found] + off

    def at_resets(
        self, changes: Changes, at: Place, rounds: Rounds, ran: Callable[[np.ndarray], Rounds]
    ) -> list[OffZero]:
        """Return the functions for which the resets of an instant have different results on the two sides of zero.

        at : the place just before the instant. rounds : its resets. ran : repeats them in other modes before it.
        """
        return (
            [one for zero in self.zeros for one in _parted_by_resets(changes, zero, at, rounds, ran)]
            if rounds.has_reset
            else []
        )


class Follower:
    """Follows functions at zero along one segment of a run.

    over : returns the derivatives (k, n, M) of the states at local times (k,). shift (M,) : of the time of its start.
    """

    def __init__(
        self, changes: Changes, segment: Segment, Yd: np.ndarray, shift: np.ndarray, over: Over
    ) -> None:
        self._changes, self._system, self._segment, self._over = changes, changes.system, segment, over
        self._Yd, self._shift = Yd, shift
        self.stays_zero: list[StaysZero] = []

    def follow(self, zero: ZeroFunction) -> tuple[ZeroFunction | None, list[OffZero]]:
        """Return the function to follow after the segment, or None, and its effects on the derivatives."""
        mode, width = int(self._segment.z[zero.c]), self._changes.G.shape[1]
        if zero.gone is not None:
            return self._gone(zero, mode)
        seen = zero.seen_from(mode)
        if seen is None:
            return None, []
        points = list(self._along(_FRACTIONS))
        found = [_value(self._changes, seen, at) for at in points]
        if not all(one.is_zero for one in found):
            return None, self._leaving(seen, points[0], found[0])
        moves, lost = np.zeros(width, dtype=bool), np.zeros(width, dtype=bool)
        self._rests(seen, np.any([one.moves for one in found], axis=0))
        for at, one in zip(points, found, strict=True):
            if not (one.moves & ~seen.noted).any():
                continue
            parted = one.moves & ~seen.noted & self._parted(seen, at)
            moves |= parted
            lost |= parted & (_side(self._system, seen) * one.by < 0.0)
        return seen._replace(noted=seen.noted | moves), self._off(seen, moves, lost)

    def _gone(self, zero: ZeroFunction, mode: int) -> tuple[ZeroFunction | None, list[OffZero]]:
        """Compare the run with a changed run that stays in another mode."""
        assert zero.gone is not None
        if mode == zero.there:
            return None, []
        parted = np.full(len(zero.gone), mode != zero.here)
        self._rests(zero, zero.gone)
        for at in self._along(_FRACTIONS):
            parted |= self._parted(zero, at)
        parted &= zero.gone
        rest = zero.gone & ~parted
        return (zero._replace(gone=rest) if rest.any() else None), self._off(zero, parted, parted)

    def _rests(self, zero: ZeroFunction, moves: np.ndarray) -> None:
        if moves.any():
            z = self._segment.z.copy()
            z[zero.c] = zero.there
            self.stays_zero.append(StaysZero(float(self._segment.start), zero.name, moves, z))

    def _leaving(self, zero: ZeroFunction, at: Place, one: Changed) -> list[OffZero]:
        """Return the effects of a function that becomes nonzero at the start of the segment."""
        if zero.back >= 0:
            return []  # both sides of a corner agree to a higher order than its function
        ahead = self._order(zero, at, zero.here)[0]
        if zero.surface < 0:
            return self._off(zero, *self._moved_later(zero, one, ahead, 0))
        order, amount, parted, apart = self._apart(zero, at)
        now = one.moves & ~zero.noted
        other = now & (_side(self._system, zero) * one.by < 0.0)
        off = self._off(zero, *self._moved_later(zero, one, ahead, parted))
        if parted > order and amount > 0.0:
            return off
        if parted < order or amount <= 0.0:
            return off + self._off(zero, now, other)
        more = np.outer(apart / amount, np.where(other, np.abs(one.by), 0.0))
        return off + self._off(zero, now, np.zeros_like(other), more)

    def _apart(self, zero: ZeroFunction, at: Place) -> tuple[int, float, int, np.ndarray]:
        """Return k and G of g = G t**k on the other side, and p and D of the difference D t**p of the states."""
        system, there = self._system, _other_side(zero, at)
        order, amount = self._order(zero, at, zero.there)
        here, beyond = self._series(at, at.z), self._series(at, there)
        apart, bounds = beyond.states - here.states, beyond.state_bounds + here.state_bounds
        for p in range(1, ORDER + 1):
            if (np.abs(apart[:, p]) > bounds[:, p]).any():
                return order, amount, p, np.where(np.abs(apart[:, p]) > bounds[:, p], apart[:, p], 0.0)
        return order, amount, ORDER + 1, np.zeros(system.n)

    def _order(self, zero: ZeroFunction, at: Place, mode: int) -> tuple[int, float]:
        """Return k and G of the function g = G t**k in a mode, positive on the side of the run."""
        series = self._series(at, _other_side(zero, at) if mode == zero.there else at.z)
        values, bounds = (
            (series.guards[zero.guard], series.guard_bounds[zero.guard])
            if zero.surface < 0
            else (series.surfaces[zero.surface], series.surface_bounds[zero.surface])
        )
        for k in range(1, ORDER + 1):
            if abs(values[k]) > bounds[k]:
                return k, _side(self._system, zero) * float(values[k])
        return ORDER + 1, 1.0

    def _moved_later(
        self, zero: ZeroFunction, first: Changed, order: int, parted: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions (M,) that move the function by a lower order of time only, and those without return."""
        early = np.array([_EARLY, 2.0 * _EARLY])  # after the start, which a change may move
        one, two = (_value(self._changes, zero, self._moving(at)) for at in self._along(early))
        moved = one.moves & ~first.moves & ~zero.noted
        with np.errstate(divide="ignore", invalid="ignore"):
            lowest = np.where(moved, np.round(np.log2(two.by / one.by)), math.inf)
        moved &= (lowest < order) & (parted <= order - lowest)
        return moved, moved & (_side(self._system, zero) * one.by < 0.0)

    def _parted(self, zero: ZeroFunction, at: Place) -> np.ndarray:
        """Return a mask (M,) of the directions in which a run on the other side of zero differs at the point `at`."""
        system, z = self._system, _other_side(zero, at)
        if zero.surface < 0 and zero.back < 0 and zero.gone is None:
            return np.ones(at.Y.shape[1], dtype=bool)
        guards = tuple(int(g) for g in np.flatnonzero(system.active(at.z)) if system.owner[g] != zero.c)
        monitors = tuple(range(len(system.model.monitors)))
        tapes = [tangent_tape(system, modes, guards, monitors) for modes in (at.z, z)]
        if tapes[0].is_same(tapes[1]):
            return np.zeros(at.Y.shape[1], dtype=bool)
        vector = self._changes.vector
        found = [tape(np.array([at.s]), at.x[None, :], at.p, vector.seeds(at.p)) for tape in tapes]
        values, slopes = (np.array([getattr(one, part)[0] for one in found]) for part in ("values", "slopes"))
        n, others = system.n, np.concatenate([at.Yd, self._changes.G])
        terms = np.abs(slopes[:, :, :n]) @ np.abs(at.x) + np.abs(values)
        if (
            np.abs(values[0] - values[1]) > _SAME * np.abs(values).sum(axis=0) + EXACT * terms.sum(axis=0)
        ).any():
            return np.ones(at.Y.shape[1], dtype=bool)
        if system.holds(at.z):
            rates = [rates_of(system, at.s, at.x, at.p, modes) for modes in (at.z, z)]
            if (np.abs(rates[0] - rates[1]) > _SAME * (np.abs(rates[0]) + np.abs(rates[1]))).any():
                return np.ones(at.Y.shape[1], dtype=bool)
        moved = slopes[:, :, :n] @ at.Y + slopes[:, :, n + 1 :] @ others
        sizes = np.abs(slopes[:, :, :n]) @ np.abs(at.Y) + np.abs(slopes[:, :, n + 1 :]) @ np.abs(others)
        return np.asarray((np.abs(moved[0] - moved[1]) > _SAME * sizes.sum(axis=0)).any(axis=0))

    def at_start(self) -> Place:
        """Return the point at the start of the segment."""
        return next(self._along(np.zeros(1)))

    def _along(self, fractions: np.ndarray) -> Iterator[Place]:
        segment, Yd = self._segment, self._Yd
        begin, end = float(segment.s[0]), float(segment.s[-1])
        stops = begin + fractions * (end - begin)
        fixed = np.zeros(self._changes.G.shape[1])
        for s, x, Y in zip(stops.tolist(), segment.dense(stops), self._over(stops), strict=True):
            yield Place(s, float(segment.origin), x, segment.p, segment.z, Y, Yd, fixed, np.abs(Y))

    def _moving(self, at: Place) -> Place:
        """Return a point that moves with the start of the segment."""
        rates = rates_of(self._system, at.s, at.x, at.p, at.z)
        return replace(at, Y=at.Y + np.outer(rates, self._shift), shift=self._shift)

    def _series(self, at: Place, z: np.ndarray) -> Any:
        error = 4.0 * UNIT * np.abs(self._segment.x).max(axis=0)
        return self._system.series(at.s, at.x, at.p, z, error, 4.0 * math.ulp(at.origin + at.s))

    def _off(
        self, zero: ZeroFunction, moves: np.ndarray, lost: np.ndarray, more: np.ndarray | None = None
    ) -> list[OffZero]:
        if not moves.any():
            return []
        none = np.zeros((self._system.n, len(moves)))
        return [
            OffZero(float(self._segment.start), zero.name, moves, lost, none if more is None else more, True)
        ]


def _parted_by_resets(
    changes: Changes, zero: ZeroFunction, at: Place, rounds: Rounds, ran: Callable[[np.ndarray], Rounds]
) -> list[OffZero]:
    seen = zero if zero.gone is not None else zero.seen_from(int(at.z[zero.c]))
    if seen is None:
        return []
    moves = other = seen.gone
    if moves is None or other is None:
        one = _value(changes, seen, at)
        moves = one.moves & ~seen.noted
        other = moves & (_side(changes.system, seen) * one.by < 0.0)
    if not moves.any():
        return []
    beyond = ran(_other_side(seen, at))
    parted = np.array(
        [_differ(np.concatenate([rounds.x, rounds.d]), np.concatenate([beyond.x, beyond.d])).any()]
    )
    parted = parted | _differ(rounds.Y, beyond.Y).any(axis=0) | _differ(rounds.Yd, beyond.Yd).any(axis=0)
    if not (moves & parted).any():
        return []
    none = np.zeros(at.Y.shape)
    return [OffZero(at.origin + at.s, seen.name, moves & parted, other & parted, none, True)]


def _differ(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.abs(one - other) > _SAME * (np.abs(one) + np.abs(other))


def _value(changes: Changes, zero: ZeroFunction, at: Place) -> Changed:
    if zero.surface < 0:
        return changes.of(at, (zero.guard,))[0]
    return changes.of(at, surfaces=(zero.surface,))[0]


def _side(system: System, zero: ZeroFunction) -> float:
    """Return the sign of the function just after it leaves zero in the run."""
    is_below = zero.surface >= 0 and zero.here == system.automata[zero.c].below
    return -1.0 if is_below else 1.0


def _other_side(zero: ZeroFunction, at: Place) -> np.ndarray:
    """Return the modes on the other side of the function's zero."""
    z = at.z.copy()
    z[zero.c] = zero.there
    return z
