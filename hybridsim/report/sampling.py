"""This module samples the dense output of a run so that straight lines between the samples show its curves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hybridsim.solution import Solution

Array = NDArray[np.float64]

_PARTS = 4  # first division of each step; an interval of it is halved as long as its middle deviates
_DEEPEST = 9  # halvings of one part
_LEAST_KNOTS = 513  # of a run: a closed form may take one step of any length
_DEVIATION = 5e-4  # of the range of a quantity: the largest distance of a middle from the straight line
_PROBES = 1000  # steps from which the range of each quantity is estimated


class Sampler:
    """The values of several quantities of a run, in the order of time, with both sides of each event."""

    def __init__(self, solution: Solution, names: Sequence[str]) -> None:
        self._trajectory = solution._of_model
        self.names = tuple(names)
        is_forward = solution.t_end >= solution.t_start
        self._after, self._before = ("+", "-") if is_forward else ("-", "+")
        times = self._trajectory.own_times
        self.steps: Array = np.union1d(times, np.linspace(times.min(), times.max(), _LEAST_KNOTS))
        # inputs may jump at the ends of segments, without an event
        self._breaks = np.concatenate([self._trajectory.instants, *self._trajectory.frame[:2]])
        self._sizes = self._estimated_sizes()

    def values(self, times: Array, is_after: bool = True) -> Array:
        """Return the values (n, k) at times (k,); at an event, the values just after or just before the event."""
        with np.errstate(all="ignore"):
            return self._trajectory.values_of(self.names, times, self._after if is_after else self._before)

    def _estimated_sizes(self) -> Array:
        """Return the range of each quantity, from some of the steps."""
        steps = self.steps
        if len(steps) > _PROBES:
            steps = steps[np.linspace(0, len(steps) - 1, _PROBES).round().astype(int)]
        times = np.concatenate([steps, *(steps[:-1] + share * np.diff(steps) for share in (0.3, 0.7))])
        values = self.values(times)
        values = np.where(np.isfinite(values), values, 0.0)
        span = np.ptp(values, axis=1)
        largest = np.abs(values).max(axis=1)
        return np.where(span > 1e-12 * largest, span, np.where(largest > 0, largest, 1.0))

    def along(
        self, knots: Array, most: float = np.inf, parts: int = _PARTS, deepest: int = _DEEPEST
    ) -> tuple[Array, Array]:
        """Return times (k,) and values (n, k) between the first and last of some ascending knots.

        The knots have to contain all events and jumps of inputs between them. At each of these there are two entries,
        before and after it.
        Each interval between knots is divided into equal parts, whose middles are sampled, too. Parts whose middles
        deviate from the straight line are halved, unless there would be more than about `most` samples.
        """
        if len(knots) < 2:
            return knots, self.values(knots)
        a = (knots[:-1, None] + np.diff(knots)[:, None] * (np.arange(parts) / parts)).ravel()
        b = np.append(a[1:], knots[-1])
        middle = a + 0.5 * (b - a)
        at_a, at_middle = np.split(self.values(np.concatenate([a, middle])), 2, axis=1)
        ends, at_ends = knots[1:], self.values(knots[1:], is_after=False)
        at_b = np.append(at_a[:, 1:], at_ends[:, -1:], axis=1)
        at_b[:, parts - 1 :: parts] = at_ends
        is_break = np.isin(ends, self._breaks)
        is_break[-1] = True
        times, values = [a, middle, ends[is_break]], [at_a, at_middle, at_ends[:, is_break]]
        ranks = np.repeat(
            [1, 1, 0], [len(a), len(a), int(is_break.sum())]
        )  # values before an event are first
        for _ in range(deepest - 1):
            is_coarse = self._deviates(at_a, at_middle, at_b) & (middle > a) & (middle < b)
            if not is_coarse.any() or len(ranks) + 2 * is_coarse.sum() > most:
                break
            a, middle, b = a[is_coarse], middle[is_coarse], b[is_coarse]
            at_a, at_middle, at_b = at_a[:, is_coarse], at_middle[:, is_coarse], at_b[:, is_coarse]
            a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
            at_a, at_b = np.append(at_a, at_middle, axis=1), np.append(at_middle, at_b, axis=1)
            middle = a + 0.5 * (b - a)
            at_middle = self.values(middle)
            times.append(middle)
            values.append(at_middle)
            ranks = np.append(ranks, np.ones(len(middle), dtype=ranks.dtype))
        every = np.concatenate(times)
        order = np.lexsort((ranks, every))
        return every[order], np.concatenate(values, axis=1)[:, order]

    def _deviates(self, at_a: Array, at_middle: Array, at_b: Array) -> NDArray[np.bool_]:
        """Return a mask of the parts on which the curve deviates visibly from a straight line."""
        with np.errstate(all="ignore"):
            deviation = np.abs(at_middle - 0.5 * (at_a + at_b)) / self._sizes[:, None]
        return np.asarray((deviation > _DEVIATION).any(axis=0))
