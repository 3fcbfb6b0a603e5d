"""Which integrator setting answers a question within the tolerance, and at what cost: each is run, none is guessed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from hybridsim.analysis.advise.ladder import (
    ADEQUATE,
    NOT_ADEQUATE,
    NOT_APPLICABLE,
    Limits,
    Watch,
    relative_error,
)
from hybridsim.analysis.advise.question import Answer, NoAnswer, Number, OverRun, Question
from hybridsim.analysis.allowance import OutOfTime, Stopwatch
from hybridsim.analysis.rows import NOT_STARTED, STOPPED
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.model import Model
from hybridsim.simulate import simulate

# From loose to tight: each family is followed until it is within the tolerance, so that its cheapest is found.
_RTOLS = (1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
_STEPS = (75, 300, 1200, 4800)  # a period; 1200 is the published one
_MORE = 4 / 3  # times the steps, with which the outcome of a fixed step has to be adequate too
_UNCONTROLLED = (
    1.5  # what the time of a fixed step counts for: its error is that of this run, and times are noisy
)
_FAMILIES: tuple[tuple[str, str], ...] = (
    ("exact", ""),
    ("dop853", "rtol"),
    ("tsit5", "rtol"),
    ("rk4-dichotomy", "steps"),
    ("rk4-sign", "steps"),
)
_SHOOTING = "steady_state"
FAILED = "failed"
_FEWEST, _MOST = 8, 1000  # periods of settling
_NEUTRAL = 1.0 - 1e-6  # a multiplier from there on stands for what stays
_SHARE = 0.01  # of the tolerance: what settling may leave over
_RUN_STEPS = 10  # periods that a run asked about is taken to have, for fixed steps


@dataclass(frozen=True)
class Setting:
    """One way to run the full model.

    Parameters
    ----------
    integrator, options : as for `simulate`; "steady_state" is the call of that name.
    value, error : of the quantity; the error is relative to the accurate value.
    seconds : measured.
    verdict : "adequate", "not adequate", "does not apply" where the integrator cannot run the model, "failed",
        "stopped", "not started".
    why : what went wrong, if anything.
    """

    integrator: str
    options: Mapping[str, Any] = field(default_factory=dict)
    value: Number | None = None
    error: float = math.inf
    seconds: float = math.nan
    verdict: str = FAILED
    why: str = ""

    @property
    def is_adequate(self) -> bool:
        """Whether it is within the tolerance."""
        return self.verdict == ADEQUATE

    @property
    def title(self) -> str:
        """Integrator and options in a line."""
        return " ".join([self.integrator, *(f"{name}={value:g}" for name, value in self.options.items())])


@dataclass(frozen=True)
class _Settling:
    """How long a run has to be, and how much of its end is read."""

    question: Question
    span: tuple[float, float]
    save: str | float
    step_base: float

    def options(self, option: str, value: float) -> dict[str, float]:
        """What `simulate` is given; a number of steps is one in a period."""
        if not option:
            return {}
        return {"step": self.step_base / value} if option == "steps" else {option: value}

    def ask(self, model: Model, name: str, options: Mapping[str, Any], watch: Watch | None = None) -> Answer:
        stopwatch = Stopwatch()
        try:
            solution = simulate(model, self.span, integrator=name, save=self.save, progress=watch, **options)
            seconds = stopwatch.seconds
            if not solution.success:
                raise NoAnswer(f"{solution.status}: {solution.message}")
            run = OverRun(solution)
            if self.question.t_span is None:
                run.period = solution.t_end - solution.t_start
            value = self.question.read(run)
        except HybridsimError as error:
            raise NoAnswer(error.message) from error
        return Answer(value, seconds, run)


def settings(
    model: Model,
    question: Question,
    full: Answer,
    tol: float,
    limits: Limits,
    told: Callable[[str], None],
) -> tuple[Setting, ...]:
    """Every family from its loosest setting on until one is within the tolerance, the adequate ones by `rank`."""
    found = []
    if question.t_span is None:
        loose = Question(question.text, question.function, None, max(_SHARE * tol, question.accuracy))
        found.append(_measured(_SHOOTING, {}, partial(loose.ask, model), full, tol, limits))
    # a run has no period of its own, and a function of a steady state cannot be handed a run
    if question.t_span is not None or (question.function is None and question.head != "period"):
        settling = _settling(question, full.motion, tol)
        for name, option in _FAMILIES:
            values: tuple[float, ...] = {"rtol": _RTOLS, "steps": _STEPS}.get(option, (0.0,))
            for value in values:
                told(f"{name} {value:g}" if option else name)

                def measured(value: float, name: str = name, option: str = option) -> Setting:
                    options = settling.options(option, value)
                    ask = partial(settling.ask, model, name, options)
                    return _measured(name, options, ask, full, tol, limits)

                one = measured(value)
                if option == "steps" and one.is_adequate:
                    one = confirmed(one, measured(_MORE * value), tol)
                found.append(one)
                if one.is_adequate or one.value is None:
                    break
    return tuple(sorted(found, key=rank))


def rank(setting: Setting) -> tuple[bool, bool, float]:
    """Adequate ones first, quickest first; one that does not control its error has to be clearly quicker."""
    worth = _UNCONTROLLED if "step" in setting.options else 1.0
    return not setting.is_adequate, math.isnan(setting.seconds), worth * setting.seconds


def confirmed(one: Setting, finer: Setting, tol: float) -> Setting:
    """A setting with a fixed step that is adequate, unless with a shorter one it is not: then its error is chance."""
    if finer.is_adequate or finer.value is None:
        return one
    why = f"{finer.title} is off by {finer.error:.2g}, beyond {tol:g}: the error does not fall with the step"
    return replace(one, verdict=NOT_ADEQUATE, why=why)


def _measured(
    name: str,
    options: Mapping[str, Any],
    ask: Callable[[Watch | None], Answer],
    full: Answer,
    tol: float,
    limits: Limits,
) -> Setting:
    if not limits.budget.left:
        return Setting(name, options, verdict=NOT_STARTED, why=limits.spent)
    try:
        answer = limits.warm(ask, limits.allowance(full))
    except NoAnswer as reason:
        refused = isinstance(reason.__cause__, UsageError)
        return Setting(name, options, verdict=NOT_APPLICABLE if refused else FAILED, why=str(reason))
    except OutOfTime as fault:
        return Setting(name, options, verdict=STOPPED, why=limits.reason(fault, full))
    error = relative_error(answer.value, full.value)
    verdict = ADEQUATE if error <= tol else NOT_ADEQUATE
    return Setting(name, options, answer.value, error, answer.seconds, verdict)


def _settling(question: Question, motion: Any, tol: float) -> _Settling:
    """A run from the model's start that is long enough: by how fast the slowest disturbance decays."""
    if question.t_span is not None:
        t0, t1 = question.t_span
        return _Settling(question, (t0, t1), "all", (t1 - t0) / _RUN_STEPS)
    period = (
        motion.period if math.isfinite(motion.period) else motion.solution.t_end - motion.solution.t_start
    )
    slowest = 0.0 if motion.kind == "equilibrium" else float(max(abs(motion.multipliers), default=0.0))
    if slowest <= 0.0:
        count = _FEWEST
    elif slowest >= _NEUTRAL:
        count = max(motion.periods, _FEWEST)  # nothing decays, so that it was reached by following alone
    else:
        count = min(max(math.ceil(math.log(_SHARE * tol) / math.log(slowest)), _FEWEST), _MOST)
    return _Settling(question, (0.0, count * period), period, period)
