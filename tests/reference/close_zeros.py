"""Zeros of sums of polynomials, exponentials and waves, close pairs and near misses too, in multiple precision."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import mpmath
import numpy as np

GRID = 400  # points at which the search begins
CLOSE = 0.01  # of the span: zeros closer than this are a pair


@dataclass(frozen=True)
class Term:
    """Re(weight t**power exp(rate t))."""

    weight: mpmath.mpc
    power: int
    rate: mpmath.mpc


@dataclass
class Closed:
    """A sum of terms: in doubles on grids, and with two derivatives in multiple precision."""

    terms: list[Term]
    weights: np.ndarray = field(init=False)
    powers: np.ndarray = field(init=False)
    rates: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.weights = np.array([complex(a.weight) for a in self.terms])
        self.powers = np.array([a.power for a in self.terms])
        self.rates = np.array([complex(a.rate) for a in self.terms])

    def parts(self, t: np.ndarray) -> np.ndarray:
        """Each term (terms, times)."""
        waves = np.exp(self.rates[:, None] * t) * t ** self.powers[:, None]
        return np.real(self.weights[:, None] * waves)

    def slopes(self, t: np.ndarray) -> np.ndarray:
        """The first derivative (times,) in doubles."""
        low = np.where(self.powers[:, None] > 0, t ** np.maximum(self.powers - 1, 0)[:, None], 0.0)
        grown = self.powers[:, None] * low + self.rates[:, None] * t ** self.powers[:, None]
        return np.real(self.weights[:, None] * grown * np.exp(self.rates[:, None] * t)).sum(axis=0)

    def exactly(self, t: mpmath.mpf) -> tuple[mpmath.mpf, mpmath.mpf, mpmath.mpf]:
        """Value, slope and bend."""
        value = slope = bend = mpmath.mpf(0)
        for a in self.terms:
            k, wave = a.power, a.weight * mpmath.exp(a.rate * t)
            p = [t ** (k - j) if k >= j else 0 for j in range(3)]
            value += (wave * p[0]).real
            slope += (wave * (k * p[1] + a.rate * p[0])).real
            bend += (wave * (k * (k - 1) * p[2] + 2 * k * a.rate * p[1] + a.rate**2 * p[0])).real
        return value, slope, bend


@dataclass(frozen=True)
class Extreme:
    """A place where a guard comes close to zero and turns back; depth > 0: beyond zero, with its two zeros."""

    t: float
    depth: float
    zeros: tuple[float, float] | None


@dataclass(frozen=True)
class Truth:
    """What a guard does over a span: its single zeros with slopes, its close extremes, its size."""

    singles: list[tuple[float, float]]
    extremes: list[Extreme]
    size: float
    starts_up: bool


def truth_of(guard: Closed, span: float, grid: int = GRID) -> Truth:
    """All zeros: sign changes on a grid, and extremes between them in multiple precision."""
    t = np.linspace(0.0, span, grid + 1)
    parts = guard.parts(t)
    g, size = parts.sum(axis=0), float(np.abs(parts).sum(axis=0).max())
    slope = guard.slopes(t)
    singles: list[float] = []
    extremes: list[Extreme] = []
    sign = np.sign(g)
    turns = np.flatnonzero(
        (slope[:-1] * slope[1:] <= 0.0) & (np.minimum(np.abs(g[:-1]), np.abs(g[1:])) < 0.1 * size)
    )
    for i in turns:
        t_turn = bisected(guard.slopes, t[i], t[i + 1])
        with mpmath.workdps(40):
            place = mpmath.mpf(t_turn)
            for _ in range(3):
                value, first, second = guard.exactly(place)
                place -= first / second
            value, _, bend = guard.exactly(place)
            toward = mpmath.sign(bend)  # a minimum where the bend is positive
            depth = -value * toward  # beyond zero as seen from either side
            if depth <= 0:
                if -depth < 1e-3 * size:
                    extremes.append(Extreme(float(place), float(depth), None))
                continue
            half = mpmath.sqrt(2 * depth / abs(bend))
            if half > CLOSE * span:
                continue  # two single zeros
            zeros = []
            for way in (-1, 1):
                zero = place + way * half
                for _ in range(12):
                    value, first, _ = guard.exactly(zero)
                    zero -= value / first
                zeros.append(float(zero) if abs(value) < mpmath.mpf(10) ** -25 * size else math.nan)
            if not (0.0 < zeros[0] < place < zeros[1] < span) or zeros[1] - zeros[0] > CLOSE * span:
                continue
            extremes.append(Extreme(float(place), float(depth), (zeros[0], zeros[1])))
    shared = Counter(z for e in extremes if e.zeros for z in set(np.round(np.array(e.zeros) / span, 9)))
    for e in [e for e in extremes if e.zeros and max(shared[np.round(z / span, 9)] for z in e.zeros) > 1]:
        extremes.remove(e)  # three zeros in a row are no pair
        singles += [z for z in e.zeros or () if all(abs(z - other) > 1e-6 * span for other in singles)]
    for i in np.flatnonzero(sign[:-1] * sign[1:] <= 0.0):
        if any(e.zeros and any(t[i] - 1e-12 <= z <= t[i + 1] + 1e-12 for z in e.zeros) for e in extremes):
            continue
        zero = bisected(lambda s: guard.parts(s).sum(axis=0), t[i], t[i + 1])
        if all(abs(zero - other) > 1e-6 * span for other in singles):
            singles.append(zero)
    slopes = np.abs(guard.slopes(np.array(singles))) if singles else np.zeros(0)
    return Truth(sorted(zip(singles, slopes.tolist(), strict=True)), extremes, size, bool(g[0] > 0.0))


def bisected(f: Callable[[np.ndarray], np.ndarray], a: float, b: float) -> float:
    """A zero of f between two points, by cuts in 17."""
    sign = np.sign(f(np.array([a]))[0]) or -np.sign(f(np.array([b]))[0])
    while b - a > 4e-16 * max(abs(a), abs(b)):
        t = np.linspace(a, b, 18)
        beyond = np.flatnonzero(f(t)[1:] * sign <= 0.0)
        i = int(beyond[0]) if len(beyond) else 16
        if not (t[i] > a or t[i + 1] < b):
            break
        a, b = float(t[i]), float(t[i + 1])
    return 0.5 * (a + b)
