"""This module times a map of amplitude and energy by `exact`, by the published method and by shooting.

`exact` computes the map with `hybridsim.sweep`; the others compute point by point on the same threads.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from hybridsim.analysis.steady.steady_state import steady_state
from hybridsim.analysis.sweep import sweep
from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.settings import LITERAL, ZEROED, Point, Size, Variant
from hybridsim.studies.he2026.measured.steady import ExactState, Periods, by_steps, declared, exact

RATIO_SPAN, R_SPAN = (0.5, 1.5), (0.05, 2.0)
PERIODS = 100  # settling of both
_SEED = 2026
Result = TypeVar("Result")


@dataclass(frozen=True)
class Entry:
    """The cost and errors of one method: seconds per point on all threads, and errors of A and E."""

    seconds: float
    points: int
    A: np.ndarray
    E: np.ndarray

    def to_plain(self) -> dict[str, Any]:
        """Return the numbers as plain values, for a JSON file."""
        return {
            "milliseconds a point": 1e3 * self.seconds,
            "points timed": self.points,
            **{
                f"error of {name}, {what}": float(function(error))
                for name, error in (("A", self.A), ("E", self.E))
                for what, function in (("median", np.median), ("largest", np.max))
            },
            "share of points with A off by more than 1 %": float(np.mean(self.A > 0.01)),
        }


@dataclass(frozen=True)
class TimedMap:
    """The costs and errors of all methods on a map with side x side points."""

    side: int
    entries: dict[str, Entry]

    def to_plain(self) -> dict[str, Any]:
        """Return the costs and errors as plain values, for a JSON file."""
        base = self.entries["exact"].seconds
        return {
            "map": {"F0/N": RATIO_SPAN, "r": R_SPAN, "points": [self.side, self.side]},
            "settling": f"{PERIODS} periods from rest",
            **{name: entry.to_plain() for name, entry in self.entries.items()},
            "time over that of exact": {
                name: entry.seconds / base for name, entry in self.entries.items() if name != "exact"
            },
        }


def time_map(size: Size, pool: Pool) -> TimedMap:
    """Time all methods on the same threads: `exact` on the whole map, the other methods at random points."""
    side = size.timed_count
    grid = [
        [Point(float(r), float(q)) for r in np.linspace(*R_SPAN, side)]
        for q in np.linspace(*RATIO_SPAN, side)
    ]
    points = [point for row in grid for point in row]
    chosen = np.random.default_rng(_SEED).choice(len(points), size.timed_sample, replace=False)
    sample = [points[i] for i in chosen]
    _map(grid[:2], pool, 0.0, 0.0)  # one-time compiling and caching does not count
    for variant in (LITERAL, ZEROED):
        by_steps(points[-1], variant, 2, 1)
    entries: dict[str, Entry] = {}
    seconds, whole = _map(grid, pool, 0.0, 0.3)
    found: dict[str, tuple[float, int, list[tuple[float, float]]]] = {
        "exact": (seconds, len(points), [whole[i] for i in chosen])
    }
    for k, variant in enumerate((LITERAL, ZEROED)):
        begin = 0.3 + 0.25 * k
        seconds, rows = _timed(pool, _published(variant), sample, begin, begin + 0.25)
        found[f"rk4-dichotomy, {variant.name}"] = (
            seconds,
            len(sample),
            [(row.amplitude, row.energy) for row in rows],
        )
    # any thread may meet code that is not compiled yet
    pool.map(_by_shooting, sample, 0.8, 0.87)
    seconds, orbits = _timed(pool, _by_shooting, sample, 0.87, 0.95)
    found["shooting"] = (seconds, len(sample), orbits)
    settled = pool.map(exact, sample, 0.95, 1.0)
    for name, (seconds, count, values) in found.items():
        entries[name] = Entry(seconds, count, *_errors(values, settled))
    return TimedMap(side, entries)


def _map(
    rows: list[list[Point]], pool: Pool, begin: float, end: float
) -> tuple[float, list[tuple[float, float]]]:
    """Time many periods from rest; return the seconds per point, and A and E of the last period of each point."""

    def tell(done: int, total: int, _: str) -> None:
        pool.tell(begin + (end - begin) * done / total)

    began = time.perf_counter()
    found = sweep(
        declared("dfcs"),
        {"F0": [row[0].force for row in rows], "omega": [point.omega for point in rows[0]]},
        ["amplitude.x", "energy.x"],
        after=PERIODS,
        workers=pool.workers,
        progress=tell,
    )
    A, E = found["amplitude.x"].ravel().tolist(), found["energy.x"].ravel().tolist()
    return (time.perf_counter() - began) / len(A), list(zip(A, E, strict=True))


def _published(variant: Variant) -> Callable[[Point], Periods]:
    return lambda point: by_steps(point, variant, PERIODS, 1)


def _timed(
    pool: Pool, function: Callable[[Point], Result], points: Sequence[Point], begin: float, end: float
) -> tuple[float, list[Result]]:
    began = time.perf_counter()
    found = pool.map(function, points, begin, end)
    return (time.perf_counter() - began) / len(points), found


def _by_shooting(point: Point) -> tuple[float, float]:
    orbit = steady_state(declared("dfcs"), params=point.params, integrator="exact")
    return float(orbit.amplitude["x"]), float(orbit.energy["x"])


def _errors(values: list[tuple[float, float]], settled: list[ExactState]) -> tuple[np.ndarray, np.ndarray]:
    moving = np.array([s.amplitude > 0.0 for s in settled])
    pairs = np.array(values)[moving]
    truth = np.array([(s.amplitude, s.energy) for s in settled])[moving]
    errors = np.abs(pairs / truth - 1.0)
    return errors[:, 0], errors[:, 1]
