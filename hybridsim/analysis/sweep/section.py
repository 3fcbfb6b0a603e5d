"""This module samples a steady motion once per forcing period, or each time a quantity passes a level."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from hybridsim.analysis.steady.motion import Motion, Point, point_at_end
from hybridsim.arguments import cannot_be
from hybridsim.engine.system.period import common_period, system_period
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import SimulationError, UsageError
from hybridsim.expr import parse
from hybridsim.model import Model, Monitor
from hybridsim.model.free_name import free_name, names_of_model
from hybridsim.solution import Solution

LEVEL = "section"  # the monitor of a level
REPEATS = "repeats_after"
_DURATION = (
    10.0  # the first interval of a model without a duration: a few swings of a mechanism of about 1 Hz
)
_ATTEMPTS = 12  # each twice as long as the previous one, the last two thousand times the first
_FEWEST = 32  # periods of a first interval with forcing: a section that is not passed in them is not reached
_EMPTY_FREE = 5  # intervals without any passage after which the search ends, without forcing


class Passings(NamedTuple):
    """States (k, n) at a Poincare section, the largest size (n,) of each state, and the end of the run."""

    states: np.ndarray
    sizes: np.ndarray
    end: Point


@dataclass(frozen=True)
class Section:
    """A measure that samples the settled motion at a section.

    Parameters
    ----------
    level : the name of a monitor of the model, or "" for the period of the forcing.
    settle, samples : passages before the first sample, and number of samples.
    tol : tolerance for equal samples, relative to the largest size of a state along the motion.
    first : x0 and z0 of the first run; a chain continues from the end of its neighbour.
    options : options of `simulate`.
    """

    level: str
    settle: int
    samples: int
    tol: float
    first: Mapping[str, Any]
    options: Mapping[str, Any]

    def run(self, model: Model, previous: Passings | None) -> Passings:
        """Return the section samples of one model; with `warm_start`, the run begins at the end of the previous run."""
        motion = Motion(model, dict(self.options), dict(self.first))
        start = None if previous is None else previous.end
        return self._passed(motion, start) if self.level else self._strobed(motion, start)

    def read(self, result: Passings) -> dict[str, Any]:
        """Return the samples of each state, and the number of samples after which the samples repeat (or 0)."""
        columns = {f"state {k}": column for k, column in enumerate(result.states.T)}
        return {**columns, REPEATS: repeats_after(result.states, self.tol * result.sizes)}

    def _strobed(self, motion: Motion, start: Point | None) -> Passings:
        period = sampling_period(motion.model)
        times = period * np.arange(self.settle + 1, self.settle + self.samples + 1)
        run = motion.run(start, float(times[-1]), keep=self.samples * period)
        return Passings(run(times, side="-").T, _sizes(run), point_at_end(run))

    def _passed(self, motion: Motion, start: Point | None) -> Passings:
        passages = self.settle + self.samples
        period = common_period(system_of(motion.model))
        length = motion.model.duration_value() or (period * max(passages, _FEWEST) if period else _DURATION)
        for attempt in range(1, _ATTEMPTS + 1):
            # from the start each time, because a motion with forcing or a clock cannot be cut anywhere
            run = motion.run(start, length)
            found = [e.x_minus for e in run.events if e.component == self.level and e.kind == "monitor"]
            if len(found) >= passages:
                return Passings(np.array(found[self.settle : passages]), _sizes(run), point_at_end(run))
            if not found and (period or attempt == _EMPTY_FREE):
                raise SimulationError(
                    f"the section was not crossed upward in a run of length {length:.6g}: the motion does not reach "
                    "it, or a contact sticks there"
                )
            length *= 2.0
        raise SimulationError(
            f"the run crosses the section {len(found)} times, but {passages} crossings are needed"
        )


def sampling_period(model: Model) -> float:
    """Return the period of the forcing, or raise `UsageError` if there is no single period."""
    period = system_period(system_of(model))
    if period is None:
        raise UsageError(
            f"model {model.name} has no single forcing period",
            remedy="set `section` to an expression that increases through zero, such as 'v'",
        )
    return period


def with_section(model: Model, section: str | None) -> tuple[Model, str]:
    """Return the model with a monitor at the section, and the monitor's name, or "" for the forcing period.

    Raises
    ------
    UsageError
        If the section is not a string.
    ExpressionError
        If it is not an expression of the model.
    """
    if section is None:
        return model, ""
    if not isinstance(section, str):
        raise cannot_be("section", section, "use an expression, or the name of a monitor")
    if section in {monitor.name for monitor in model.monitors}:
        return model, section
    name = free_name(names_of_model(model), LEVEL)
    monitor = Monitor(name, parse(section), direction="up")
    return replace(model, monitors=(*model.monitors, monitor)).validate(), name


def repeats_after(states: np.ndarray, tols: np.ndarray) -> int:
    """Return the number of samples after which the motion repeats within the tolerances (or 0)."""
    for n in range(1, len(states) // 2 + 1):
        if (np.abs(states[n:] - states[:-n]) <= tols).all():
            return n
    return 0


def _sizes(run: Solution) -> np.ndarray:
    """Return the largest size of each state from the steps of a run, since a state may be zero at the section."""
    return np.abs(run.y).max(axis=1)
