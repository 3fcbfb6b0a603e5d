"""This module compares interpretations of the published method at three points, to find which choices matter."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.settings import DICHOTOMIES, SIGNS, Point, Size
from hybridsim.studies.he2026.measured.steady import by_steps, exact

MAP_POINTS = {
    "F0/N = 0.75, r = 0.6": Point(0.6, 0.75),
    "F0/N = 0.55, r = 0.64": Point(0.64, 0.55),
    "F0/N = 0.54, r = 0.55": Point(0.55, 0.54),
}


@dataclass(frozen=True)
class Readings:
    """Least, mean and greatest signed deviation of A from the exact value, for each interpretation and each point."""

    table: dict[str, dict[str, tuple[float, float, float]]]

    def to_plain(self) -> dict[str, Any]:
        """Return the deviations as plain values, for a JSON file."""
        return {
            name: {
                map_point: dict(zip(("least", "mean", "greatest"), values, strict=True))
                for map_point, values in row.items()
            }
            for name, row in self.table.items()
        }


def readings(size: Size, pool: Pool) -> Readings:
    """Run every interpretation of the published method at each of the three points."""
    variants = (*SIGNS, *DICHOTOMIES)
    truth = {map_point: exact(point).amplitude for map_point, point in MAP_POINTS.items()}
    tasks = list(itertools.product(variants, MAP_POINTS))
    found = pool.map(lambda task: by_steps(MAP_POINTS[task[1]], task[0], size.periods, size.last).A, tasks)
    table: dict[str, dict[str, tuple[float, float, float]]] = {v.name: {} for v in variants}
    for (variant, map_point), A in zip(tasks, found, strict=True):
        off = A / truth[map_point] - 1.0
        table[variant.name][map_point] = (float(np.min(off)), float(np.mean(off)), float(np.max(off)))
    return Readings(table)
