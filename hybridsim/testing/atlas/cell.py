"""One cell of the atlas: one test case, run by one method within a time limit."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hybridsim.integrators.registry import registered
from hybridsim.testing.atlas.configurations import RIVALS, Configuration
from hybridsim.testing.measuring import Measured
from hybridsim.testing.scene import Scene, Truth
from hybridsim.testing.study import Setting, carry_out
from hybridsim.testing.verdict import NOT_RUN, order, verdict

# Limits of one run in processor time and steps. The longest run of a correct method takes five seconds, or 2e6 steps
# if it is compiled.
SECONDS = 10.0
STEPS = 5e6
LONG = 20.0  # units of time; longer scenes are run only by compiled methods


@dataclass(frozen=True)
class Row:
    """One run of a study: its setting, its relative errors (NaN if not compared), steps and seconds."""

    setting: str
    time_error: float
    state_error: float
    steps: int
    seconds: float


@dataclass(frozen=True)
class Cell:
    """The result of running one test case with one method: the verdict, its reason, and the errors of the runs.

    Parameters
    ----------
    reason : the first error, in one sentence.
    order : observed order of convergence of a fixed-step method, or None.
    """

    scene: str
    configuration: str
    verdict: str
    reason: str = ""
    rows: tuple[Row, ...] = ()
    order: float | None = None
    seconds: float = 0.0

    @property
    def error(self) -> float | None:
        """The larger of the two errors at the last completed setting, or None."""
        error = max(self.rows[-1].time_error, self.rows[-1].state_error) if self.rows else math.nan
        return error if math.isfinite(error) else None

    def to_plain(self) -> dict[str, Any]:
        """Return the cell as plain data, in which each row is a list of its values."""
        rows = [dataclasses.astuple(row) for row in self.rows]
        return dataclasses.asdict(self) | {"rows": rows, "error": self.error}

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Cell:
        """Return a cell from the plain data of `to_plain`; missing errors become NaN."""
        known = {name: value for name, value in plain.items() if name not in ("rows", "error")}
        rows = tuple(
            Row(setting, _number(of_times), _number(of_states), steps, seconds)
            for setting, of_times, of_states, steps, seconds in plain["rows"]
        )
        return cls(**known, rows=rows)


def run_cell(scene: Scene, configuration: Configuration, quick: bool = False) -> Cell:
    """Run one test case with one method; `quick` runs only the loosest setting of the study."""
    reason = configuration.applies(scene)
    length = abs(scene.span[1] - scene.span[0]) / scene.unit
    if not reason and length > LONG and length < 1e6 and not configuration.is_compiled:
        reason = f"the run of {length:.0f} time units is too long for a method that is not compiled"
    if reason:
        return Cell(scene.name, configuration.name, NOT_RUN, reason)
    settings = configuration.settings(scene)
    tolerances = configuration.tolerances(scene)
    if quick:
        settings, tolerances = settings[:1], loosened(tolerances, settings[0])
    began = time.perf_counter()
    with registered(RIVALS.get(configuration.integrator, configuration.integrator)) as name:
        study = carry_out(
            name,
            seen_by(scene, configuration),
            settings,
            tolerances,
            lacks={"located"}
            & set(
                configuration.method.lacks
            ),  # event times of methods that do not locate events are not checked
            seconds=2 * SECONDS,  # for methods that do not check their limits
            processor_seconds=SECONDS,
            limits={"steps": STEPS},
            form=configuration.form,
            **configuration.options,
        )
    found, reason = verdict(study)
    rows = tuple(row(setting.text, run) for setting, run in study.done)
    spent = time.perf_counter() - began
    return Cell(scene.name, configuration.name, found, reason, rows, order(study.done), spent)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def row(setting: str, run: Measured) -> Row:
    """Return the result of one run as a row; a wrong end or a wrong event sequence makes its numeric errors NaN."""
    if run.ending or run.sequence:
        return Row(setting, math.nan, math.nan, run.steps, run.seconds)
    return Row(setting, run.time_error, run.state_error, run.steps, run.seconds)


def loosened(tolerances: tuple[float, float], setting: Setting) -> tuple[float, float]:
    """Return the errors that are allowed in a single run with the loosest setting."""
    allowed = 1e3 * setting.options.get("rtol", 1e-4)
    return max(tolerances[0], allowed), max(tolerances[1], allowed)


def seen_by(scene: Scene, configuration: Configuration) -> Scene:
    """Return the test case in the form that a method can solve; for regularized contacts, modes are not compared."""
    if not configuration.form:
        return scene
    truth = scene.truth
    return replace(scene, truth=Truth(None, truth.states, status=truth.status, end=truth.end))
