"""Values on the command line: models with changed parameters, spans in periods, options of an integrator."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from hybridsim.errors import ModelError, Place, UsageError

if TYPE_CHECKING:
    from hybridsim.expr import Expression
    from hybridsim.model import Model

DEFAULT_PERIODS = 100
COMPARED_PERIODS = 20  # a comparison runs dozens of times: a minute, not five
DEFAULT_SECONDS = 10.0  # for a model without a period of its own: a few swings of a mechanism of about 1 Hz

_MOST_DIGITS = 15  # of a count: whole numbers that doubles hold
MOST_WORKERS = 1024  # beyond the processors of a machine; each takes memory
_NUMBER = r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*"
_PERIODS, _WITH_UNIT = re.compile(_NUMBER + r"T\s*"), re.compile(_NUMBER + r"[A-Za-z]+\s*")


def assignment(text: str) -> tuple[str, str]:
    """Split NAME=VALUE."""
    name, equals, value = text.partition("=")
    if not equals or not name.strip() or not value.strip():
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form NAME=VALUE")
    return name.strip(), value.strip()


def positive(text: str) -> float:
    """A finite number above zero."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text} is not a number above zero")
    return value


def positives(text: str) -> tuple[float, ...]:
    """Numbers above zero, separated by commas."""
    return tuple(positive(part) for part in text.split(","))


def folder(text: str) -> Path:
    """The name of a folder, which "" is not: it would be the one that one is in."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty: name a folder, '.' for this one")
    return Path(text)


def count(text: str) -> int:
    """A whole number above zero."""
    if not text.isdecimal() or len(text) > _MOST_DIGITS or int(text) == 0:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a whole number above zero, of {_MOST_DIGITS} digits at most"
        )
    return int(text)


def workers(text: str) -> int:
    """A number of threads or processes."""
    number = count(text)
    if number > MOST_WORKERS:
        raise argparse.ArgumentTypeError(f"{text} workers are more than {MOST_WORKERS}")
    return number


def counts(text: str) -> tuple[int, ...]:
    """Whole numbers above zero, separated by commas."""
    return tuple(count(part.strip()) for part in text.split(","))


def names(text: str) -> tuple[str, ...]:
    """Names, separated by commas."""
    found = tuple(part.strip() for part in text.split(","))
    if not all(found):
        raise argparse.ArgumentTypeError(f"{text!r} holds an empty name")
    return found


def add_model_arguments(parser: argparse.ArgumentParser, optional: bool = False) -> None:
    """The arguments that say which model, with which parameters, from where and for how long."""
    parser.add_argument(
        "model",
        metavar="MODEL",
        nargs="?" if optional else None,
        help="name of a model (see: hybridsim models) or a .toml file",
    )
    parser.add_argument(
        "-p",
        "--param",
        metavar="NAME=VALUE",
        type=assignment,
        action="append",
        default=[],
        help="set a parameter; VALUE may be an expression of others, such as 'omega=0.6*sqrt(k/m)'",
    )
    parser.add_argument(
        "--x0",
        metavar="NAME=VALUE",
        type=assignment,
        action="append",
        default=[],
        help="set the initial value of a state",
    )


def add_span_argument(parser: argparse.ArgumentParser, periods: int = DEFAULT_PERIODS) -> None:
    """The argument that says how long to run."""
    parser.add_argument(
        "--t-end",
        metavar="TIME",
        help="end of the run: a time, an expression of the parameters, or '100T' for 100 periods of forcing "
        f"(default: the model's own duration, else {periods}T; without a period the end of the longest table or chirp, "
        f"else {DEFAULT_SECONDS:g})",
    )


def changed_model(args: argparse.Namespace) -> Model:
    """The model that `args` names, with its parameters and initial values changed."""
    import hybridsim

    model: Model = hybridsim.load(args.model)
    with blaming_the_command_line():
        if args.param:
            model = model.with_(**_expressions(args.param, "-p"))
        if args.x0:
            model = model.with_start(**_expressions(args.x0, "--x0"))
        return model.validate()


@contextmanager
def blaming_the_command_line() -> Iterator[None]:
    """Turn a bad expression into bad usage: the model was sound before the command line changed it."""
    try:
        yield
    except ModelError as error:
        raise UsageError(error.message, place=error.place, remedy=error.remedy) from error


def _expressions(pairs: Iterable[tuple[str, str]], option: str) -> dict[str, Expression]:
    from hybridsim.expr import parse

    found: dict[str, Expression] = {}
    for name, text in pairs:
        if name in found:
            raise UsageError(f"{option} {name} is given twice", remedy="give one value")
        found[name] = parse(text, Place(file=f"{option} {name}", text=text))
    return found


def end_time(model: Model, text: str | None, default_periods: int = DEFAULT_PERIODS) -> float:
    """The end of the run in the model's unit of time.

    Raises `UsageError` where the text is no time, the time is not above zero, or periods are asked for and
    the model has none.
    """
    from hybridsim.engine.period import forcing_period

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
                f"--t-end {text}: {model.name} has no single forcing period",
                remedy="give the time itself, such as --t-end 10",
            )
        value = float(periods[1]) * period
    else:
        value = _time(model, text)
    if not (value > 0 and math.isfinite(value)):
        raise UsageError(f"--t-end {text} is {value:g}", remedy="give a finite time above zero")
    return value


def _record_end(model: Model) -> float:
    """When the longest table or chirp ends; 0 where there is none after that."""
    from hybridsim.expr import evaluate

    values = model.parameter_values()
    ends = [signal.times[-1] for signal in model.inputs if signal.kind == "table"]
    ends += [evaluate(signal.duration, values) for signal in model.inputs if signal.duration is not None]
    return max([0.0, *ends])


def _time(model: Model, text: str) -> float:
    from hybridsim.expr import evaluate, parse, require_names

    if _WITH_UNIT.fullmatch(text):
        raise UsageError(
            f"--t-end {text} ends in what is no unit here",
            remedy="give a number in the model's unit of time, 20T for periods, or an expression of parameters",
        )
    with blaming_the_command_line():
        values = model.parameter_values()
        expression = parse(text, Place(file="--t-end", text=text))
        require_names(expression, values)
        return float(evaluate(expression, values))


def option_value(text: str) -> bool | int | float | str:
    """The value of an integrator's option: a whole number, a number, true, false, or a word."""
    lowered = text.lower()
    if lowered in ("true", "false"):
        return lowered == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
