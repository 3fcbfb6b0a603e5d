"""This module finds the simplest adequate model at each point of a region of parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.analysis.advise.certificates import certificates
from hybridsim.analysis.advise.ladder import (
    ADEQUATE,
    FULL,
    NOT_ADEQUATE,
    NOT_APPLICABLE,
    WHERE_TRIED,
    Limits,
    Step,
    by_theory,
    climb,
    scene_of,
)
from hybridsim.analysis.advise.question import NoAnswer, Question
from hybridsim.analysis.compare.rows import STOPPED
from hybridsim.analysis.ladder import LadderStep
from hybridsim.analysis.sweep import Sweep, sweep
from hybridsim.analysis.time_budget import OutOfTime
from hybridsim.errors import SimulationError
from hybridsim.model import Model

# Rungs as slow as the full model; they are tried only if nothing simpler is adequate.
_DEAR = ("tanh", "arctan", "karnopp")


@dataclass(frozen=True)
class _Point:
    """The measurement at one point; it can be sent to another process."""

    ladder_steps: tuple[LadderStep, ...]
    question: Question
    tol: float
    v0: float | None
    limits: Limits

    def __call__(self, model: Model) -> dict[str, Any]:
        if not self.limits.budget.left:
            raise SimulationError(self.limits.spent)
        try:
            full = by_theory(certificates(model), self.question) or self.question.ask(
                model, self.limits.time_budget()
            )
        except (NoAnswer, OutOfTime) as reason:
            raise SimulationError(str(reason)) from reason
        scene = scene_of(model, full.motion, self.v0)
        errors, stopped = np.full(len(self.ladder_steps), math.inf), np.zeros(len(self.ladder_steps))
        tried = np.zeros(len(self.ladder_steps))
        simplest = None
        for k, step in enumerate(climb(self.ladder_steps, scene, self.question, full, self.tol, self.limits)):
            errors[k], stopped[k], tried[k] = step.error, step.verdict == STOPPED, 1.0
            if simplest is None and step.is_adequate:
                simplest = k
            following = self.ladder_steps[k + 1 : k + 2]
            if simplest is not None and following and following[0].name in _DEAR:
                break
        return {
            "simplest": FULL if simplest is None else self.ladder_steps[simplest].name,
            "error": 0.0 if simplest is None else float(errors[simplest]),
            "value": full.value,
            "errors": errors,
            "stopped": stopped,
            "tried": tried,
        }


def over_region(
    model: Model,
    over: Mapping[str, Any],
    ladder_steps: Sequence[LadderStep],
    question: Question,
    tol: float,
    v0: float | None,
    limits: Limits,
    options: Mapping[str, Any],
) -> tuple[Sweep, tuple[Step, ...]]:
    """Return the map of a region, and a table that combines the results of all points."""
    found = sweep(model, over, _Point(tuple(ladder_steps), question, tol, v0, limits), **options)
    if found.failed.all():
        raise SimulationError(
            f"the quantity has no value at any point of the region: {next(found.problems())[0]}"
        )
    return found, tuple(_steps(found, ladder_steps, tol))


def _steps(found: Sweep, ladder_steps: Sequence[LadderStep], tol: float) -> list[Step]:
    """Return the largest error of each simplified model, and the number of points at which it is adequate."""
    done = ~found.failed
    total = int(done.sum())
    errors, simplest = found["errors"][done], found["simplest"][done]
    steps = []
    for k, rung in enumerate(ladder_steps):
        known = errors[:, k]
        tried = int(found["tried"][done][:, k].sum())
        serves, first = int((known <= tol).sum()), int((simplest == rung.name).sum())
        verdict = NOT_ADEQUATE
        if serves == total:
            verdict = ADEQUATE
        elif serves and serves == tried:
            verdict = WHERE_TRIED
        elif not np.isfinite(known).any():
            verdict = NOT_APPLICABLE
        why = f"adequate at {serves} of {total} points, and the simplest adequate model at {first}"
        if tried < total:
            why = f"adequate at {serves} of the {tried} points at which no simpler model is adequate"
        if stopped_at := int(found["stopped"][done][:, k].sum()):
            why += f"; stopped at {stopped_at}, because it was slower than the full model"
        steps.append(
            Step(rung.name, rung.title, rung.drops, None, float(known.max()), math.nan, verdict, why)
        )
    alone = int((simplest == FULL).sum())
    steps.append(
        Step(
            FULL,
            FULL,
            "nothing",
            None,
            0.0,
            math.nan,
            FULL,
            f"the only adequate model at {alone} of {total} points",
        )
    )
    return steps
