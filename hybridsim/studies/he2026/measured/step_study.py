"""This module varies the step and the velocity interval, to separate numerical artefacts from physics."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.settings import MATTERING, SIGNS, STEPS_PER_PERIOD, Point, Size
from hybridsim.studies.he2026.measured.steady import ExactState, by_steps, exact

# Places along the published ridge, including the paper's two maxima, and its two example points.
LOADS_AND_RATIOS = (
    (0.54, 0.55),
    (0.54, 0.58),
    (0.55, 0.60),
    (0.55, 0.64),
    (0.56, 0.66),
    (0.57, 0.70),
    (0.58, 0.76),
    (0.60, 0.84),
    (0.61, 0.88),
    (0.63, 0.94),
)
STEPS = (300, 600, 1200, 2400, 4800, 9600)
EPS = (8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5)
# Over three halvings of the step a first-order error falls to an eighth; with noise, to less than half.
_SHRINKS = 0.5


@dataclass(frozen=True)
class StepStudy:
    """Deviations from the exact motion over points (rows) and settings (columns), averaged over periods.

    by_step : method without stick -> quantity -> deviations over `STEPS`.
    by_eps : method with stick -> quantity -> deviations over `EPS`.
    worst : method without stick -> the largest deviation of A of a single period among the last ones.
    """

    truth: tuple[ExactState, ...]
    by_step: dict[str, dict[str, np.ndarray]]
    by_eps: dict[str, dict[str, np.ndarray]]
    worst: dict[str, np.ndarray]

    def along(self, method: str, quantity: str) -> np.ndarray:
        """Return the root mean square of the deviations along the ridge, for each step."""
        return np.asarray(np.sqrt((self.by_step[method][quantity] ** 2).mean(axis=0)))

    def along_eps(self, method: str, quantity: str) -> np.ndarray:
        """Return the root mean square of the deviations along the ridge, for each velocity interval."""
        return np.asarray(np.sqrt((self.by_eps[method][quantity] ** 2).mean(axis=0)))

    def shrinks(self, quantity: str) -> bool:
        """Return whether the deviation along the ridge of the map decreases with the step, for every
        interpretation."""
        first = STEPS.index(STEPS_PER_PERIOD)
        return all(
            self.along(v.name, quantity)[-1] < _SHRINKS * self.along(v.name, quantity)[first] for v in SIGNS
        )

    def sentence(self, quantity: str) -> str:
        """Return the result of the step study as a sentence."""
        first = STEPS.index(STEPS_PER_PERIOD)
        values = [self.along(v.name, quantity) for v in SIGNS]
        by_step, by_stage = (f"from {100 * a[first]:.2g} % to {100 * a[-1]:.2g} %" for a in values)
        return (
            "On the ridge the method without stick deviates from the exact motion. If h0 increases from "
            f"{STEPS_PER_PERIOD} to {STEPS[-1]}, this deviation decreases. "
            f'With "sign by step" the deviation decreases {by_step}. With "sign by stage" '
            f"the deviation decreases {by_stage}."
        )

    def to_plain(self, quantity: str) -> dict[str, Any]:
        """Return the deviations as plain values, for a JSON file."""
        return {
            "places": [{"F0/N": a, "r": b} for a, b in LOADS_AND_RATIOS],
            "h0": list(STEPS),
            "deviation without stick from exact, root mean square over the places": {
                v.name: self.along(v.name, quantity) for v in SIGNS
            },
            "largest deviation of A of a single period": {
                name: w.max(axis=0) for name, w in self.worst.items()
            },
            "eps_v": list(EPS),
            "deviation with stick from exact, root mean square over the places": {
                v.name: self.along_eps(v.name, quantity) for v in MATTERING
            },
        }


def step_study(size: Size, pool: Pool) -> StepStudy:
    """Run the points on the ridge with every step and every velocity interval."""
    points = [Point(r, ratio) for ratio, r in LOADS_AND_RATIOS]
    truth = pool.map(exact, points, 0.0, 0.01)
    one = list(itertools.product(SIGNS, points, STEPS))
    two = list(itertools.product(MATTERING, points, EPS))
    without = pool.map(lambda k: by_steps(k[1], k[0], size.periods, size.last, k[2]), one, 0.01, 0.6)
    with_ = pool.map(
        lambda k: by_steps(k[1], k[0], size.periods, size.last, STEPS_PER_PERIOD, k[2]), two, 0.6, 1.0
    )
    A = np.array([s.amplitude for s in truth])[:, None]
    E = np.array([s.energy for s in truth])[:, None]

    def shaped(values: list[float], methods: int) -> np.ndarray:
        return np.array(values).reshape(methods, len(points), -1)

    tables = []
    for runs, methods in ((without, SIGNS), (with_, MATTERING)):
        a = abs(shaped([run.amplitude for run in runs], len(methods)) / A - 1.0)
        e = abs(shaped([run.energy for run in runs], len(methods)) / E - 1.0)
        tables.append({v.name: {"A": a[k], "E": e[k]} for k, v in enumerate(methods)})
    exact_of = [s.amplitude for s, _ in itertools.product(truth, STEPS)] * len(SIGNS)
    worst = [float(abs(run.A / x - 1.0).max()) for run, x in zip(without, exact_of, strict=True)]
    shaped_worst = shaped(worst, len(SIGNS))
    return StepStudy(
        tuple(truth), tables[0], tables[1], {v.name: shaped_worst[k] for k, v in enumerate(SIGNS)}
    )
