"""This module measures a whole run in the same way as a period of a steady motion, and finds first passages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre

from hybridsim.analysis.polynomials.orbit import NODES, Orbit
from hybridsim.analysis.polynomials.resolving import orbit_of
from hybridsim.analysis.steady.measures import Measures
from hybridsim.solution import Solution

_ENDS = np.array([-1.0, 1.0])
_BISECTIONS = 200  # more than enough for doubles
_ROUNDING = (
    1e-12  # of the largest value of the run, and of the level: a quantity beyond the level by less touches it
)


class OverRun(Measures):
    """The measures of a steady state, computed over a whole run instead of a period.

    Parameters
    ----------
    chosen : names of the quantities to measure, by default all; few take less time.
    """

    period = math.nan

    def __init__(self, solution: Solution, chosen: Sequence[str] | None = None) -> None:
        self.solution, self._chosen = solution, chosen

    @cached_property
    def _orbit(self) -> Orbit:
        return orbit_of(self.solution, self._chosen)

    def _extreme(self, name: str, side: int) -> float:
        """Return the least or greatest value of one quantity, without searching all other quantities."""
        return float(self._alone(name).extremes[side][0])

    def _alone(self, name: str) -> Orbit:
        """Return an orbit that contains only one quantity."""
        if name not in self._found:
            orbit = self._orbit
            q = slice(orbit.column(name), orbit.column(name) + 1)
            self._found[name] = replace(
                orbit, names=(name,), values=orbit.values[:, :, q], is_smooth=orbit.is_smooth[:, q]
            )
        return self._found[name]

    @cached_property
    def _found(self) -> dict[str, Orbit]:
        return {}

    @property
    def dissipated(self) -> Mapping[str, float]:  # type: ignore[override]  # the run knows it
        """Energy that friction dissipates during the run, by contact."""
        return self.solution.dissipated

    def stops(self, component: str) -> float:
        """Return how often a component changes to its holding mode; holding from the start does not count."""
        hold = self.held_mode(component)
        modes = [i.mode for i in self.solution.modes[component] if i.t1 > i.t0]
        return float(sum(before != hold == after for before, after in pairwise(modes)))

    def first_passage(self, name: str, level: float, is_upward: bool) -> float:
        """Return the first time at which a quantity is beyond a level, or infinity if there is no such time.

        It is above the level if `is_upward`, otherwise below it. Between two extrema a quantity passes a level at most
        once, so that no passage is missed. A quantity that only touches the level, within rounding, does not pass it.
        """
        found = first_passage(self._alone(name), level, 1.0 if is_upward else -1.0)
        return self.solution.t_start + found


def first_passage(orbit: Orbit, level: float, sign: float) -> float:
    """Return the first time, from the start of the run, at which sign*(quantity - level) > 0, or infinity.

    The orbit has one quantity. Where no polynomial represents it, the time is that of a Gauss point.
    """
    intervals, local, values = _knots(orbit)
    largest = np.fmax.reduce(np.abs(orbit.values), axis=None, initial=abs(level))
    beyond = np.flatnonzero(sign * (values - level) > _ROUNDING * largest)
    if not len(beyond):
        return math.inf
    j, k = int(beyond[0]), int(intervals[beyond[0]])
    at = float(local[j])
    if j == 0 or intervals[j - 1] != k:  # the run begins beyond the level, or the quantity jumps
        at = -1.0
    elif orbit.is_smooth[k, 0]:
        at = _zero(orbit.series(orbit.names[0])[k], level, float(local[j - 1]), at, sign)
    return float(orbit.starts[k] + 0.5 * orbit.lengths[k] * (1.0 + at))


def _knots(orbit: Orbit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points in order of time between which a quantity is monotone: interval, local time, and value."""
    smooth, turns = orbit.is_smooth[:, 0], orbit.turns
    numbers = np.arange(len(smooth))
    ends = orbit.series(orbit.names[0])[smooth] @ legendre.legvander(_ENDS, len(NODES) - 1).T
    of_turns = 2.0 * (turns.t - orbit.starts[turns.piece]) / orbit.lengths[turns.piece] - 1.0
    is_known = smooth[turns.piece]
    intervals = np.concatenate(
        [np.repeat(numbers[smooth], 2), turns.piece[is_known], np.repeat(numbers[~smooth], len(NODES))]
    )
    local = np.concatenate(
        [np.tile(_ENDS, int(smooth.sum())), of_turns[is_known], np.tile(NODES, int((~smooth).sum()))]
    )
    values = np.concatenate([ends.ravel(), turns.value[is_known], orbit.values[~smooth, :, 0].ravel()])
    order = np.lexsort((local, intervals))
    return intervals[order], local[order], values[order]


def _zero(series: np.ndarray, level: float, low: float, high: float, sign: float) -> float:
    """Return the point at which a Legendre series passes a level between two points, by bisection."""
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if sign * (float(legendre.legval(middle, series)) - level) > 0.0:
            high = middle
        else:
            low = middle
    return high
