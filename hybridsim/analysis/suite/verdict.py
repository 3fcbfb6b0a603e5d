"""Whether an integrator is right on a scene, in two words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

from hybridsim.analysis.rows import NOT_STARTED, STOPPED, Row
from hybridsim.analysis.suite.scenes import Scene

# The setting at which all are judged: tight enough that an error of the method does not hide in the tolerance,
# loose enough for each of them to keep; of a fixed step, the one that its authors took.
COMMON = {"rtol": 1e-8, "steps_per_period": 1200.0}
# Of an amplitude: states farther off are of no use to anybody, however right the modes.
USELESS = 0.1


class Verdict(Enum):
    """What became of a run."""

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
    """The verdict over a line, at the setting that is nearest to the common one.

    "off": the modes are right, and a state is wrong by more than a tenth of its amplitude. "lacks": the modes are
    wrong, and the integrator says itself that it lacks what the scene needs.
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
    from hybridsim.integrators.registry import integrator_class

    return set(integrator_class(integrator).lacks)
