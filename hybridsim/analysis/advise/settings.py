"""This module finds the fastest integrator setting that computes a quantity within the tolerance."""

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
from hybridsim.analysis.advise.question import Answer, NoAnswer, Number, Question
from hybridsim.analysis.compare.rows import NOT_STARTED, STOPPED
from hybridsim.analysis.steady.over_run import OverRun
from hybridsim.analysis.time_budget import OutOfTime, Stopwatch
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.model import Model
from hybridsim.simulate import simulate

# Each family is tried from loose to tight until it is within the tolerance, which finds its cheapest setting.
_RTOLS = (1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
_STEPS = (75, 300, 1200, 4800)  # steps per period; 1200 is the published value
_MORE = 4 / 3  # factor of the steps; a fixed step must also be adequate with so many more
_UNCONTROLLED = (
    1.5  # weight of the time of a fixed step, because its error is uncontrolled and times are noisy
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
_MIN_PERIODS, _MAX_PERIODS = 8, 1000  # periods of settling
_NEUTRAL = 1.0 - 1e-6  # the multiplier from which a disturbance counts as persistent
_SHARE = 0.01  # of the tolerance; the transient that settling may leave
_RUN_STEPS = 10  # periods assumed in a run with t_span, to choose fixed steps


@dataclass(frozen=True)
class Setting:
    """One integrator setting for the full model, with its result.

    Parameters
    ----------
    integrator, options : as for `simulate`; "steady_state" means a call of that function.
    value, error : the quantity, and its error relative to the accurate value.
    seconds : the measured time.
    verdict : "adequate", "not adequate", "does not apply" if the integrator cannot run the model, "failed",
        "stopped", "not started".
    why : the reason of a failure, or empty.
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
        """Whether the setting computes the requested value within the tolerance."""
        return self.verdict == ADEQUATE

    @property
    def title(self) -> str:
        """The integrator and its options as one line of text."""
        return " ".join([self.integrator, *(f"{name}={value:g}" for name, value in self.options.items())])


@dataclass(frozen=True)
class _Settling:
    """A run that is long enough to become steady; the quantity is measured at the end of the run."""

    question: Question
    span: tuple[float, float]
    save: str | float
    step_base: float

    def options(self, option: str, value: float) -> dict[str, float]:
        """Return the options for `simulate`; a number of steps means steps per period."""
        if not option:
            return {}
        return {"step": self.step_base / value} if option == "steps" else {option: value}

    def ask(self, model: Model, name: str, options: Mapping[str, Any], watch: Watch | None = None) -> Answer:
        stopwatch = Stopwatch()
        try:
            solution = simulate(model, self.span, integrator=name, keep=self.save, progress=watch, **options)
            seconds = stopwatch.seconds
            if not solution.success:
                raise NoAnswer(f"the run ended as {solution.status}: {solution.message}")
            run = OverRun(solution)
            if self.question.t_span is None:
                run.period = solution.t_end - solution.t_start
            value = self.question.read(run)
        except HybridsimError as error:
            raise NoAnswer(error.message) from error
        return Answer(value, seconds, run)


def settings(
    model: Model, question: Question, full: Answer, tol: float, limits: Limits, report: Callable[[str], None]
) -> tuple[Setting, ...]:
    """Try the settings of each integrator from the loosest to an adequate one, and return them sorted by `rank`."""
    found = []
    if question.t_span is None:
        loose = Question(question.text, question.function, None, max(_SHARE * tol, question.accuracy))
        found.append(_measured(_SHOOTING, {}, partial(loose.ask, model), full, tol, limits))
    # A run has no period, and a function of a steady state cannot take a run.
    if question.t_span is not None or (question.function is None and question.head != "period"):
        settling = _settling(question, full.motion, tol)
        for name, option in _FAMILIES:
            values: tuple[float, ...] = {"rtol": _RTOLS, "steps": _STEPS}.get(option, (0.0,))
            for value in values:
                report(f"{name} {value:g}" if option else name)

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
    """Return a sort key by which adequate settings come first, and fast settings come before slow ones."""
    worth = _UNCONTROLLED if "step" in setting.options else 1.0
    return not setting.is_adequate, math.isnan(setting.seconds), worth * setting.seconds


def confirmed(one: Setting, finer: Setting, tol: float) -> Setting:
    """Return a fixed-step setting, marked as not adequate if a shorter step is not adequate."""
    if finer.is_adequate or finer.value is None:
        return one
    why = f"{finer.title} has the error {finer.error:.2g}, above {tol:g}: the error does not decrease with the step"
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
        answer = limits.warm(ask, limits.time_budget(full))
    except NoAnswer as reason:
        refused = isinstance(reason.__cause__, UsageError)
        return Setting(name, options, verdict=NOT_APPLICABLE if refused else FAILED, why=str(reason))
    except OutOfTime as fault:
        return Setting(name, options, verdict=STOPPED, why=limits.reason(fault, full))
    error = relative_error(answer.value, full.value)
    verdict = ADEQUATE if error <= tol else NOT_ADEQUATE
    return Setting(name, options, answer.value, error, answer.seconds, verdict)


def _settling(question: Question, motion: Any, tol: float) -> _Settling:
    """Return a run from the model's start that is long enough for the slowest disturbance to decay."""
    if question.t_span is not None:
        t0, t1 = question.t_span
        return _Settling(question, (t0, t1), "all", (t1 - t0) / _RUN_STEPS)
    period = (
        motion.period if math.isfinite(motion.period) else motion.solution.t_end - motion.solution.t_start
    )
    slowest = 0.0 if motion.kind == "equilibrium" else float(max(abs(motion.multipliers), default=0.0))
    if slowest <= 0.0:
        count = _MIN_PERIODS
    elif slowest >= _NEUTRAL:
        count = max(
            motion.periods, _MIN_PERIODS
        )  # no disturbance decays; the motion was reached by following it
    else:
        count = min(max(math.ceil(math.log(_SHARE * tol) / math.log(slowest)), _MIN_PERIODS), _MAX_PERIODS)
    return _Settling(question, (0.0, count * period), period, period)
