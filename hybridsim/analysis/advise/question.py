"""This module defines the question about a model: one number, read from its steady motion or from a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from hybridsim.analysis.steady.measures import Measures
from hybridsim.analysis.steady.over_run import OverRun
from hybridsim.analysis.steady.result import SteadyState
from hybridsim.analysis.steady.steady_state import steady_state
from hybridsim.analysis.time_budget import Stopwatch
from hybridsim.calls import name_of
from hybridsim.engine.system.period import system_period
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import HybridsimError, UsageError, near, nearest
from hybridsim.model import Model, Output
from hybridsim.model.checks.units import units_of
from hybridsim.simulate import simulate

OF_QUANTITY = ("amplitude", "peak", "maximum", "minimum", "mean", "energy", "harmonic")
OF_CONTACT = ("dissipated", "stick_fraction")
OF_RUN = ("final", "event_time")
OF_MOTION = ("period",)
HEADS = (*OF_QUANTITY, *OF_CONTACT, *OF_MOTION, *OF_RUN)
# quantities that rounding can make non-zero
_SIGNED = ("amplitude", "maximum", "minimum", "mean", "harmonic", "final")
_NEUTRAL = 1e-6  # 1 minus a multiplier of a disturbance; a smaller decay per period counts as none
_STICK = "stick"  # the mode of every contact in which nothing slides

Number = float | complex


class NoAnswer(Exception):
    """Raised if a motion has no value of the requested quantity; the text gives the reason."""


@dataclass(frozen=True)
class Answer:
    """The value of the quantity, the motion, and the seconds that were needed to find the motion."""

    value: Number
    seconds: float
    motion: Any


@dataclass(frozen=True)
class Question:
    """The quantity to compute, given by name or as a function of the motion.

    Parameters
    ----------
    text : "amplitude.x", "harmonic.x.3", "final.x", ...; or the function's name.
    function : of a `SteadyState`, or of a `Solution` if t_span is given.
    t_span : the span of the run in question; None for the steady motion.
    accuracy : the relative accuracy of the computation.
    """

    text: str
    function: Callable[[Any], Any] | None
    t_span: tuple[float, float] | None
    accuracy: float

    @property
    def head(self) -> str:
        """The kind of the quantity, such as "amplitude"."""
        return self.text.partition(".")[0]

    @property
    def name(self) -> str:
        """The state, output or contact to which the quantity refers."""
        return _name_and_number(self.text.partition(".")[2])[0]

    @property
    def number(self) -> int:
        """The number of the harmonic or of the event; 1 by default."""
        return int(_name_and_number(self.text.partition(".")[2])[1] or 1)

    def ask(self, model: Model, progress: Callable[[float], None] | None = None) -> Answer:
        """Compute the quantity from a steady state or a run, and measure the cost without the time for compiling.

        Raises
        ------
        NoAnswer
            If the model gives no value; the text says why.
        """
        watch = Stopwatch()
        try:
            motion = self.motion(model, progress)
            seconds = watch.seconds
            value = self.read(motion)
        except HybridsimError as error:
            raise NoAnswer(error.message) from error
        return Answer(value, seconds, motion)

    def motion(self, model: Model, progress: Callable[[float], None] | None = None) -> Any:
        """Return the steady state of a model, or its run over the time span of the question."""
        if self.t_span is None:
            steady = steady_state(model, tol=self.accuracy, progress=progress)
            if not steady.success:
                raise NoAnswer(steady.message)
            _require_limit_cycle(model, steady)
            return steady
        solution = simulate(model, self.t_span, rtol=0.01 * self.accuracy, progress=progress)
        if not solution.success:
            raise NoAnswer(f"the run ended as {solution.status}: {solution.message}")
        return OverRun(solution)

    def read(self, motion: Any) -> Number:
        """Return the value of the quantity for a motion or a closed form.

        A value is zero if it is below the accuracy relative to the largest value of the same quantity in the
        motion.
        """
        if self.function is not None:
            return self._call(motion)
        value = self._read(motion)
        if isinstance(motion, Measures) and self.head in _SIGNED:
            return value if abs(value) > self.accuracy * motion.peak[self.name] else 0.0
        return value

    def _read(self, motion: Any) -> float:
        head, name = self.head, self.name
        is_run = isinstance(motion, Measures)
        if head == "event_time":
            return self._event_time(motion)
        if head == "period":
            found = float(getattr(motion, "period", math.nan))
            if math.isnan(found):
                raise NoAnswer("the motion does not oscillate")
            return found
        if head == "harmonic":
            if not is_run:
                _of(motion.mean, name, head)
            return abs(complex(motion.harmonic(name, self.number)))
        if is_run and head == "final":
            return float(motion.solution.output(name, motion.solution.t_end))
        if is_run and head == "dissipated":
            return motion.solution.integral(_power(name))
        if is_run and head == "stick_fraction":
            return stuck(motion, name)
        return _of(getattr(motion, head, {}), name, head)

    def _call(self, motion: Any) -> Number:
        assert self.function is not None
        if not isinstance(motion, Measures):
            raise NoAnswer("the result is a closed form, so there is no trajectory to pass to the function")
        argument = motion if self.t_span is None else motion.solution
        value = self.function(argument)
        try:
            found = complex(value) if isinstance(value, complex) else float(value)
        except (TypeError, ValueError, OverflowError):
            raise NoAnswer(f"`quantity` returned {value!r}, which is not a number") from None
        if not math.isfinite(abs(found)):
            raise NoAnswer(f"`quantity` returned {value!r}, which is not finite")
        return found

    def _event_time(self, motion: Any) -> float:
        if not isinstance(motion, Measures):
            raise NoAnswer("the result is a closed form, which has no events")
        system = motion.solution.model
        known = {c.name for c in system.all_components()} | {m.name for m in system.monitors}
        times = motion.solution.event_times(self.name).tolist() if self.name in known else []
        if len(times) < self.number:
            raise NoAnswer(f"the run has only {len(times)} events of {self.name}")
        return float(times[self.number - 1])


def _require_limit_cycle(model: Model, steady: SteadyState) -> None:
    """Reject the vibration of an undamped free system, because its amplitude depends on the initial state."""
    if steady.kind != "periodic" or system_period(system_of(model)) is not None:
        return
    if max(abs(steady.multipliers), default=0.0) > 1.0 - _NEUTRAL:
        raise NoAnswer("the motion is undamped, so the amplitude depends on the initial state")


def stuck(motion: Measures, contact: str) -> float:
    """Return the fraction of a motion that a contact spends in stick, or 0 if the contact has no stick mode."""
    return motion.mode_fraction.get(f"{contact}.{_STICK}", 0.0)


def _of(values: Any, name: str, head: str) -> float:
    if name not in values:
        raise NoAnswer(f"the motion has no value {head}.{name}")
    return float(values[name])


# -- outputs added to a model so that every rung can be read
# ------------------------------------------------------


def _power(contact: str) -> str:
    return f"power_of_{contact}"


def _velocity(contact: str) -> str:
    return f"velocity_of_{contact}"


def _speed(contact: str) -> str:
    return f"speed_of_{contact}"


def with_contact_outputs(model: Model) -> Model:
    """Return the model with velocity, speed and power of each contact as additional outputs."""
    known = {output.name for output in model.outputs}
    more = []
    for contact in model.contacts:
        velocity = f"({contact.velocity.text})"
        texts = {
            _velocity(contact.name): velocity,
            _speed(contact.name): f"abs{velocity}",
            _power(contact.name): f"{contact.name}*{velocity}",
        }
        for name in known & texts.keys():
            raise UsageError(
                f"the output '{name}' has the name of a quantity that is added for contact {contact.name}",
                remedy="rename the output",
            )
        more += [Output(name, text) for name, text in texts.items()]  # type: ignore[arg-type]  # made one
    return replace(model, outputs=(*model.outputs, *more)) if more else model


def speeds(model: Model, motion: Measures) -> tuple[dict[str, float], float]:
    """Return the mean speed of each contact while it slides, and the largest speed of all contacts."""
    means, peak = {}, 0.0
    for contact in model.contacts:
        sliding = 1.0 - stuck(motion, contact.name)
        means[contact.name] = motion.mean[_speed(contact.name)] / sliding if sliding > 0.0 else 0.0
        peak = max(peak, motion.peak[_velocity(contact.name)])
    return means, peak


# -- from text to a question


def question_of(model: Model, quantity: Any, t_span: tuple[float, float] | None, accuracy: float) -> Question:
    """Return the question after checking that the model has the quantity.

    Raises
    ------
    UsageError
        For an unknown quantity, or a quantity of a run without t_span.
    """
    if callable(quantity):
        return Question(name_of(quantity), quantity, t_span, accuracy)
    if not isinstance(quantity, str):
        raise UsageError(
            f"`quantity` cannot be {quantity!r}",
            remedy=f"use a name such as {'amplitude.x'!r}, or a function",
        )
    head, _, rest = quantity.partition(".")
    name, number = _name_and_number(rest)
    if head not in HEADS:
        meant = [f"{other}.{rest}" if rest else other for other in near(head, HEADS)]
        named = nearest(quantity, meant) if meant else nearest(head, HEADS, kind="quantities")
        raise UsageError(f"`quantity` is unknown: {quantity!r}", remedy=named)
    if head in OF_RUN and t_span is None:
        raise UsageError(
            f"{quantity} is read from a run and needs `t_span`",
            remedy="pass `t_span`, such as t_span=(0, 10)",
        )
    if head in OF_MOTION:
        if t_span is not None or rest:
            raise UsageError(
                f"`quantity` cannot be {quantity!r}", remedy="write 'period' alone, and remove `t_span`"
            )
        return Question(quantity, None, None, accuracy)
    names = _names(model, head)
    if name not in names:
        raise UsageError(f"`quantity` is unknown: {quantity!r}", remedy=nearest(name, names, kind=head))
    if number and head not in ("harmonic", "event_time"):
        raise UsageError(f"`quantity` cannot be {quantity!r}", remedy=f"write only {head}.{name}")
    if head == "event_time" and number and int(number) < 1:
        raise UsageError(f"`quantity` cannot be {quantity!r}", remedy="use an event number from 1 on")
    return Question(quantity, None, t_span, accuracy)


def _name_and_number(text: str) -> tuple[str, str]:
    """Split a text into the name of a quantity, which may contain dots, and an optional number."""
    name, _, number = text.rpartition(".")
    return (name, number) if name and number.isdecimal() else (text, "")


def _names(model: Model, head: str) -> list[str]:
    if head in OF_CONTACT:
        return [contact.name for contact in model.contacts]
    if head == "event_time":
        return [c.name for c in model.all_components()] + [m.name for m in model.monitors]
    return list(units_of(model))
