"""This module reads values from the command line: models, parameters, time spans and options."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import hybridsim
from hybridsim.errors import ModelError, Place, UsageError
from hybridsim.expr import Expression, evaluate, parse, require_names
from hybridsim.model import Model

DEFAULT_PERIODS = 100
COMPARED_PERIODS = 20  # shorter, because a comparison runs the model dozens of times
DEFAULT_SECONDS = 10.0  # for a model without a forcing period: about ten oscillations at 1 Hz

_MOST_DIGITS = 15  # digits of a count, which a double represents exactly
MOST_WORKERS = 1024  # more than the processors of any machine; each worker needs memory
_NUMBER = r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*"
_PERIODS, _WITH_UNIT = re.compile(_NUMBER + r"T\s*"), re.compile(_NUMBER + r"[A-Za-z]+\s*")


def assignment(text: str) -> tuple[str, str]:
    """Split NAME=VALUE into name and value."""
    name, equals, value = text.partition("=")
    if not equals or not name.strip() or not value.strip():
        raise argparse.ArgumentTypeError(f"cannot read {text!r}; use NAME=VALUE")
    return name.strip(), value.strip()


def positive(text: str) -> float:
    """Read a finite number above zero."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number above zero")
    return value


def positives(text: str) -> tuple[float, ...]:
    """Read numbers above zero, separated by commas."""
    return tuple(positive(part) for part in text.split(","))


def folder(text: str) -> Path:
    """Read the name of a folder, and reject an empty name, which would mean the current folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the folder name is empty; use '.' for the current folder")
    return Path(text)


def count(text: str) -> int:
    """Read a whole number above zero."""
    if not text.isdecimal() or len(text) > _MOST_DIGITS or int(text) == 0:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a whole number above zero with at most {_MOST_DIGITS} digits"
        )
    return int(text)


def workers(text: str) -> int:
    """Read the number of threads or processes."""
    number = count(text)
    if number > MOST_WORKERS:
        raise argparse.ArgumentTypeError(f"{text} is too large; use at most {MOST_WORKERS} workers")
    return number


def counts(text: str) -> tuple[int, ...]:
    """Read whole numbers above zero, separated by commas."""
    return tuple(count(part.strip()) for part in text.split(","))


def names(text: str) -> tuple[str, ...]:
    """Read names, separated by commas."""
    found = tuple(part.strip() for part in text.split(","))
    if not all(found):
        raise argparse.ArgumentTypeError(f"{text!r} contains an empty name; use A,B")
    return found


def changed_model(args: argparse.Namespace) -> Model:
    """Return the model with the parameters and initial values of the command line."""
    model: Model = hybridsim.load(args.model)
    with blaming_the_command_line():
        if args.param:
            model = model.with_(**_expressions(args.param, "-p"))
        if args.x0:
            model = model.with_start(**_expressions(args.x0, "--x0"))
        return model.validate()


@contextmanager
def blaming_the_command_line() -> Iterator[None]:
    """Convert an error of a model into a usage error if the command line caused it."""
    try:
        yield
    except ModelError as error:
        raise UsageError(error.message, place=error.place, remedy=error.remedy) from error


def _expressions(pairs: Iterable[tuple[str, str]], option: str) -> dict[str, Expression]:
    return {name: parse(text, Place(file=f"{option} {name}", text=text)) for name, text in pairs}


def end_time(model: Model, text: str | None, default_periods: int = DEFAULT_PERIODS) -> float:
    """Return the end time of a run in the model's time unit.

    Raises `UsageError` if the text cannot be read as a time, if the time is not above zero, or if it is a number of
    periods and the model has no forcing period.
    """
    from hybridsim.engine.system.period import forcing_period

    if text is None:
        duration = model.duration_value()
        if duration is not None:
            return duration
        period = forcing_period(model)
        return default_periods * period if period is not None else _record_end(model) or DEFAULT_SECONDS
    periods = _PERIODS.fullmatch(text)
    if periods:
        period = forcing_period(model)
        if period is None:
            raise UsageError(
                f"--t-end {text}: model '{model.name}' has no forcing period",
                remedy="use a time, such as --t-end 10",
            )
        value = float(periods[1]) * period
    else:
        value = _time(model, text)
    if not (value > 0 and math.isfinite(value)):
        raise UsageError(f"--t-end {text} equals {value:g}", remedy="use a finite time above zero")
    return value


def _record_end(model: Model) -> float:
    """Return the time at which the longest table or chirp ends, or 0 if the model has neither."""
    values = model.parameter_values()
    delays = {s.name: 0.0 if s.phase is None else evaluate(s.phase, values) for s in model.inputs}
    ends = [s.times[-1] + delays[s.name] for s in model.inputs if s.kind == "table"]
    ends += [evaluate(signal.duration, values) for signal in model.inputs if signal.duration is not None]
    return max([0.0, *ends])


def _time(model: Model, text: str) -> float:
    if _WITH_UNIT.fullmatch(text):
        raise UsageError(
            f"--t-end: cannot read '{text}'",
            remedy="use a number in the time unit of the model, 20T for 20 forcing periods, or an expression",
        )
    with blaming_the_command_line():
        values = model.parameter_values()
        expression = parse(text, Place(file="--t-end", text=text))
        require_names(expression, values)
        return float(evaluate(expression, values))


def option_value(text: str) -> bool | int | float | str:
    """Read the value of an integrator option as an integer, a number, true, false or a word."""
    lowered = text.lower()
    if lowered in ("true", "false"):
        return lowered == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
