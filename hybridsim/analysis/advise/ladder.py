"""The ladder of one scene: every rung with its value, its error against the full model, its cost and its verdict."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from hybridsim.analysis.advise.certificates import Certificate
from hybridsim.analysis.advise.question import Answer, NoAnswer, Number, Question, speeds
from hybridsim.analysis.rungs import DoesNotApply, Rung, Scene
from hybridsim.analysis.steady.measures import Measures
from hybridsim.model import Model

ADEQUATE, NOT_ADEQUATE, NOT_APPLICABLE, FULL = "adequate", "not adequate", "does not apply", "full model"
_AGAIN_BELOW = 20.0  # seconds: what is quicker is done twice, since the first time may have compiled


@dataclass(frozen=True)
class Step:
    """One rung as it fared.

    Parameters
    ----------
    name, title, drops : of the rung.
    value : of the quantity; None where the rung gives none.
    error : relative to the full model's value; inf where that is zero and this one is not.
    seconds : measured, for the value.
    verdict : "adequate", "not adequate", "does not apply" or "full model".
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


def asked(question: Question, model: Model) -> Answer:
    """The answer with a cost that no compilation is part of."""
    first = question.ask(model)
    if first.seconds > _AGAIN_BELOW:
        return first
    second = question.ask(model)
    return second if second.seconds < first.seconds else first


def scene_of(model: Model, motion: Any, v0: float | None) -> Scene:
    """What rungs may know of the full motion."""
    if isinstance(motion, Measures):
        means, peak = speeds(model, motion)
        return Scene(model, means, peak or None, v0)
    return Scene(model, getattr(motion, "speed", {}), getattr(motion, "fastest", None), v0)


def climb(
    rungs: Sequence[Rung],
    scene: Scene,
    question: Question,
    full: Number,
    tol: float,
    ask: Callable[[Question, Model], Answer] = asked,
) -> Iterator[Step]:
    """The steps, one after the other, from the simplest up."""
    for rung in rungs:
        yield _step(rung, scene, question, full, tol, ask)


def _step(
    rung: Rung,
    scene: Scene,
    question: Question,
    full: Number,
    tol: float,
    ask: Callable[[Question, Model], Answer],
) -> Step:
    model: Model | None = None
    began = time.perf_counter()
    try:
        simpler = rung.apply(scene)
        spent = time.perf_counter() - began
        if isinstance(simpler, Model):
            model = simpler
            answer = ask(question, model)
            value, seconds = answer.value, answer.seconds
        else:
            value, seconds = question.read(simpler), spent
    except DoesNotApply as reason:
        return Step(
            rung.name, rung.title, rung.drops, None, math.inf, math.nan, NOT_APPLICABLE, str(reason), model
        )
    except NoAnswer as reason:
        why = f"it gives no {question.text}: {reason}"
        return Step(rung.name, rung.title, rung.drops, None, math.inf, math.nan, NOT_ADEQUATE, why, model)
    error = relative_error(value, full)
    verdict = ADEQUATE if error <= tol else NOT_ADEQUATE
    return Step(
        rung.name, rung.title, rung.drops, value, error, seconds, verdict, _why(error, tol, full), model
    )


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
