"""This module follows directions of change along a motion, and measures how much each of them grows.

The directions are made orthogonal again after each part of the motion (G. Benettin, L. Galgani, A. Giorgilli,
J.-M. Strelcyn, Meccanica 15 (1980) 9, doi:10.1007/BF02128236). Events are passed by the saltation matrices of
P. C. Mueller, Chaos, Solitons and Fractals 5 (1995) 1671, doi:10.1016/0960-0779(94)00170-U.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hybridsim.analysis.steady.motion import Motion, Point, point_at_end
from hybridsim.analysis.variations.carried import Carrier
from hybridsim.analysis.variations.directions import Directions
from hybridsim.analysis.variations.refused import refuse
from hybridsim.errors import SimulationError

_RESOLVED = 1e-11  # of the largest factor of a part: a smaller one cannot be told from rounding errors
_LARGEST = 1e100  # factor of a part
_HALVINGS = 12  # of a part whose factors are not resolved
_PARTS, _PERIODS = 60, 5  # parts of a motion whose growth is measured, and periods in each
_LONGER = 4  # as many parts are followed at most
_ALIGNED = 10  # parts after which the direction of a change is the one that grows most
# A trend decides early if it is so many times as large as the variation about it, or a variation that is at most
# _SMALL if the trend is at most half of it. In the end the factors are 2 and 1. No variation is below _LEAST.
_CLEAR, _SMALL, _LEAST = 4.0, 0.5, 1e-2


class Growth:
    """Orthogonal directions of change that are carried along a motion.

    Parameters
    ----------
    motion : the model and the options of its runs.
    point : the start of the motion.
    count : number M of directions.
    scale : (n + d,) sizes of the states and discrete states, in which lengths and angles are measured.
    """

    def __init__(self, motion: Motion, point: Point, count: int, scale: np.ndarray) -> None:
        self.motion, self.point, self.scale = motion, point, scale[:, None]
        generic = np.random.default_rng(0).standard_normal((len(scale), count))
        generic[:, 0] = 1.0
        self.directions = np.linalg.qr(generic)[0]
        surfaces = [c for c in motion.model.all_components() if c.surface is not None and c.surface.hold]
        self.holds = {c.name: c.surface.hold for c in surfaces if c.surface is not None}
        self.held_since: dict[str, float] = {}  # since when components are in stick, or slide on a surface
        self.count, self.numbers = count, np.arange(count)  # the numbers of the directions that are followed

    def over(self, duration: float, halvings: int = _HALVINGS) -> np.ndarray:
        """Follow the motion for a duration, and return the logarithm (M,) of each direction's growth.

        A direction that shrinks to nothing, or to less than rounding errors of the others in a small part of the
        duration, has the logarithm -inf and is not followed any longer.
        """
        start, before = self.point, self.directions
        change = self._change(duration)
        self.directions, factors, is_resolved = _orthogonal(change)
        if halvings and not (is_resolved.all() and factors.max(initial=0.0) < _LARGEST):
            self.point, self.directions = start, before
            return self.over(0.5 * duration, halvings - 1) + self.over(0.5 * duration, halvings - 1)
        while not is_resolved.all():  # a direction that others contain is left out, and then the next one
            others = np.arange(len(factors)) != np.argmin(is_resolved)
            change, self.numbers = change[:, others], self.numbers[others]
            self.directions, factors, is_resolved = _orthogonal(change)
        logarithms = np.full(self.count, -np.inf)
        logarithms[self.numbers] = np.log(factors)
        return logarithms

    def _change(self, duration: float) -> np.ndarray:
        """Follow the motion for a duration, and return the directions at its end."""
        n, motion, before = len(self.point.x), self.motion, self.directions * self.scale
        solution = motion.run(self.point, duration)
        for name, hold in self.holds.items():
            if all(interval.mode == hold for interval in solution.modes[name]):
                self.held_since.setdefault(name, self.point.at)
            else:
                self.held_since.pop(name, None)
        self.point = replace(point_at_end(solution), at=self.point.at + duration)
        if not before.shape[1]:
            return before
        refuse(solution)
        constant = np.zeros((len(motion.model.parameters), before.shape[1]))
        carried = Carrier(solution).carry(Directions(before[:n], before[n:], constant))
        change = np.concatenate([carried.x, carried.discrete]) / self.scale
        if not np.isfinite(change).all():
            raise SimulationError(
                f"the derivatives of the motion are not finite between t = {solution.t_start:.9g} and t = "
                f"{solution.t_end:.9g}"
            )
        return np.asarray(change)


def _orthogonal(change: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return orthogonal directions, the growth factor of each, and whether the factor exceeds rounding errors."""
    directions, triangle = np.linalg.qr(change)
    factors = np.abs(np.diag(triangle))
    return directions, factors, factors > _RESOLVED * factors.max(initial=0.0)


class LongGrowth(NamedTuple):
    """The growth of a small change along a motion.

    exponent: its rate per unit of time; logarithm: the growth over the periods that were followed. is_exponential: the
    change grows at a steady rate; is_bounded: its size only varies.
    """

    exponent: float
    logarithm: float
    periods: int
    is_exponential: bool
    is_bounded: bool


def long_growth(motion: Motion, start: Point, period: float) -> LongGrowth:
    """Follow a small change over 300 periods, or over up to 1200 periods until its growth is clear.

    On a torus the change only varies. This variation may take hundreds of periods, and looks like growth until then.
    """
    growth = Growth(motion, start, 1, np.ones(len(start.values)))
    logarithms = [0.0]
    for last in (False,) * (_LONGER - 1) + (True,):
        for _ in range(_PARTS):
            logarithms.append(logarithms[-1] + float(growth.over(_PERIODS * period)[0]))
        aligned = np.array(logarithms[_ALIGNED:])
        periods = _PERIODS * (len(logarithms) - 1)
        if not np.isfinite(aligned).all():
            return LongGrowth(-np.inf, -np.inf, periods, False, False)
        trend, variation = _trend(aligned)
        exponent = trend / (_PERIODS * period * (len(aligned) - 1))
        most = variation if last else 0.5 * variation if variation <= _SMALL else 0.0
        is_clear = abs(trend) > (2.0 if last else _CLEAR) * variation
        is_bounded = abs(trend) <= most
        if last or is_clear or is_bounded:
            break
    halves = np.diff(aligned[[0, len(aligned) // 2, -1]])
    # growth by a power of time becomes slower
    is_exponential = bool(is_clear and trend > 0.0 and halves[1] > 0.5 * halves[0])
    return LongGrowth(exponent, logarithms[-1], periods, is_exponential, is_bounded)


def _trend(logarithms: np.ndarray) -> tuple[float, float]:
    """Return the change of the straight line closest to some values, and the range of the values about this line."""
    at = np.linspace(-0.5, 0.5, len(logarithms))
    slope = float(at @ logarithms / (at @ at))
    return slope, max(float(np.ptp(logarithms - slope * at)), _LEAST)
