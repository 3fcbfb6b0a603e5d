"""This module runs every reading of the published method at three points, to find the choices that matter."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.settings import DICHOTOMIES, SIGNS, Point, Size
from hybridsim.studies.he2026.measured.steady import by_steps, exact

PLACES = {
    "F0/N = 0.75, r = 0.6": Point(0.6, 0.75),
    "F0/N = 0.55, r = 0.64": Point(0.64, 0.55),
    "F0/N = 0.54, r = 0.55": Point(0.55, 0.54),
}


@dataclass(frozen=True)
class Readings:
    """By reading and place: least, mean, greatest signed deviation of A from the exact one over the last periods."""

    table: dict[str, dict[str, tuple[float, float, float]]]

    def to_plain(self) -> dict[str, Any]:
        """Return the entries for the file of verdicts."""
        return {
            name: {
                place: dict(zip(("least", "mean", "greatest"), values, strict=True))
                for place, values in row.items()
            }
            for name, row in self.table.items()
        }


def readings(size: Size, pool: Pool) -> Readings:
    """Run all readings at all places."""
    variants = (*SIGNS, *DICHOTOMIES)
    truth = {place: exact(point).amplitude for place, point in PLACES.items()}
    tasks = list(itertools.product(variants, PLACES))
    found = pool.map(lambda task: by_steps(PLACES[task[1]], task[0], size.periods, size.last).A, tasks)
    table: dict[str, dict[str, tuple[float, float, float]]] = {v.name: {} for v in variants}
    for (variant, place), A in zip(tasks, found, strict=True):
        off = A / truth[place] - 1.0
        table[variant.name][place] = (float(np.min(off)), float(np.mean(off)), float(np.max(off)))
    return Readings(table)
