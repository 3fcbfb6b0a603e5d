"""This module samples the dense output of a run for the curves of a report."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hybridsim.plot.shared.curve_samples import DEEPEST, sample_curves, sizes_of
from hybridsim.solution import Solution

Array = NDArray[np.float64]

_PARTS = 4  # first division of each step
_LEAST_KNOTS = 513  # of a run: a closed form may take one step of any length
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
        return sizes_of(self.values(times))

    def along(
        self, knots: Array, most: float = np.inf, parts: int = _PARTS, deepest: int = DEEPEST
    ) -> tuple[Array, Array]:
        """Return times (k,) and values (n, k) between the first and last of some ascending knots.

        The knots have to contain all events and jumps of inputs between them. At each of these there are two entries,
        before and after it. Each interval between knots is divided into equal parts, and these as far as the curves
        need it, up to about `most` samples.
        """
        if len(knots) < 2:
            return knots, self.values(knots)
        a = (knots[:-1, None] + np.diff(knots)[:, None] * (np.arange(parts) / parts)).ravel()
        inner = np.append(a, knots[-1])
        is_break = np.isin(inner[1:], self._breaks)
        times, values, _ = sample_curves(self.values, inner, is_break, self._sizes, most, deepest)
        return times, values
