"""This module evaluates the simplified models of one test case: value, error, cost and verdict of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from hybridsim.analysis.advise.certificates import Certificate
from hybridsim.analysis.advise.question import Answer, NoAnswer, Number, Question, speeds
from hybridsim.analysis.compare.rows import NOT_STARTED, STOPPED
from hybridsim.analysis.compare.timed_runs import Budget
from hybridsim.analysis.ladder import DoesNotApply, LadderStep, NothingToDrop, Scene
from hybridsim.analysis.steady.measures import Measures
from hybridsim.analysis.time_budget import OutOfTime, Stopwatch, TimeBudget
from hybridsim.errors import ModelError
from hybridsim.model import Model

ADEQUATE, NOT_ADEQUATE, NOT_APPLICABLE, FULL = "adequate", "not adequate", "does not apply", "full model"
NOTHING_TO_DROP, WHERE_TRIED = "nothing to drop", "adequate where tried"
WITHOUT_TRIAL = (NOT_APPLICABLE, NOTHING_TO_DROP)  # verdicts without a run
_AGAIN_BELOW = 2.0  # seconds; only shorter runs are repeated, to measure their time without set-up
Watch = Callable[[float], None]
"""The type of progress callbacks that long computations call from time to time; see `TimeBudget`."""

_DEARER = 10.0  # times the full model's cost; a simpler model that takes longer is stopped


@dataclass(frozen=True)
class Step:
    """One simplified model with its result.

    Parameters
    ----------
    name, title, drops : the texts of the rung.
    value : the quantity; None if the rung gives none.
    error : relative to the full model's value; inf if that is zero and this one is not.
    seconds : the measured time for the value.
    verdict : "adequate", "not adequate", "does not apply", "nothing to drop" if the model lacks the feature that the
        rung would drop, "full model", "stopped" for a rung that became far
            slower than the full model, "not started" if the budget was spent; over a region "adequate where tried".
        why : the reason, in a sentence.
        model : the simpler model, if the rung is a model.
    """

    name: str
    title: str
    drops: str
    value: Number | None
    error: float
    seconds: float
    verdict: str
    why: str
    model: Model | None = field(default=None, repr=False, compare=False)

    @property
    def is_adequate(self) -> bool:
        """Whether the value of the simplified model is within the tolerance."""
        return self.verdict in (ADEQUATE, FULL)


def relative_error(value: Number, full: Number) -> float:
    """Return |value - full|/|full|. If the full value is zero, return 0 for a zero value and infinity otherwise."""
    if full == 0:
        return 0.0 if value == 0 else math.inf
    return abs(value - full) / abs(full)


@dataclass(frozen=True)
class Limits:
    """The time limits for the parts of an `advise` call.

    Parameters
    ----------
    budget : the time for everything.
    least : seconds that each part may take, however quick the full model is.
    repeat : whether quick runs are repeated, so that their time excludes set-up.
    report : called at each check of the time.
    """

    budget: Budget
    least: float
    repeat: bool = True
    report: Callable[[], None] | None = None

    def time_budget(self, full: Answer | None = None) -> TimeBudget:
        """Return the time limit of a computation: a multiple of the full model's cost, at most the remaining time."""
        own = math.inf if full is None else max(_DEARER * full.seconds, self.least)
        return TimeBudget(min(own, self.budget.left), self.report)

    def reason(self, fault: OutOfTime, full: Answer) -> str:
        """Return the reason why a computation was stopped before its end."""
        if not self.budget.left:
            return self.spent
        return f"slower than the full model: {fault}, but the full model takes {duration(full.seconds)}"

    @property
    def spent(self) -> str:
        """The reason why a computation was skipped, if no time was left for it."""
        return f"the budget of {self.budget.seconds:.3g} s is spent"

    def warm(self, ask: Callable[[Watch | None], Answer], watch: Watch) -> Answer:
        """Compute the answer; repeat a fast computation, so that its cost contains no one-time set-up."""
        first = ask(watch)
        if not self.repeat or first.seconds > _AGAIN_BELOW:
            return first
        second = ask(None)
        return second if second.seconds < first.seconds else first


def duration(seconds: float) -> str:
    """Return a time as text, in ms or s."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def scene_of(model: Model, motion: Any, v0: float | None) -> Scene:
    """Return the data from which simplified models are made: the full model and its sliding speeds."""
    if isinstance(motion, Measures):
        means, peak = speeds(model, motion)
        return Scene(model, means, peak or None, v0)
    return Scene(model, getattr(motion, "speed", {}), getattr(motion, "fastest", None), v0)


def climb(
    ladder_steps: Sequence[LadderStep],
    scene: Scene,
    question: Question,
    full: Answer,
    tol: float,
    limits: Limits,
) -> Iterator[Step]:
    """Yield the result of each simplified model, beginning with the simplest model."""
    for rung in ladder_steps:
        if limits.budget.left:
            yield _step(rung, scene, question, full, tol, limits)
        else:
            yield _without(rung, NOT_STARTED, limits.spent)


def _step(
    rung: LadderStep, scene: Scene, question: Question, full: Answer, tol: float, limits: Limits
) -> Step:
    model: Model | None = None
    time_budget = limits.time_budget(full)
    budgeted = replace(scene, progress=time_budget)
    try:
        simpler = rung.apply(budgeted)
        if isinstance(simpler, Model):
            model = simpler
            answer = limits.warm(partial(question.ask, simpler), time_budget)
        else:
            answer = limits.warm(partial(_formula, rung, budgeted, question), time_budget)
    except NothingToDrop as reason:
        return _without(rung, NOTHING_TO_DROP, str(reason), model)
    except DoesNotApply as reason:
        return _without(rung, NOT_APPLICABLE, str(reason), model)
    except NoAnswer as reason:
        why = str(reason).partition("\n")[0]
        if isinstance(reason.__cause__, ModelError):  # the simpler model cannot be run at all
            return _without(rung, NOT_APPLICABLE, f"the simpler model cannot be run: {why}")
        return _without(rung, NOT_ADEQUATE, f"the simpler model has no {question.text}: {why}", model)
    except OutOfTime as fault:
        return _without(rung, STOPPED, limits.reason(fault, full), model)
    error = relative_error(answer.value, full.value)
    verdict = ADEQUATE if error <= tol else NOT_ADEQUATE
    why = _why(error, tol, full.value)
    return Step(rung.name, rung.title, rung.drops, answer.value, error, answer.seconds, verdict, why, model)


def _formula(rung: LadderStep, scene: Scene, question: Question, _: Watch | None = None) -> Answer:
    """Return the value of a closed form; its cost is the time to evaluate the formula."""
    watch = Stopwatch()
    motion = rung.apply(scene)
    return Answer(question.read(motion), watch.seconds, motion)


def _without(rung: LadderStep, verdict: str, why: str, model: Model | None = None) -> Step:
    """Return the entry for a simplified model without a computed value."""
    return Step(rung.name, rung.title, rung.drops, None, math.inf, math.nan, verdict, why, model)


def _why(error: float, tol: float, full: Number) -> str:
    if math.isinf(error):
        return "the full model's value is zero, but this value is not"
    sign = "<=" if error <= tol else ">"
    return f"error {error:.2g} {sign} {tol:g}" if full != 0 else "zero, like the full model's value"


def by_theory(certificates: Sequence[Certificate], question: Question) -> Answer | None:
    """Return the full model's answer without a run, if a known property determines it."""
    for certificate in certificates:
        if certificate.motion is None or (certificate.steady_only and question.t_span is not None):
            continue
        try:
            return Answer(question.read(certificate.motion), 0.0, certificate.motion)
        except NoAnswer:
            continue
    return None
