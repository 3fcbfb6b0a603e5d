"""This module finds the largest step and velocity interval with which the error of A is below 1 %."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.simulate import simulate
from hybridsim.studies.he2026.measured import settings as paper
from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.steady import declared, measured, periods_of, settling_periods

TOLERANCE = 0.01
STEPS = (150, 300, 600, 1200, 2400, 4800, 9600, 19200)
EPS = tuple(1.28e-2 / 2.0**k for k in range(15))  # 8e-4 is the fifth, the last is 7.8e-7
RATIO_SPAN, R_SPAN = (0.52, 1.5), (0.1, 2.0)
# The runs begin on the exact orbit and need not settle; the chatter takes some periods to spread.
_PERIODS, _LAST = 60, 40


@dataclass(frozen=True)
class RequiredSettings:
    """The coarsest setting with which all periods have an error below 1 %, as a map for each method.

    nan if the finest one is not enough.
    """

    ratios: np.ndarray
    r: np.ndarray
    steps: dict[str, np.ndarray]
    eps: dict[str, np.ndarray]

    def to_plain(self) -> dict[str, Any]:
        """Return the maps as plain values, for a JSON file."""
        result: dict[str, Any] = {"tolerance": TOLERANCE, "finest h0": STEPS[-1], "finest eps_v": EPS[-1]}
        for name, table in (*self.steps.items(), *self.eps.items()):
            published = paper.STEPS_PER_PERIOD if name in self.steps else 8e-4
            enough = table <= published if name in self.steps else table >= 0.999 * published
            values = np.sort(np.nan_to_num(table.ravel(), nan=np.inf if name in self.steps else 0.0))
            result[name] = {
                "published setting is enough on this share of the map": float(np.mean(enough)),
                "the finest is not enough on this share": float(np.mean(np.isnan(table))),
                "median": float(values[len(values) // 2]),
            }
        return result


def required_settings(size: paper.Size, pool: Pool) -> RequiredSettings:
    """Try the settings from coarse to fine at every point of the map."""
    ratios, r = np.linspace(*RATIO_SPAN, size.ladder_count), np.linspace(*R_SPAN, size.ladder_count)
    points = [paper.Point(float(b), float(a)) for a in ratios for b in r]
    starts = pool.map(_start, points, 0.0, 0.05)
    jobs = list(
        itertools.product((*paper.SIGNS, paper.LITERAL, paper.ZEROED), zip(points, starts, strict=True))
    )
    found = pool.map(lambda job: _coarsest(job[0], *job[1]), jobs, 0.05, 1.0)
    table = np.array(found).reshape(-1, len(ratios), len(r))
    names = [v.name for v in (*paper.SIGNS, paper.LITERAL, paper.ZEROED)]
    count = len(paper.SIGNS)
    return RequiredSettings(
        ratios,
        r,
        dict(zip(names[:count], table[:count], strict=True)),
        dict(zip(names[count:], table[count:], strict=True)),
    )


def _start(point: paper.Point) -> tuple[float, tuple[float, float]]:
    """Return the exact amplitude, and the state at which a period of the exact motion begins."""
    solution = simulate(
        declared("dfcs"),
        (0.0, settling_periods(point) * point.period),
        params=point.params,
        integrator="exact",
        keep="last-period",
    )
    x, v = solution.y[:, -1].tolist()
    return measured(solution, point).amplitude, (x, v)


def _coarsest(variant: paper.Variant, point: paper.Point, start: tuple[float, tuple[float, float]]) -> float:
    amplitude, state = start
    by_steps = variant in paper.SIGNS
    settings: tuple[float, ...] = STEPS if by_steps else EPS
    good = float("nan")
    for setting in settings:
        options: dict[str, Any] = dict(variant.options)
        if not by_steps:
            options["eps_v"] = setting
        solution = simulate(
            declared("dfcs"),
            (0.0, _PERIODS * point.period),
            params=point.params,
            x0=state,
            integrator=variant.integrator,
            keep=_LAST * point.period,
            steps_per_period=float(setting if by_steps else paper.STEPS_PER_PERIOD),
            **options,
        )
        A = periods_of(solution, point, _PERIODS, _LAST).A
        if float(np.abs(A / amplitude - 1.0).max()) > TOLERANCE:
            good = float("nan")
        elif np.isnan(good):
            good = setting
        elif setting >= 4 * good if by_steps else setting <= good / 4:
            break  # two finer ones agree
    return good
