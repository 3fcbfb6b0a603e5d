"""This module represents a part of a run by polynomials on short intervals between events.

Integrals are sums over the points, and extrema are zeros of polynomials, so that no time grid is needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from hybridsim.errors import SimulationError

POINTS = 16  # Gauss points per piece: a polynomial of degree 15
_DENSE = 65  # points at which a slope is checked for changes of sign
_STEPS = 4  # steps of Newton's method, from the chord through two of these points
_SLOPES_PER_BATCH = 2**20  # slopes per batch

NODES, WEIGHTS = legendre.leggauss(POINTS)
TO_COEFFICIENTS = np.linalg.inv(legendre.legvander(NODES, POINTS - 1))
_DIFFERENTIATE = legendre.legder(np.eye(POINTS))  # coefficients to those of the slope
_GRID = np.linspace(-1.0, 1.0, _DENSE)
_SLOPES_ON_GRID = legendre.legvander(_GRID, POINTS - 2) @ _DIFFERENTIATE
_VALUES_ON_GRID = legendre.legvander(_GRID, POINTS - 1)
_AT_ENDS = legendre.legvander(np.array([-1.0, 1.0]), POINTS - 1)


@dataclass(frozen=True)
class Orbit:
    """Quantities over a part of a run, sampled on short intervals.

    Parameters
    ----------
    names : names of the Q quantities.
    starts, lengths : (K,) of the pieces, in time from the beginning of the run.
    segments : (K,) number of the run's segment that contains each piece.
    values : (K, POINTS, Q) at Gauss points; NaN where a quantity has no value or is infinite.
    is_smooth : (K, Q) whether the polynomial is accurate, and the values are not all equal.
    too_fast : names of quantities that no pieces resolve; they have no readings.
    """

    names: tuple[str, ...]
    starts: np.ndarray
    lengths: np.ndarray
    segments: np.ndarray
    values: np.ndarray
    is_smooth: np.ndarray
    too_fast: frozenset[str] = frozenset()

    @property
    def duration(self) -> float:
        """Duration of this part of the run."""
        return float(self.lengths.sum())

    @property
    def times(self) -> np.ndarray:
        """Times of the Gauss points (K, POINTS), from the start of the run."""
        return self.starts[:, None] + 0.5 * self.lengths[:, None] * (1.0 + NODES)

    def column(self, name: str) -> int:
        """Return the column of a quantity in `values`."""
        if name in self.too_fast:
            raise SimulationError(
                f"{name} varies too fast, or jumps too often, to be measured over a period",
                remedy="sample this quantity from steady.solution, and remove it from the model's "
                "outputs to measure the other quantities",
            )
        return self.names.index(name)

    def of(self, name: str) -> np.ndarray:
        """Return the values (K, POINTS) of one quantity at the Gauss points."""
        return self.values[:, :, self.column(name)]

    def series(self, name: str) -> np.ndarray:
        """Return the Legendre coefficients (K, POINTS) of one quantity."""
        return self.of(name) @ TO_COEFFICIENTS.T

    def integral(self, values: np.ndarray) -> float:
        """Return the integral over this part of the run, from the values (K, POINTS) at the Gauss points."""
        return float((values @ WEIGHTS) @ (0.5 * self.lengths))

    def mean(self, name: str) -> float:
        """Return the mean of a quantity over this part of the run."""
        return self.integral(self.of(name)) / self.duration

    def energy(self, name: str) -> float:
        """Return the integral of the square of a quantity over this part of the run."""
        return self.integral(self.of(name) ** 2)

    def harmonic(self, name: str, frequency: float) -> complex:
        """Return the amplitude c of q = Re(c exp(i w t)) by an integral over the orbit; for w = 0, c is the mean."""
        total = 0.0 + 0.0j
        parts = max(1, int(np.ceil(frequency * self.lengths.max() / POINTS * 2.0)))
        coefficients = self.series(name)
        for part in range(parts):  # shorter pieces, so that a fast wave is resolved on each
            local = (2.0 * part + 1.0 + NODES) / parts - 1.0
            values = coefficients @ legendre.legvander(local, POINTS - 1).T
            times = self.starts[:, None] + 0.5 * self.lengths[:, None] * (1.0 + local)
            wave = np.exp(-1j * frequency * (times - self.starts[0]))
            total += ((values * wave) @ WEIGHTS) @ (0.5 * self.lengths) / parts
        return (1.0 if frequency == 0.0 else 2.0) * total / self.duration

    @cached_property
    def extremes(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest value (Q,) of each quantity, including both sides of every jump."""
        low, high = self.values.min(axis=(0, 1)), self.values.max(axis=(0, 1))
        for _, series, is_smooth in self._blocks():
            # An inaccurate polynomial, as near a jump of sign(x), overshoots the quantity.
            ends = (series @ _AT_ENDS.T).reshape(*is_smooth.shape, 2)
            low = np.minimum(low, np.where(is_smooth, ends.min(axis=2), np.inf).min(axis=0))
            high = np.maximum(high, np.where(is_smooth, ends.max(axis=2), -np.inf).max(axis=0))
        with np.errstate(invalid="ignore"):  # a quantity with NaN has no extremes
            np.minimum.at(low, self.turns.quantity, self.turns.value)
            np.maximum.at(high, self.turns.quantity, self.turns.value)
        return low, high

    @cached_property
    def turns(self) -> Turns:
        """The extrema inside the intervals, at which the slope of a quantity changes its sign."""
        found = [self._turns_of(*block) for block in self._blocks()]
        return Turns(*(np.concatenate(parts) for parts in zip(*found, strict=True)))

    def _turns_of(self, first: int, series: np.ndarray, is_smooth: np.ndarray) -> Turns:
        slopes = series @ _SLOPES_ON_GRID.T
        signs = np.sign(slopes)
        row, g = np.nonzero(signs[:, :-1] * signs[:, 1:] < 0.0)
        before, after, chosen = slopes[row, g], slopes[row, g + 1], series[row]
        k, q = np.divmod(row, len(self.names))
        at = _zeros(chosen @ _DIFFERENTIATE.T, _GRID[g], _GRID[g + 1], before, after)
        turned = (chosen * legendre.legvander(at, POINTS - 1)).sum(axis=1)
        swings = np.flatnonzero(~is_smooth[k, q])
        k += first
        sampled = self.values[k[swings], :, q[swings]]
        turned[swings] = np.clip(turned[swings], sampled.min(axis=1), sampled.max(axis=1))
        times = self.starts[k] + 0.5 * self.lengths[k] * (1.0 + at)
        return Turns(q, k, times, turned, before < 0.0)

    def _blocks(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Yield batches of intervals: their numbers, Legendre coefficients (k * Q, POINTS) and masks (k, Q)."""
        block = max(1, _SLOPES_PER_BATCH // (_DENSE * len(self.names)))
        for first in range(0, max(len(self.values), 1), block):
            chosen = slice(first, first + block)
            rows = self.values[chosen].transpose(0, 2, 1).reshape(-1, POINTS)
            yield first, rows @ TO_COEFFICIENTS.T, self.is_smooth[chosen]

    def passes(self, name: str, level: float, upward: bool = True) -> np.ndarray:
        """Return the times, from the start of the run, at which a quantity passes a level in a direction."""
        series = self.series(name)
        series[:, 0] -= level
        series *= 1.0 if upward else -1.0
        values = series @ _VALUES_ON_GRID.T
        k, g = np.nonzero((values[:, :-1] < 0.0) & (values[:, 1:] >= 0.0))
        at = _zeros(series[k], _GRID[g], _GRID[g + 1], values[k, g], values[k, g + 1])
        found = (self.starts[k] + 0.5 * self.lengths[k] * (1.0 + at)).tolist()
        ends = values[:-1, -1] < 0.0, values[1:, 0] >= 0.0
        found += self.starts[1:][ends[0] & ends[1]].tolist()  # a jump, or rounding between two pieces
        return np.sort(np.array(found))


def _zeros(
    series: np.ndarray, low: np.ndarray, high: np.ndarray, at_low: np.ndarray, at_high: np.ndarray
) -> np.ndarray:
    """Return the zeros (m,) of Legendre series, each between two points with known values."""
    slope = series @ legendre.legder(np.eye(series.shape[1])).T
    at = low + (high - low) * at_low / (at_low - at_high)
    for _ in range(_STEPS):
        basis = legendre.legvander(at, series.shape[1] - 1)
        value = (series * basis).sum(axis=1)
        steepness = (slope * basis[:, : slope.shape[1]]).sum(axis=1)
        move = np.divide(value, steepness, out=np.zeros_like(value), where=steepness != 0.0)
        at = np.clip(at - move, low, high)
    return at


class Turns(NamedTuple):
    """Local extrema inside the intervals of an orbit, with the time and value of each extremum."""

    quantity: np.ndarray
    piece: np.ndarray
    t: np.ndarray
    value: np.ndarray
    is_minimum: np.ndarray
