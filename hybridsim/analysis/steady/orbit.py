"""A stretch of a run as polynomials: each quantity on Gauss points of small pieces, none of which crosses an event.

Integrals are then sums over the points, and extrema are zeros of polynomials: nothing is sampled on a grid of time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import legendre

if TYPE_CHECKING:
    from hybridsim.solution import Solution

POINTS = 16  # of Gauss on a piece: a polynomial of degree 15
_TAIL = 4  # last coefficients, which tell whether the polynomial holds
_RESOLVED = 1e-13  # they are below that part of the largest value of the whole stretch
_HOLDS = 1e-6  # where they are not even below that part, the polynomial is no picture of the quantity
_NOISE = 1e-9  # below that part, what halving a piece does not make smaller is rounding
_SMALLER = 0.7
_HALVINGS = 24
_PROBED, _TINY = 16, 2.0**-16  # pieces, and the share of each, from which rounding is told
_ASIDE = (0.382, 0.618)  # where in a piece: not where symmetry may put a jump, and never at one jump twice
_ROUNDINGS = 4.0  # times what was met there
_DENSE = 65  # points at which a slope is looked at for changes of sign
_STEPS = 4  # of Newton's method, from the chord through two of these points

NODES, WEIGHTS = legendre.leggauss(POINTS)
_TO_COEFFICIENTS = np.linalg.inv(legendre.legvander(NODES, POINTS - 1))
_DIFFERENTIATE = legendre.legder(np.eye(POINTS))  # coefficients to those of the slope
_GRID = np.linspace(-1.0, 1.0, _DENSE)
_SLOPES_ON_GRID = legendre.legvander(_GRID, POINTS - 2) @ _DIFFERENTIATE
_VALUES_ON_GRID = legendre.legvander(_GRID, POINTS - 1)
_AT_ENDS = legendre.legvander(np.array([-1.0, 1.0]), POINTS - 1)


@dataclass(frozen=True)
class Orbit:
    """Quantities over a stretch of a run.

    Parameters
    ----------
    names : of the Q quantities.
    starts, lengths : (K,) of the pieces, in time counted from the beginning of the run.
    segments : (K,) number of the run's segment that each piece lies in.
    values : (K, POINTS, Q) at Gauss points.
    """

    names: tuple[str, ...]
    starts: np.ndarray
    lengths: np.ndarray
    segments: np.ndarray
    values: np.ndarray

    @cached_property
    def coefficients(self) -> np.ndarray:
        """Legendre coefficients (K, POINTS, Q) on each piece."""
        return np.einsum("ij,kjq->kiq", _TO_COEFFICIENTS, self.values)

    @property
    def duration(self) -> float:
        """Length of the stretch."""
        return float(self.lengths.sum())

    @property
    def times(self) -> np.ndarray:
        """Of the points (K, POINTS), counted from the beginning of the run."""
        return self.starts[:, None] + 0.5 * self.lengths[:, None] * (1.0 + NODES)

    def of(self, name: str) -> np.ndarray:
        """Values (K, POINTS) of one quantity."""
        return self.values[:, :, self.names.index(name)]

    def integral(self, values: np.ndarray) -> float:
        """Integral over the stretch of something at the Gauss points (K, POINTS)."""
        return float((values @ WEIGHTS) @ (0.5 * self.lengths))

    def harmonic(self, name: str, frequency: float) -> complex:
        """2/T times the integral of q(t) exp(-i w t): the amplitude c of q = Re(c exp(i w t)); the mean for w = 0."""
        total = 0.0 + 0.0j
        parts = max(1, int(np.ceil(frequency * self.lengths.max() / POINTS * 2.0)))
        coefficients = self.coefficients[:, :, self.names.index(name)]
        for part in range(parts):  # shorter pieces, so that a fast wave is resolved on each
            local = (2.0 * part + 1.0 + NODES) / parts - 1.0
            values = coefficients @ legendre.legvander(local, POINTS - 1).T
            times = self.starts[:, None] + 0.5 * self.lengths[:, None] * (1.0 + local)
            wave = np.exp(-1j * frequency * (times - self.starts[0]))
            total += ((values * wave) @ WEIGHTS) @ (0.5 * self.lengths) / parts
        return (1.0 if frequency == 0.0 else 2.0) * total / self.duration

    @cached_property
    def extremes(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest value (Q,) of each quantity, both sides of every jump included."""
        # around a jump, as of sign(x), the polynomial of the last piece swings beyond what the quantity ever is
        tails = np.abs(self.coefficients[:, -_TAIL:]).max(axis=1)
        holds = tails <= _HOLDS * np.abs(self.values).max(axis=(0, 1))
        ends = np.einsum("ij,kjq->kiq", _AT_ENDS, self.coefficients)
        ends = np.where(holds[:, None], ends, self.values[:, [0, -1]])
        sampled = np.concatenate([ends, self.values], axis=1)
        low, high = sampled.min(axis=(0, 1)), sampled.max(axis=(0, 1))
        turns, kept = self.turns, holds[self.turns.piece, self.turns.quantity]
        np.minimum.at(low, turns.quantity[kept], turns.value[kept])
        np.maximum.at(high, turns.quantity[kept], turns.value[kept])
        return low, high

    @cached_property
    def turns(self) -> Turns:
        """Where the slope of a quantity changes its sign inside a piece."""
        slopes = np.einsum("gj,kjq->kgq", _SLOPES_ON_GRID, self.coefficients)
        k, g, q = np.nonzero(slopes[:, :-1] * slopes[:, 1:] < 0.0)
        before, after = slopes[k, g, q], slopes[k, g + 1, q]
        series = self.coefficients[k, :, q]
        first = series @ _DIFFERENTIATE.T
        at, last = _zeros(first, _GRID[g], _GRID[g + 1], before, after), POINTS - 1
        values = (series * legendre.legvander(at, last)).sum(axis=1)
        times = self.starts[k] + 0.5 * self.lengths[k] * (1.0 + at)
        return Turns(q, k, times, values, before < 0.0)

    def rises_through(self, name: str, level: float) -> np.ndarray:
        """Times, from the beginning of the run, at which a quantity rises through a level."""
        q = self.names.index(name)
        series = self.coefficients[:, :, q].copy()
        series[:, 0] -= level
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
    """Zeros (m,) of Legendre series (m, degree + 1), each between two points where it has those values."""
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
    """Local extrema inside pieces: number of the quantity and of the piece, time, value, whether it is a minimum."""

    quantity: np.ndarray
    piece: np.ndarray
    t: np.ndarray
    value: np.ndarray
    is_minimum: np.ndarray


class Sampler:
    """Values of states and other quantities inside the segments of a run.

    guards: take the values of all guards too, under their numbers ("guard 3"), and of the surfaces of contacts
    ("velocity of f").
    """

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        self.system = system = solution._system
        self.segments = solution._segments
        self.quantities = tuple(q for q in system.quantities if " in " not in q)
        self.discrete = tuple(d.name for d in system.model.discrete)
        self.guards = system.guard_count if system.has_tape else 0
        contacts = [system.automata[c].name for c in system.surface_of]
        self.names = (
            *system.names,
            *self.quantities,
            *self.discrete,
            *(f"velocity of {name}" for name in contacts),
            *(f"guard {g}" for g in range(self.guards)),
        )

    def __call__(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Values (k, Q) in the segments of these numbers (k,), at local times (k,)."""
        x = self.segments.states(index, s)
        out = np.empty((len(s), len(self.names)))
        out[:, : self.system.n] = x
        order = np.argsort(index, kind="stable")
        numbers, first = np.unique(index[order], return_index=True)
        for i, chosen in zip(numbers.tolist(), np.split(order, first[1:]), strict=True):
            out[chosen, self.system.n :] = self._others(i, s[chosen], np.ascontiguousarray(x[chosen]))
        return out

    def _others(self, i: int, s: np.ndarray, x: np.ndarray) -> np.ndarray:
        system, segment = self.system, self.segments[i]
        named = self.solution._quantities((*self.quantities, *self.discrete), segment, s, x)
        columns = [np.reshape(named, (-1, len(s))).T]
        if not system.has_tape:  # of Python functions: no contacts, and guards that are no series
            return columns[0]
        surfaces = system.rows("surfaces", len(system.surface_of), s, x, segment.p, segment.z)
        guards = system.rows("guards", system.guard_count, s, x, segment.p, segment.z)
        guards[:, ~system.active(segment.z)] = np.inf
        return np.concatenate([*columns, surfaces, guards], axis=1)


def orbit_of(solution: Solution) -> Orbit:
    """A run, or what was kept of it, as polynomials; forward in time."""
    sample = Sampler(solution)
    index, s, _ = solution._segments.knots()
    same = (index[1:] == index[:-1]) & (s[1:] > s[:-1])
    segments, begins, ends = index[:-1][same], s[:-1][same], s[1:][same]
    finished: list[tuple[np.ndarray, ...]] = []
    scale = np.zeros(len(sample.names))
    rounding = _ROUNDINGS * _rounding(sample, segments, begins, ends)
    before = np.full((len(segments), len(sample.names)), np.inf)  # tails on the pieces that were halved
    for halving in range(_HALVINGS):
        values, tails = _sampled(sample, segments, begins, ends)
        scale = np.maximum(scale, np.abs(values).max(axis=(0, 1)))
        is_rounding = (tails <= _NOISE * scale) & (tails >= _SMALLER * before)
        is_resolved = tails <= np.maximum(_RESOLVED * scale, rounding)
        good = (is_resolved | is_rounding).all(axis=1) | (halving == _HALVINGS - 1)
        finished.append((segments[good], begins[good], ends[good], values[good]))
        if good.all():
            break
        segments, begins, ends, before = (part[~good] for part in (segments, begins, ends, tails))
        middle = 0.5 * (begins + ends)
        segments, before = np.concatenate([segments, segments]), np.concatenate([before, before])
        begins, ends = np.concatenate([begins, middle]), np.concatenate([middle, ends])
    segments, begins, ends, values = (np.concatenate(parts) for parts in zip(*finished, strict=True))
    order = np.lexsort((begins, segments))
    origins = solution._segments.origins()[segments[order]]
    starts = (origins[:, 0] - solution.t_start) + (origins[:, 1] + begins[order])
    return Orbit(sample.names, starts, (ends - begins)[order], segments[order], values[order])


def _sampled(
    sample: Sampler, segments: np.ndarray, begins: np.ndarray, ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values (K, POINTS, Q) on pieces, and the largest of the last coefficients (K, Q) there."""
    points = begins[:, None] + 0.5 * (ends - begins)[:, None] * (1.0 + NODES)
    values = sample(np.repeat(segments, POINTS), points.ravel()).reshape(len(segments), POINTS, -1)
    values[np.isinf(values)] = 0.0  # guards of other modes
    return values, np.abs(np.einsum("ij,kjq->kiq", _TO_COEFFICIENTS[-_TAIL:], values)).max(axis=1)


def _rounding(sample: Sampler, segments: np.ndarray, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The last coefficients (Q,) that rounding alone makes: on a piece so short that nothing else is left in them.

    Of a difference of large terms, such as a balance of energy, it may be all there is: no piece is short enough then.
    """
    probed = np.unique(np.linspace(0, len(segments) - 1, _PROBED).astype(int)) if len(segments) else segments
    found = []
    for share in _ASIDE:
        starts = begins[probed] + share * (ends - begins)[probed]
        lengths = _TINY * (ends - begins)[probed]
        found.append(_sampled(sample, segments[probed], starts, starts + lengths)[1])
    return np.minimum(*found).max(axis=0, initial=0.0)
