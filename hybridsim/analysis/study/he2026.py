"""The study of He et al. 2026: everything that is computed, in order, and the verdicts."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hybridsim.analysis.provenance import provenance
from hybridsim.analysis.study import deviation, response
from hybridsim.analysis.study.pool import Pool
from hybridsim.analysis.study.settings import FULL, QUICK, SOURCE, Size
from hybridsim.analysis.study.step_study import StepStudy, step_study
from hybridsim.analysis.study.verdicts import Claim, plain
from hybridsim.model import load

# What each part takes of the whole, in seconds of one processor of 2024, full and quick: for the progress alone.
_SHARES = {
    "figures 3, 12, 13": (20.0, 15.0),
    "what the step does": (40.0, 30.0),
    "figures 10, 11": (190.0, 15.0),
}


@dataclass(frozen=True)
class Study:
    """The data of every figure, and the claims with their verdicts."""

    size: Size
    figure_3: dict[str, response.Response]
    figure_12: dict[str, response.Response]
    figure_13: dict[str, response.Response]
    steps: StepStudy
    maps: deviation.Maps
    seconds: dict[str, float]
    workers: int

    @property
    def claims(self) -> tuple[Claim, ...]:
        """Every claim of the paper, in its order."""
        return (
            response.claim_figure_3(self.figure_3),
            deviation.claim(self.maps, "A", self.steps),
            deviation.claim(self.maps, "E", self.steps),
        )

    def to_plain(self) -> dict[str, Any]:
        """What the file of verdicts holds."""
        claims = self.claims
        return {
            "schema": 1,
            "study": "he2026",
            "source": SOURCE,
            "size": self.size.name,
            "verdicts": dict(Counter(str(claim.verdict) for claim in claims)),
            "claims": [claim.to_plain() for claim in claims],
            "seconds": self.seconds,
            "threads": self.workers,
            "provenance": provenance(load("dfcs")),
        }

    def to_json(self) -> str:
        """The same as text."""
        return json.dumps(plain(self.to_plain()), indent=1, allow_nan=False) + "\n"

    def rows(self) -> list[tuple[str, str, str]]:
        """Name, verdict and reason of each claim, for a table."""
        return [(claim.name, str(claim.verdict), claim.why) for claim in self.claims]


def he2026(
    quick: bool = False, progress: Callable[[float, str], None] | None = None, workers: int | None = None
) -> Study:
    """Run the whole study; quick: on coarser grids and shorter runs, the same claims."""
    size = QUICK if quick else FULL
    pool = Pool({name: shares[quick] for name, shares in _SHARES.items()}, progress, workers)
    seconds: dict[str, float] = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        pool.part(name)
        began = time.perf_counter()
        result = work()
        seconds[name] = round(time.perf_counter() - began, 1)
        return result

    motions = timed(
        "figures 3, 12, 13",
        lambda: [
            response.responses(point, size, pool)
            for point in (response.FIGURE_3, response.FIGURE_12, response.FIGURE_13)
        ],
    )
    steps = timed("what the step does", lambda: step_study(size, pool))
    maps = timed("figures 10, 11", lambda: deviation.maps(size, pool))
    return Study(size, motions[0], motions[1], motions[2], steps, maps, seconds, pool.workers)
