"""This module computes the distance of two motions with jumps, as the distance of their completed graphs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hybridsim.reference.trajectory import Trajectory

Array = NDArray[np.float64]

# The graph is sampled often enough that the largest distance on a smooth interval is found to 1 % of itself.
# The counts are prime, so that the samples avoid the steps of fixed-step methods.
SAMPLES_PER_PERIOD, SAMPLES, MOST_SAMPLES = 101, 2003, 20_011
# Near a jump the distance changes over the time between it and the other motion's jump. There 32 points are
# used per this time, over twice of it on both sides.
_NEAR = np.arange(-64, 65) / 32
_ALONG = np.linspace(0.0, 1.0, 33)[:, None]  # fractions along a vertical line
_WINDOW = np.linspace(-1.0, 1.0, 65)  # a window of the other graph around a point of this one
_BATCH = 256  # points per batch: a few megabytes
_ROUNDS = 8  # each round halves the window, or is the last


class CompletedGraph:
    """The graph {(t, x(t))} of a motion with the line from x- to x+ at each jump, in scaled coordinates.

    Parameters
    ----------
    trajectory : the motion.
    jumps : times at which its states jump.
    time, amplitude : the scale of time, and (n,) the scale of each state.
    """

    def __init__(self, trajectory: Trajectory, jumps: Sequence[float], time: float, amplitude: Array) -> None:
        self.trajectory, self.time, self.amplitude = trajectory, time, amplitude
        self.jumps = np.unique(np.asarray(jumps, dtype=float))
        self.ends = np.array([self.at(self.jumps, side) for side in "-+"])  # (2, jumps, n)

    def at(self, times: Array, side: str) -> Array:
        """Return the scaled states (k, n)."""
        if not len(times):
            return np.empty((0, len(self.amplitude)))
        return (self.trajectory.states(times, side) / self.amplitude[:, None]).T

    def points(self, other: CompletedGraph, end: float) -> tuple[Array, Array]:
        """Return times (k,) and scaled states (k, n) of the sample points up to the time `end`."""
        t0 = self.trajectory.t_span[0]
        count = round(SAMPLES_PER_PERIOD * (end - t0) / self.time) if end - t0 > self.time else 0
        smooth = [np.linspace(t0, end, min(max(count, SAMPLES), MOST_SAMPLES))]
        for mine, theirs in ((self.jumps, other.jumps), (other.jumps, self.jumps)):
            gap = _nearest_gap(mine, theirs)
            smooth += [jump + width * _NEAR for jump, width in zip(mine, gap, strict=True)]
        times = np.unique(np.concatenate(smooth))
        times = times[(times >= t0) & (times <= end)]
        here = self.jumps <= end
        low, high = self.ends[:, here]
        lines = [a + (b - a) * _ALONG for a, b in zip(low, high, strict=True)]
        return (
            np.concatenate([times, np.repeat(self.jumps[here], len(_ALONG))]),
            np.concatenate([self.at(times, "+"), *lines]),
        )

    def distance_from(self, times: Array, states: Array, end: float) -> Array:
        """Return the distances (k,) of scaled points from this curve up to the time `end`."""
        return self._refined(times, states, self._bound(times, states, end), end)

    def _bound(self, times: Array, states: Array, end: float) -> Array:
        """Return upper bounds of the distances, from the graph at the same time and at nearby jumps."""
        inside = np.clip(times, self.trajectory.t_span[0], end)
        late = np.abs(times - inside) / self.time
        far = np.min([np.abs(self.at(inside, side) - states).max(axis=1) for side in "-+"], axis=0)
        bound = np.maximum(late, far)
        if len(self.jumps):
            after = np.searchsorted(self.jumps, times)
            for nearest in (after - 1, after):
                k = np.clip(nearest, 0, len(self.jumps) - 1)
                line = (self.jumps[k], self.ends[0, k], self.jumps[k], self.ends[1, k])
                bound = np.minimum(bound, self._to_segments(times, states, *line))
        return bound

    def _refined(self, times: Array, states: Array, bound: Array, end: float) -> Array:
        """Compute exact distances by a search of those parts of the graph that may contain the nearest points."""
        for _ in range(_ROUNDS):
            width = bound[:, None] * self.time
            knots = np.clip(times[:, None] + width * _WINDOW, self.trajectory.t_span[0], end)
            if len(self.jumps):
                after = np.searchsorted(self.jumps, times)
                nearest = np.clip(np.stack([after - 1, after], axis=1), 0, len(self.jumps) - 1)
                knots = np.sort(np.concatenate([knots, np.minimum(self.jumps[nearest], end)], axis=1), axis=1)
            a, b = knots[:, :-1], knots[:, 1:]
            shape = (*a.shape, len(self.amplitude))
            left, right = self.at(a.ravel(), "+").reshape(shape), self.at(b.ravel(), "-").reshape(shape)
            smooth = np.searchsorted(self.jumps, a, side="right") >= np.searchsorted(self.jumps, b)
            distance = self._to_segments(times[:, None], states[:, None], a, left, b, right)
            closer = np.minimum(bound, np.where(smooth, distance, np.inf).min(axis=1))
            settled = bool((closer > bound / 2).all())
            bound = closer
            if settled:
                break
        return bound

    def _to_segments(self, t: Array, x: Array, ta: Array, xa: Array, tb: Array, xb: Array) -> Array:
        """Return the maximum-norm distance of points (t, x) from line segments between (ta, xa) and (tb, xb)."""
        start = np.concatenate([((ta - t) / self.time)[..., None], xa - x], axis=-1)
        along = np.concatenate([((tb - ta) / self.time)[..., None], xb - xa], axis=-1)
        least = np.minimum(np.abs(start).max(axis=-1), np.abs(start + along).max(axis=-1))
        # Along the segment the distance is the upper envelope of the lines +-(start_i + u along_i). Its
        # minimum is at an end or at an intersection of two lines.
        size = start.shape[-1]
        meetings = [(i, j, sign) for i, j in itertools.combinations(range(size), 2) for sign in (1, -1)]
        meetings += [(i, i, -1) for i in range(size)]
        for i, j, sign in meetings:
            steep = along[..., i] - sign * along[..., j]
            meets = np.divide(
                sign * start[..., j] - start[..., i], steep, out=np.zeros_like(steep), where=steep != 0
            )
            u = np.clip(meets, 0.0, 1.0)[..., None]
            least = np.minimum(least, np.abs(start + u * along).max(axis=-1))
        return least


def graph_distance(first: CompletedGraph, second: CompletedGraph) -> float:
    """Return the Hausdorff distance of two completed graphs in the same scaling, until one of them ends.

    It is the maximum over the points of either graph of the distance to the other graph. The distance of two
    points is their largest coordinate difference: |t - t'| / time or |x_i - x_i'| / amplitude_i. The result
    is accurate to about 1 %.

    An event that is late by d contributes d / time, however large its jump.
    """
    end = min(first.trajectory.t_span[1], second.trajectory.t_span[1])
    return max(_farthest(first, second, end), _farthest(second, first, end))


def _farthest(one: CompletedGraph, other: CompletedGraph, end: float) -> float:
    """Return the largest distance of the points of one graph from another graph."""
    times, states = one.points(other, end)
    bound = other._bound(times, states, end)
    order = np.argsort(-bound)
    farthest = 0.0
    for batch in range(0, len(order), _BATCH):
        chosen = order[batch : batch + _BATCH]
        if bound[chosen[0]] <= farthest:
            break
        found = other._refined(times[chosen], states[chosen], bound[chosen], end)
        farthest = max(farthest, float(found.max()))
    return farthest


def _nearest_gap(times: Array, others: Array) -> Array:
    """Return the distance of each of `times` from the nearest time in `others`, or 0 if `others` is empty."""
    if not len(others):
        return np.zeros(len(times))
    after = np.clip(np.searchsorted(others, times), 0, len(others) - 1)
    before = np.clip(after - 1, 0, len(others) - 1)
    return np.minimum(np.abs(others[after] - times), np.abs(others[before] - times))
