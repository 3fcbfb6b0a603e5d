"""The ladder of one scene: every rung with its value, its error against the full model, its cost and its verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from hybridsim.analysis.advise.certificates import Certificate
from hybridsim.analysis.advise.question import Answer, NoAnswer, Number, Question, speeds
from hybridsim.analysis.allowance import Allowance, OutOfTime, Stopwatch
from hybridsim.analysis.race import Budget
from hybridsim.analysis.rows import NOT_STARTED, STOPPED
from hybridsim.analysis.rungs import DoesNotApply, NothingToDrop, Rung, Scene
from hybridsim.analysis.steady.measures import Measures
from hybridsim.errors import ModelError
from hybridsim.model import Model

ADEQUATE, NOT_ADEQUATE, NOT_APPLICABLE, FULL = "adequate", "not adequate", "does not apply", "full model"
NOTHING_TO_DROP, WHERE_TRIED = "nothing to drop", "adequate where tried"
WITHOUT_TRIAL = (NOT_APPLICABLE, NOTHING_TO_DROP)  # verdicts that no run stands behind
_AGAIN_BELOW = (
    2.0  # seconds: what takes longer is not done twice to have it without making the model's functions
)
Watch = Callable[[float], None]
"""Called from time to time by what takes time; see `Allowance`."""

_DEARER = (
    10.0  # times the full model's cost: whoever takes a simpler model for its cost has given it up by then
)


@dataclass(frozen=True)
class Step:
    """One rung as it fared.

    Parameters
    ----------
    name, title, drops : of the rung.
    value : of the quantity; None where the rung gives none.
    error : relative to the full model's value; inf where that is zero and this one is not.
    seconds : measured, for the value.
    verdict : "adequate", "not adequate", "does not apply", "nothing to drop" where the model has not got what the
        rung would drop, "full model"; "stopped" for a rung that has become far
        dearer than the full model, "not started" where the budget was spent; over a region "adequate where tried".
    why : a sentence.
    model : the simpler model, where it is one.
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
        """Whether it answers within the tolerance."""
        return self.verdict in (ADEQUATE, FULL)


def relative_error(value: Number, full: Number) -> float:
    """|value - full|/|full|; where the full value is zero nothing but zero meets it."""
    if full == 0:
        return 0.0 if value == 0 else math.inf
    return abs(value - full) / abs(full)


@dataclass(frozen=True)
class Limits:
    """What the parts of an advice may take.

    Parameters
    ----------
    budget : of all of it.
    least : seconds that a part may take however cheap the full model is.
    repeat : whether what is quick is done twice, so that its cost is that of a model whose functions are ready.
    told : called at every look at the time.
    """

    budget: Budget
    least: float
    repeat: bool = True
    told: Callable[[], None] | None = None

    def allowance(self, full: Answer | None = None) -> Allowance:
        """For one part: by the cost of the full model where that is known, and by what is left."""
        own = math.inf if full is None else max(_DEARER * full.seconds, self.least)
        return Allowance(min(own, self.budget.left), self.told)

    def reason(self, fault: OutOfTime, full: Answer) -> str:
        """Why a part was stopped."""
        if not self.budget.left:
            return self.spent
        return f"dearer than the full model: {fault}, and that takes {duration(full.seconds)}"

    @property
    def spent(self) -> str:
        """Why a part was not started, or ended."""
        return f"the budget of {self.budget.seconds:.3g} s is spent"

    def warm(self, ask: Callable[[Watch | None], Answer], watch: Watch) -> Answer:
        """The answer, with what it costs when all that is made once has been made."""
        first = ask(watch)
        if not self.repeat or first.seconds > _AGAIN_BELOW:
            return first
        second = ask(None)
        return second if second.seconds < first.seconds else first


def duration(seconds: float) -> str:
    """Seconds as a person says them."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def scene_of(model: Model, motion: Any, v0: float | None) -> Scene:
    """What rungs may know of the full motion."""
    if isinstance(motion, Measures):
        means, peak = speeds(model, motion)
        return Scene(model, means, peak or None, v0)
    return Scene(model, getattr(motion, "speed", {}), getattr(motion, "fastest", None), v0)


def climb(
    rungs: Sequence[Rung], scene: Scene, question: Question, full: Answer, tol: float, limits: Limits
) -> Iterator[Step]:
    """The steps, one after the other, from the simplest up."""
    for rung in rungs:
        if limits.budget.left:
            yield _step(rung, scene, question, full, tol, limits)
        else:
            yield _without(rung, NOT_STARTED, limits.spent)


def _step(rung: Rung, scene: Scene, question: Question, full: Answer, tol: float, limits: Limits) -> Step:
    model: Model | None = None
    allowance = limits.allowance(full)
    watched = replace(scene, progress=allowance)
    try:
        simpler = rung.apply(watched)
        if isinstance(simpler, Model):
            model = simpler
            answer = limits.warm(partial(question.ask, simpler), allowance)
        else:
            answer = limits.warm(partial(_formula, rung, watched, question), allowance)
    except NothingToDrop as reason:
        return _without(rung, NOTHING_TO_DROP, str(reason), model)
    except DoesNotApply as reason:
        return _without(rung, NOT_APPLICABLE, str(reason), model)
    except NoAnswer as reason:
        why = str(reason).partition("\n")[0]
        if isinstance(
            reason.__cause__, ModelError
        ):  # that is no motion of the simpler model, but none at all
            return _without(rung, NOT_APPLICABLE, f"its model cannot be run: {why}")
        return _without(rung, NOT_ADEQUATE, f"it gives no {question.text}: {why}", model)
    except OutOfTime as fault:
        return _without(rung, STOPPED, limits.reason(fault, full), model)
    error = relative_error(answer.value, full.value)
    verdict = ADEQUATE if error <= tol else NOT_ADEQUATE
    why = _why(error, tol, full.value)
    return Step(rung.name, rung.title, rung.drops, answer.value, error, answer.seconds, verdict, why, model)


def _formula(rung: Rung, scene: Scene, question: Question, _: Watch | None = None) -> Answer:
    """The answer of a rung that is a formula: to make it is all that it costs."""
    watch = Stopwatch()
    motion = rung.apply(scene)
    return Answer(question.read(motion), watch.seconds, motion)


def _without(rung: Rung, verdict: str, why: str, model: Model | None = None) -> Step:
    """A step without a value."""
    return Step(rung.name, rung.title, rung.drops, None, math.inf, math.nan, verdict, why, model)


def _why(error: float, tol: float, full: Number) -> str:
    if math.isinf(error):
        return "the full model's value is zero, this one is not"
    sign = "<=" if error <= tol else ">"
    return f"error {error:.2g} {sign} {tol:g}" if full != 0 else "zero, as the full model's value"


def by_theory(certificates: Sequence[Certificate], question: Question) -> Answer | None:
    """The full model's answer without a run, where a certificate gives it."""
    for certificate in certificates:
        if certificate.motion is None or (certificate.steady_only and question.t_span is not None):
            continue
        try:
            return Answer(question.read(certificate.motion), 0.0, certificate.motion)
        except NoAnswer:
            continue
    return None
