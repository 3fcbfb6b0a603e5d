"""This module runs all computations of the study of He et al. (2026) in order, and collects the verdicts."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hybridsim.analysis.provenance import provenance
from hybridsim.files import plain
from hybridsim.model import load
from hybridsim.studies.he2026.measured import (
    convergence,
    deviation,
    readings,
    reduction,
    required_settings,
    response,
    run_times,
    step_study,
    stick_share,
    timed_map,
    truth,
)
from hybridsim.studies.he2026.measured.pool import Pool
from hybridsim.studies.he2026.measured.settings import FULL, QUICK, SOURCE, Size
from hybridsim.studies.he2026.measured.verdicts import Claim

# The time of each part, full and quick, in seconds on two processors; used for progress only.
_SHARES = {
    "figures 6, 7: run times": (15.0, 15.0),
    "steady amplitude over a map, timed": (60.0, 12.0),
    "what is left open": (6.0, 4.0),
    "figures 3, 12, 13": (12.0, 10.0),
    "figure 4: the step": (35.0, 10.0),
    "figure 5: the zero-velocity interval": (25.0, 8.0),
    "figures 8, 9: fewer parameters": (12.0, 8.0),
    "figures 10, 11: leaving out stick": (130.0, 20.0),
    "what the step does": (30.0, 20.0),
    "what is true": (80.0, 8.0),
    "what setting is needed": (150.0, 15.0),
}


@dataclass(frozen=True)
class Study:
    """The data of every figure, and the claims with their verdicts."""

    size: Size
    readings: readings.Readings
    figure_3: dict[str, response.Response]
    figure_12: dict[str, response.Response]
    figure_13: dict[str, response.Response]
    over_steps: convergence.Curves
    over_eps: convergence.Curves
    times: run_times.RunTimes
    reduction: reduction.Reduction
    maps: deviation.Maps
    steps: step_study.StepStudy
    truth: truth.Truth
    required_settings: required_settings.RequiredSettings
    timed_map: timed_map.TimedMap
    seconds: dict[str, float]
    workers: int

    @property
    def claims(self) -> tuple[Claim, ...]:
        """Every claim of the paper with its verdict, in the order of the paper."""
        return (
            response.claim_figure_3(self.figure_3),
            convergence.claim_figure_4(self.over_steps),
            convergence.claim_figure_5(self.over_eps),
            run_times.claim_figure_6(self.times),
            run_times.claim_figure_7(self.times),
            reduction.claim(self.reduction),
            deviation.claim(self.maps, "A", self.steps),
            deviation.claim(self.maps, "E", self.steps),
            response.claim_figure_12(self.figure_12, self.steps),
            response.claim_figure_13(self.figure_13, self.figure_12),
            stick_share.claim(self.maps, self.steps, self.truth),
        )

    def to_plain(self) -> dict[str, Any]:
        """Return the verdicts and the measured numbers as plain values, for a JSON file."""
        claims = self.claims
        return {
            "schema": 1,
            "study": "he2026",
            "source": SOURCE,
            "size": self.size.name,
            "verdicts": dict(Counter(str(claim.verdict) for claim in claims)),
            "claims": [claim.to_plain() for claim in claims],
            "what is left open": self.readings.to_plain(),
            "what is true": self.truth.to_plain(),
            "what setting is needed": self.required_settings.to_plain(),
            "a map, timed": self.timed_map.to_plain(),
            "seconds": self.seconds,
            "threads": self.workers,
            "provenance": provenance(load("dfcs")),
        }

    def to_json(self) -> str:
        """Return the verdicts as JSON text."""
        return json.dumps(plain(self.to_plain(), digits=6), indent=1, allow_nan=False) + "\n"

    def rows(self) -> list[tuple[str, str, str]]:
        """Return the name, the verdict and the reason of each claim, for a table."""
        return [(claim.name, str(claim.verdict), claim.why) for claim in self.claims]


def he2026(
    quick: bool = False, progress: Callable[[float, str], None] | None = None, workers: int | None = None
) -> Study:
    """Run the whole study; `quick` uses coarser grids and shorter runs for the same claims."""
    size = QUICK if quick else FULL
    pool = Pool({name: shares[quick] for name, shares in _SHARES.items()}, progress, workers)
    seconds: dict[str, float] = {}
    names = iter(_SHARES)

    def timed(work: Callable[[Size, Pool], Any]) -> Any:
        name = next(names)
        pool.part(name)
        began = time.perf_counter()
        result = work(size, pool)
        seconds[name] = round(time.perf_counter() - began, 1)
        return result

    times = timed(run_times.run_times)
    map_timing = timed(timed_map.time_map)
    open_ = timed(readings.readings)
    motions = timed(lambda size, pool: [response.responses(point, size, pool) for point in response.POINTS])
    over_steps, over_eps = timed(convergence.over_steps), timed(convergence.over_eps)
    reduced = timed(reduction.reduction)
    maps = timed(deviation.maps)
    steps = timed(step_study.step_study)
    true = timed(truth.truth)
    settings = timed(required_settings.required_settings)
    return Study(
        size,
        open_,
        motions[0],
        motions[1],
        motions[2],
        over_steps,
        over_eps,
        times,
        reduced,
        maps,
        steps,
        true,
        settings,
        map_timing,
        seconds,
        pool.workers,
    )
