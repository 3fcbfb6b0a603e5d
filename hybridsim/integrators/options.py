"""This module describes the options of an integrator: names, types and descriptions."""

from __future__ import annotations

import inspect
import math
import re
from dataclasses import MISSING, dataclass, fields
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

LARGEST = 10**6  # largest count, for example of iterations
# An entry of a docstring's section "Parameters": names, a colon, and text that continues in indented lines.
_ENTRY = re.compile(r"^(\w+(?:, \w+)*) : (.*(?:\n[ \t]+.*)*)", re.MULTILINE)


@dataclass(frozen=True)
class Option:
    """One option of an integrator.

    Parameters
    ----------
    kind : description of the allowed values.
    default : the default; None if the integrator computes a value, or if there is no default.
    text : description, from the docstring of the class that declares the option.
    """

    name: str
    kind: str
    default: Any
    text: str


def options_of(cls: type[Any]) -> tuple[Option, ...]:
    """Return all options of an integrator class."""
    kinds, texts = get_type_hints(cls), _texts(cls)
    return tuple(
        Option(
            f.name,
            kind_description(kinds[f.name]),
            None if f.default is MISSING else f.default,
            texts.get(f.name, ""),
        )
        for f in fields(cls)
    )


def _texts(cls: type[Any]) -> dict[str, str]:
    """Return the descriptions of parameters in the docstrings of a class and its bases."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        document = inspect.cleandoc(base.__doc__ or "") if "__doc__" in vars(base) else ""
        _, _, section = document.partition("Parameters\n----------\n")
        for names, text in _ENTRY.findall(section):
            found |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return found


def fits(value: object, kind: Any) -> bool:
    """Return whether a value matches the annotation `kind`; an integer is also a valid float."""
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    if get_origin(kind) in (Union, UnionType):
        return any(fits(value, part) for part in get_args(kind))
    if kind in (int, float):
        is_one = isinstance(value, Integral if kind is int else Real) and not isinstance(value, bool)
        return is_one and _is_small(value, LARGEST if kind is int else math.inf)
    return isinstance(value, kind) if isinstance(kind, type) else True


def _is_small(value: Any, most: float) -> bool:
    """Return whether the size of a number is at most `most`; NaN is accepted."""
    try:
        return not abs(float(value)) > most
    except OverflowError:
        return False


def kind_description(kind: Any) -> str:
    """Describe the type annotation of an option in words, such as "a whole number"."""
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(map(str, get_args(kind)))
    if get_origin(kind) in (Union, UnionType):
        return " or ".join(kind_description(part) for part in get_args(kind))
    descriptions = {
        int: "a whole number",
        float: "a number",
        bool: "true or false",
        str: "a string",
        NoneType: "None",
    }
    return descriptions.get(kind, str(kind))
