"""This module reads the values of a sweep from the command line: NAME=FROM:TO:COUNT, NAME=A,B,C."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from hybridsim.cli import values
from hybridsim.errors import Place, UsageError
from hybridsim.expr import evaluate, parse, require_names

if TYPE_CHECKING:
    from hybridsim.model import Model


def values_by_name(model: Model, pairs: list[tuple[str, str]]) -> dict[str, list[Any]]:
    """Return the values of each parameter from arguments such as NAME=FROM:TO:COUNT or NAME=A,B,C."""
    axes: dict[str, list[Any]] = {}
    for name, text in pairs:
        if name in axes:
            raise UsageError(f"{name} is swept twice", remedy=f"put all values of {name} into one argument")
        with values.blaming_the_command_line():
            axes[name] = _row(model, name, text)
    return axes


def _row(model: Model, name: str, text: str) -> list[Any]:
    """Return the values of one parameter as a list of expressions or a range."""
    if ":" not in text:
        return [parse(part, Place(file=name, text=part)) for part in _parts(text)]
    parts = [part.strip() for part in text.split(":")]
    is_log = len(parts) == 4 and parts[3] == "log"
    if not (len(parts) == 3 or is_log) or not parts[2].isdecimal() or not parts[2].strip("0"):
        raise UsageError(
            f"Cannot read the values '{name}={text}'",
            remedy="use FROM:TO:COUNT, FROM:TO:COUNT:log, or values separated by commas",
        )
    from hybridsim.analysis.sweep.axes import MOST_POINTS

    if len(parts[2]) > len(str(MOST_POINTS)) or int(parts[2]) > MOST_POINTS:
        raise UsageError(
            f"'{name}={text}' has too many points",
            remedy=f"use at most {MOST_POINTS} points, in several sweeps if necessary",
        )
    low, high, count = number_of(model, name, parts[0]), number_of(model, name, parts[1]), int(parts[2])
    if is_log and not (low > 0 and high > 0):
        raise UsageError(
            f"'{name}={text}': a logarithmic range needs positive limits", remedy="use FROM and TO above zero"
        )
    between = [k / (count - 1) for k in range(1, count - 1)]
    if is_log:
        inner = [math.exp((1 - part) * math.log(low) + part * math.log(high)) for part in between]
    else:
        inner = [low + (high - low) * part for part in between]
    return [low, *inner, high][:count]


def _parts(text: str) -> list[str]:
    """Split a text at the commas outside parentheses."""
    parts, depth = [""], 0
    for character in text:
        depth += {"(": 1, ")": -1}.get(character, 0)
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


def number_of(model: Model, name: str, text: str) -> float:
    """Return the value of an expression in the model's parameters."""
    known = model.parameter_values()
    expression = parse(text, Place(file=name, text=text))
    require_names(expression, known)
    return float(evaluate(expression, known))
