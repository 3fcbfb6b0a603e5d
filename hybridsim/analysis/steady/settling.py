"""This module follows a motion until it repeats after some forcing periods or Poincare section passages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybridsim.analysis.polynomials.orbit import Orbit
from hybridsim.analysis.polynomials.resolving import orbit_of
from hybridsim.analysis.steady.motion import Motion, Point, point_at, point_at_end
from hybridsim.analysis.steady.quiet import (
    between_events,
    event_times,
    is_event_near,
    middle_of_longest,
    quiet_offset,
)
from hybridsim.analysis.steady.scales import LEAST, rounding_of, shared_sizes
from hybridsim.analysis.variations.off_zero import rates_of
from hybridsim.analysis.variations.sizes import ranges
from hybridsim.solution import Solution

CLOSER = 1e-2  # multiple of the tolerance: below it, a change that no longer shrinks has converged
LONGEST_WORD = 12  # largest number of periods after which a motion may repeat


@dataclass(frozen=True)
class Passings:
    """The states of a motion at consecutive passages of a Poincare section.

    Parameters
    ----------
    times : (K,), from the beginning of the run.
    values : (K, n + d), states and discrete states just before each passage.
    scale : (n + d,), the scale of a change of each; see `scale_of`.
    last : the point of the last passage.
    rests : whether the motion has come to rest.
    state : the state that defines the section, without forcing.
    adds_up : whether all motion is states that grow at constant rates, without forcing.
    """

    times: np.ndarray
    values: np.ndarray
    scale: np.ndarray
    last: Point
    rests: bool = False
    state: int = 0
    adds_up: bool = False

    def residual(self, multiple: int) -> float:
        """Return the largest relative change of a state over the last `multiple` passages."""
        if self.rests:
            return 0.0
        if len(self.values) <= multiple:
            return float("inf")
        return relative(self.values[-1] - self.values[-1 - multiple], self.scale)

    def repeats_after(self, tolerance: float) -> int | None:
        """Return the number of passages after which the motion repeats, or None if it has not converged yet."""
        found = (m for m in range(1, min(LONGEST_WORD, len(self.values) - 1) + 1))
        return next((m for m in found if self._error(m, CLOSER * tolerance) <= tolerance), None)

    def _error(self, multiple: int, rounding: float) -> float:
        """Return the extrapolated distance between the last passage and the limit of all passages."""
        residual = self.residual(multiple)
        back = (len(self.values) - 1) // (2 * multiple)
        if back == 0:
            return float("inf")
        earlier = self._change(back, multiple)
        if not residual < earlier:
            return residual if residual <= rounding else float("inf")
        rate = (residual / earlier) ** (1.0 / back)
        return float(residual / (1.0 - rate)) if rate < 1.0 else float("inf")

    def more(self, multiple: int, tolerance: float) -> float:
        """Estimate how many more passages the motion needs to settle to the tolerance."""
        residual, back = self.residual(multiple), (len(self.values) - 1) // (2 * multiple)
        if back == 0:
            return float("inf")
        earlier = self._change(back, multiple)
        if not 0.0 < residual < earlier:
            return float("inf")
        rate = math.log(earlier / residual) / back
        left = math.log(max(residual, tolerance) / tolerance) + max(0.0, -math.log(-math.expm1(-rate)))
        return multiple * left / rate

    def _change(self, back: int, multiple: int) -> float:
        """Return the relative change of the states over `multiple` passages, counted back from the last passage."""
        return relative(
            self.values[-1 - back * multiple] - self.values[-1 - (back + 1) * multiple], self.scale
        )

    def drifting(self) -> int | None:
        """Return the index of a state that drifts by equal amounts per quarter of the passages, or None."""
        quarter = (len(self.values) - 1) // 4
        if quarter < 2:
            return None
        moves = np.diff(self.values[::-quarter][:5], axis=0)
        i = int(np.argmax(np.abs(moves[0]) / np.where(self.scale > 0.0, self.scale, 1.0)))
        return i if np.ptp(moves[:, i]) <= _STEADY * abs(moves[0, i]) else None

    def nearest(self) -> int:
        """Return the smallest number of passages after which the motion comes close to repeating."""
        most = min(LONGEST_WORD, (len(self.values) - 1) // 2)
        residuals = [self.residual(m) for m in range(1, max(most, 1) + 1)]
        return 1 + next(i for i, r in enumerate(residuals) if r <= _ABOUT * min(residuals))


_STEADY = 0.1  # relative variation of a drift
_CONSTANT = 1e-8  # the same for a constant rate, which excludes a slow approach to rest
_ABOUT = 10.0


def relative(change: np.ndarray, scale: np.ndarray) -> float:
    """Return the largest relative entry of a change; entries that have no scale are ignored."""
    parts = np.abs(change)[scale > 0.0] / scale[scale > 0.0]
    return float(parts.max(initial=0.0))


def scale_of(solution: Solution, since: float) -> np.ndarray:
    """Return the scale (n + d,) for changes of each state: half the range of the state late in the run.

    It is at least a thousandth of the largest size, because a state far from zero that hardly moves has fewer digits.
    """
    low, high = ranges(solution, since)
    if solution._system.layout.discrete:
        index = np.flatnonzero(solution._of_model.frame.ends > since)
        held = np.array([solution._segments[int(i)].p[solution._system.layout.discrete_slice] for i in index])
        low, high = np.append(low, held.min(axis=0)), np.append(high, held.max(axis=0))
    return np.maximum(0.5 * (high - low), LEAST * np.maximum(np.abs(low), np.abs(high)))


def forced_scale_of(solution: Solution, since: float) -> np.ndarray:
    """Return the scale (n + d,) of each state of a forced motion; it is at least a fraction of `shared_sizes`."""
    scale, least = scale_of(solution, since), LEAST * shared_sizes(solution, since)
    scale[: len(least)] = np.maximum(scale[: len(least)], least)
    return scale


def forced_passings(
    motion: Motion, start: Point | None, period: float, count: int, phase: float, largest: np.ndarray
) -> Passings:
    """Return the states at one phase of consecutive forcing periods.

    If an event is at this phase, the section moves to an event-free phase, and the motion is followed as long again.
    largest (n,): the largest scale of each state so far, updated here.
    """
    solution = motion.run(start, (phase if start is None else 0.0) + count * period)
    np.maximum(largest, scale_of(solution, solution.t_start)[: len(largest)], out=largest)
    offset = quiet_offset(solution, period)
    if offset > 0.0:
        place = point_at(solution, solution.t_end - period + offset)
        moved = (phase + offset) % period
        return forced_passings(motion, replace(place, at=moved), period, count, moved, largest)
    times = phase + period * np.arange(1, count + 1)
    times[-1] = solution.t_end
    values = solution(times, side="-").T
    system = solution._system
    if system.layout.discrete:
        index, _ = solution._of_model.segment_at(times, "-")
        discrete = [solution._segments[int(i)].p[system.layout.discrete_slice] for i in index]
        values = np.concatenate([values, discrete], axis=1)
    late = solution.t_end - max(1, count // 4) * period
    motion.sizes = np.abs(ranges(solution, late)).max(axis=0)
    return Passings(times, values, forced_scale_of(solution, late), replace(point_at_end(solution), at=phase))


def free_passings(
    motion: Motion, start: Point | None, duration: float, largest: np.ndarray, **limits: Any
) -> Passings:
    """Return the passages of the fastest state through the middle of its range, late in a run.

    A state that only grows, such as the angle of a shaft, passes there once; it is used if there is no other.
    largest (n,): the largest scale of each state so far, updated here. A motion that has decayed relative to
    these scales rests, because the rest of it may be rounding, which may repeat.
    """
    solution = motion.run(start, duration, **limits)
    n, scale = len(motion.names), scale_of(solution, 0.0)
    np.maximum(largest, scale[:n], out=largest)
    middle = between_events(event_times(solution), 0.5 * duration, 0.25 * duration, 0.75 * duration)
    late = motion.run(point_at(solution, middle), duration - middle)
    orbit = orbit_of(late, late.names)
    low, high = orbit.extremes
    moves = np.where(scale[:n] > 0.0, (high - low) / np.where(scale[:n] > 0.0, scale[:n], 1.0), 0.0)
    end = point_at_end(late)
    if moves.max(initial=0.0) <= RESTS:
        return Passings(np.array([0.0]), end.values[None, :], scale, end, rests=True)
    motion.sizes = np.maximum(np.abs(low), np.abs(high))
    rounding = rounding_of(motion.coupled_sizes(end), motion.rtol)
    if died_out(low, high, largest) or (high - low <= rounding).all():
        following = motion.run(end, _LONGER * duration)  # continued to its limit
        left = np.subtract(*ranges(following, following.t_end - 0.5 * duration)[::-1])
        # a state that is small only relative to its start may have a motion of its own
        if ((left <= 0.5 * (high - low)) | (left <= np.maximum(_ROUNDED * largest, rounding))).all():
            end = point_at_end(following)
            return Passings(np.array([0.0]), end.values[None, :], scale, end, rests=True)
        largest[:] = 0.5 * (high - low)
    others = np.where(_drifts_steadily(late, high - low, _STEADY), 0.0, moves)
    j = int(np.argmax(others if others.max() > RESTS else moves))
    times = orbit.passes(motion.names[j], 0.5 * (low[j] + high[j]))
    times, j = _without_events(late, orbit, times, j, others > RESTS)
    points = [point_at(late, t) for t in times]
    values = np.array([p.values for p in points]).reshape(len(points), len(scale))
    adds_up = bool((moves <= RESTS)[~_drifts_steadily(late, high - low, _CONSTANT)].all())
    return Passings(
        times, values, scale_of(late, 0.0), points[-1] if points else end, state=j, adds_up=adds_up
    )


def _without_events(
    late: Solution, orbit: Orbit, times: np.ndarray, j: int, may_be_passed: np.ndarray
) -> tuple[np.ndarray, int]:
    """Return the times at which the motion passes a section without events, and the index of the state in the section.

    times, j: a first section, which is kept if no event is there. Otherwise the section moves to the middle
    of the longest event-free interval of a period. It becomes a level of the state that moves fastest there,
    among the states may_be_passed (n,).
    """
    events = event_times(late)
    if len(times) < 2 or not len(events):
        return times, j
    period = float(times[-1] - times[-2])
    if not any(is_event_near(late, events, t, period) for t in times[-_LAST_PASSAGES:]):
        return times, j
    begin = float(times[-2])
    inside = events[(events >= begin) & (events < begin + period)] - begin
    middle = begin + (middle_of_longest(inside, period) if len(inside) else 0.5 * period)
    index, s = late._of_model.segment_at(np.array([middle]), "-")
    segment = late._segments[int(index[0])]
    x = late(middle)
    rates = rates_of(late._system, float(s[0]), x, segment.p, segment.z)
    low, high = (part[: len(x)] for part in orbit.extremes)
    share = np.where(may_be_passed & (high > low), np.abs(rates) / np.where(high > low, high - low, 1.0), 0.0)
    if not share.any():
        return times, j
    j = int(np.argmax(share))
    found = orbit.passes(orbit.names[j], float(x[j]), upward=bool(rates[j] > 0.0))
    return np.array([t for t in found if not is_event_near(late, events, t, period)]), j


_LAST_PASSAGES = 3  # last passages that are checked for events


def _drifts_steadily(solution: Solution, moves: np.ndarray, steady: float) -> np.ndarray:
    """Return a mask (n,) of states that drift by equal amounts in each quarter of a run."""
    steps = np.diff(solution(np.linspace(solution.t_start, solution.t_end, 5)), axis=1)
    is_steady = np.ptp(steps, axis=1) <= steady * np.abs(steps[:, 0])
    return np.asarray(is_steady & (np.abs(steps.sum(axis=1)) >= (1.0 - _STEADY) * moves) & (moves > 0.0))


def is_rest(motion: Motion, start: Point, period: float, largest: np.ndarray, followed: int) -> bool:
    """Return whether all motion along a closed orbit is within rounding errors, or dies out.

    A motion far below the largest scale (n,) of each state may be one of its own, or the last part of a decay. It is
    followed for a part of the periods that were `followed`: a decay becomes smaller.
    """
    solution = motion.run(start, period)
    held = [segment.p[solution._system.layout.discrete_slice] for segment in solution._segments]
    if any((values != held[0]).any() for values in held):
        return False
    moves = np.subtract(*ranges(solution)[::-1])
    sizes = np.maximum(motion.coupled_sizes(start), shared_sizes(solution, solution.t_start))
    is_rounding = moves <= rounding_of(sizes, motion.rtol)
    if is_rounding.all() or not (is_rounding | (moves <= _ROUNDED * largest)).all():
        return bool(is_rounding.all())
    later = motion.run(start, math.ceil(1 + _FOLLOWED * followed) * period)
    left = np.subtract(*ranges(later, later.t_end - period)[::-1])
    return bool((is_rounding | (left <= 0.5 * moves)).all())


def died_out(low: np.ndarray, high: np.ndarray, largest: np.ndarray) -> bool:
    """Return whether the states vary so little between `low` and `high` that the motion has decayed."""
    return bool((high - low <= _DIED_OUT * largest).all())


_DIED_OUT, _ROUNDED = 1e-9, 1e-13
_FOLLOWED = 0.125  # of the periods in which a motion decayed to `_ROUNDED`: it decays at least to a thirtieth
_LONGER = 2  # factor of the duration
RESTS = 1e-12  # relative to its largest size; a state at rest moves by less
