"""This module reproduces figures 10 and 11: the deviation of a method that ignores stick, over F0/N and r."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.settings import MATTERING, SIGNS, Point, Size, Variant, described
from hybridsim.studies.he2026.measured.steady import by_steps, exact
from hybridsim.studies.he2026.measured.step_study import StepStudy
from hybridsim.studies.he2026.measured.verdicts import Claim, Verdict

EXACT = "exact"


@dataclass(frozen=True)
class Maps:
    """Steady amplitude and energy over F0/N (rows) and r (columns), for each method."""

    ratios: np.ndarray
    r: np.ndarray
    mean: dict[str, dict[str, np.ndarray]]  # method -> A, E
    least: dict[str, dict[str, np.ndarray]]
    greatest: dict[str, dict[str, np.ndarray]]
    stick: np.ndarray  # fraction of the exact period spent in stick

    def deviation(self, quantity: str, without: str, with_: str) -> np.ndarray:
        """Return the relative deviation |Q1 - Q2|/Q2 (Eq. 9)."""
        one, two = self.mean[without][quantity], self.mean[with_][quantity]
        return np.asarray(np.abs(one - two) / two)

    def spread(self, quantity: str, method: str) -> np.ndarray:
        """Return (greatest - least)/mean over the last periods, which is zero for a periodic motion."""
        width = self.greatest[method][quantity] - self.least[method][quantity]
        return np.asarray(width / self.mean[method][quantity])


def maps(size: Size, pool: Pool) -> Maps:
    """Compute the steady states on a map by the exact method and by each interpretation of the published methods."""
    ratios, r = np.array(size.ratios), np.array(size.r)
    points = [Point(float(b), float(a)) for a in ratios for b in r]
    methods: tuple[Variant, ...] = (*SIGNS, *MATTERING)
    tasks = list(itertools.product(methods, points))
    found = pool.map(lambda task: by_steps(task[1], task[0], size.periods, size.last), tasks, 0.0, 0.97)
    shape, count = (len(ratios), len(r)), len(points)
    mean: dict[str, dict[str, np.ndarray]] = {}
    least: dict[str, dict[str, np.ndarray]] = {}
    greatest: dict[str, dict[str, np.ndarray]] = {}
    for k, method in enumerate(methods):
        rows = found[k * count : (k + 1) * count]
        for table, reduce in ((mean, np.mean), (least, np.min), (greatest, np.max)):
            table[method.name] = {
                q: np.array([reduce(getattr(row, q)) for row in rows]).reshape(shape) for q in ("A", "E")
            }
    truth = pool.map(exact, points, 0.97, 1.0)
    of_truth = {
        "A": np.array([s.amplitude for s in truth]).reshape(shape),
        "E": np.array([s.energy for s in truth]).reshape(shape),
    }
    for table in (mean, least, greatest):
        table[EXACT] = of_truth
    stick = np.array([s.stick for s in truth]).reshape(shape)
    return Maps(ratios, r, mean, least, greatest, stick)


# The paper's readings of its figures. It gives each region as a rectangle; the region is a ridge from the
# corner at the threshold to the opposite one, so that the upper ends of both ranges show where it falls below
# the level.
PUBLISHED: dict[str, dict[str, Any]] = {
    "A": {
        "above 10 %": {"F0/N": (0.54, 0.58), "r": (0.50, 0.76)},
        "above 5 %": {"F0/N": (0.53, 0.61), "r": (0.50, 0.88)},
        "maximum": 0.1869,
        "at": (0.55, 0.64),
    },
    "E": {
        "above 10 %": {"F0/N": (0.53, 0.60), "r": (0.50, 0.84)},
        "above 5 %": {"F0/N": (0.52, 0.63), "r": (0.50, 0.94)},
        "maximum": 0.3379,
        "at": (0.54, 0.58),
    },
}
LEVELS = {"above 10 %": 0.10, "above 5 %": 0.05}
# The ridge is searched near the line through the corners that the paper gives, from F0/N = 0.54 on. Nearer to
# the threshold F0/N = mu, and far beyond resonance, the methods without stick do not give a periodic motion.
_RIDGE_FROM, _RIDGE_WIDTH = 0.54, 0.12


def read(found: Maps, quantity: str, without: str, with_: str) -> dict[str, Any]:
    """Return the features of a map of deviations: ridge and ends, maximum, values near the threshold.

    near the threshold: the median over r at the smallest F0/N. beyond resonance: the largest at r > 1.
    """
    deviation = found.deviation(quantity, without, with_)
    line = np.minimum(0.55 + (found.ratios - 0.54) * (0.94 - 0.55) / (0.63 - 0.54), 1.0)  # r over F0/N
    near = np.abs(found.r[None, :] - line[:, None]) <= _RIDGE_WIDTH + 1e-9
    columns = np.argmax(np.where(near, deviation, -1.0), axis=1)
    crest = deviation[np.arange(len(found.ratios)), columns]
    on = np.flatnonzero(found.ratios >= _RIDGE_FROM - 1e-9)
    top = on[int(np.argmax(crest[on]))]
    place = _nearest(found, PUBLISHED[quantity]["at"])
    result: dict[str, Any] = {
        "maximum": float(crest[top]),
        "at": (float(found.ratios[top]), float(found.r[columns[top]])),
        "where the paper has its maximum": float(deviation[place]),
        "spread of the periods without stick there": float(found.spread(quantity, without)[place]),
        "near the threshold": float(np.median(deviation[0])),
        "beyond resonance": float(deviation[np.ix_(on, found.r > 1.0)].max()),
    }
    for name, level in LEVELS.items():
        below = np.flatnonzero(crest[on] < level)
        count = int(below[0]) if len(below) else len(on)
        end = on[count - 1] if count else None
        result[name] = (
            None if end is None else {"F0/N": float(found.ratios[end]), "r": float(found.r[columns[end]])}
        )
    return result


def _nearest(found: Maps, place: tuple[float, float]) -> tuple[int, int]:
    return int(np.argmin(np.abs(found.ratios - place[0]))), int(np.argmin(np.abs(found.r - place[1])))


def distance(reading: dict[str, Any], quantity: str) -> float:
    """Return the distance of a value from the paper's value, in units of the paper's accuracy."""
    published = PUBLISHED[quantity]
    total = abs(math.log(reading["maximum"] / published["maximum"])) / math.log(1.2)
    for name in LEVELS:
        end = reading[name]
        if end is None:
            return math.inf
        total += abs(end["F0/N"] - published[name]["F0/N"][1]) / 0.01
        total += abs(end["r"] - published[name]["r"][1]) / 0.04
    return total


def combinations() -> list[tuple[str, str]]:
    """Return every pair of a method that ignores stick and a method that includes stick."""
    return [(a.name, b) for a in SIGNS for b in (*(v.name for v in MATTERING), EXACT)]


def pair_name(pair: tuple[str, str]) -> str:
    """Return the name of a pair of methods."""
    return f"{pair[0]}; {pair[1]}"


def claim(found: Maps, quantity: str, study: StepStudy) -> Claim:
    """Judge the claim of figure 10 (amplitude) or figure 11 (energy)."""
    published = PUBLISHED[quantity]
    readings = {pair_name(pair): read(found, quantity, *pair) for pair in combinations()}
    ours = {name: row for name, row in readings.items() if not name.endswith(EXACT)}
    closest = min(ours, key=lambda name: distance(ours[name], quantity))
    best, away = ours[closest], distance(ours[closest], quantity)
    if study.shrinks(quantity):
        verdict = Verdict.ARTEFACT
    else:
        verdict = Verdict.REPRODUCED if away <= 3.0 else Verdict.SHAPE if away <= 12.0 else Verdict.NOT
    number = {"A": "10", "E": "11"}[quantity]
    where, box10, box5 = published["at"], published["above 10 %"], published["above 5 %"]
    end = best["above 10 %"] or {"F0/N": math.nan, "r": math.nan}
    truly = readings[pair_name((closest.split("; ")[0], EXACT))]
    why = (
        f"Our map also has a ridge, along which {quantity}_D is large. In the pair of readings closest to "
        f"the paper, the method without stick has {described(closest)}. With this pair the maximum of {quantity}_D is "
        f"{_percent(best['maximum'])} at F0/N = {best['at'][0]:g}, r = {best['at'][1]:g}. Along the ridge "
        f"{quantity}_D stays above 10 % up to F0/N = {end['F0/N']:g}, r = {end['r']:g}. "
        f"{study.sentence(quantity)} Near the threshold of motion, at F0/N = {found.ratios[0]:g}, the "
        f"median of {quantity}_D over r is {_percent(best['near the threshold'])} with this pair. The "
        f"median is {_percent(truly['near the threshold'])} if {quantity}2 is the value of the exact "
        f"motion. In the paper {quantity}_D decreases towards the threshold."
    )
    text = (
        f"{quantity}_D is at least 10 % for F0/N from {_range_text(box10['F0/N'])} and r from "
        f"{_range_text(box10['r'])}. The claimed range with at least 5 % is F0/N from {_range_text(box5['F0/N'])} and "
        f"r from {_range_text(box5['r'])}. The claimed maximum of {quantity}_D is {100 * published['maximum']:.2f} % "
        f"at F0/N = {where[0]}, r = {where[1]}"
    )
    exact_rows = {name: row for name, row in readings.items() if name.endswith(EXACT)}
    return Claim(
        f"figure {number}", number, text, published, ours, closest, exact_rows, verdict, why,
        study.to_plain(quantity),
    )  # fmt: skip


def _percent(value: float) -> str:
    return f"{float(f'{100 * value:.3g}'):g} %"


def _range_text(ends: tuple[float, float]) -> str:
    return f"{ends[0]} to {ends[1]}"
