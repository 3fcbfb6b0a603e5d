"""This module classifies the result of an integrator on a test case."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

from hybridsim.analysis.compare.rows import NOT_STARTED, STOPPED, Row
from hybridsim.analysis.suite.scenes import Scene
from hybridsim.integrators.registry import integrator_class

# The common setting of all verdicts: tight enough to show errors of the method, loose enough for every
# integrator; for a fixed step, the choice of its authors.
COMMON = {"rtol": 1e-8, "steps_per_period": 1200.0}
# relative to the amplitude; a run with a larger error is useless even with the right modes
USELESS = 0.1


class Verdict(Enum):
    """Whether the run of an integrator on a test case is right, and the reason if it is wrong."""

    RIGHT = "right"
    OFF = "off"
    WRONG = "wrong modes"
    LACKS = "lacks"
    FAILED = "failed"
    REFUSED = "refused"
    TOO_SLOW = "too slow"

    def __str__(self) -> str:
        return self.value


def verdict(scene: Scene, rows: Sequence[Row]) -> Verdict:
    """Return the verdict on a series of runs, at the setting that is closest to the common setting.

    "off": the modes are right, but a state is wrong by more than a tenth of its amplitude. "lacks": the modes
    are wrong, and the integrator declares that it lacks a capability that the scene needs.
    """
    row = min(
        rows, key=lambda row: abs(math.log(row.setting[1] / COMMON.get(row.setting[0], row.setting[1])))
    )
    if row.errors is not None:
        if not row.errors.wrong_modes:
            return Verdict.RIGHT if row.errors.state <= USELESS else Verdict.OFF
        return Verdict.LACKS if set(scene.needs) & _lacking(row.integrator) else Verdict.WRONG
    if row.status in (NOT_STARTED, STOPPED):
        return Verdict.TOO_SLOW
    return Verdict.REFUSED if row.status == "refused" else Verdict.FAILED


def _lacking(integrator: str) -> set[str]:
    return set(integrator_class(integrator).lacks)
