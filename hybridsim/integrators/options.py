"""The options of an integrator: the fields of its dataclass, their kinds in words, what its docstring says of them."""

from __future__ import annotations

import inspect
import math
import re
from dataclasses import MISSING, dataclass, fields
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

LARGEST = 10**6  # of a count, such as of iterations
# A line of a docstring's section "Parameters": one or several names, a colon, text that goes on in indented lines.
_ENTRY = re.compile(r"^(\w+(?:, \w+)*) : (.*(?:\n[ \t]+.*)*)", re.MULTILINE)


@dataclass(frozen=True)
class Option:
    """One option of an integrator.

    Parameters
    ----------
    kind : what may be given, in words.
    default : its default; None where the integrator finds a value itself, or where there is none.
    text : what it does, from the docstring of the class that has it.
    """

    name: str
    kind: str
    default: Any
    text: str


def options_of(cls: type[Any]) -> tuple[Option, ...]:
    """All options of an integrator class."""
    kinds, texts = get_type_hints(cls), _texts(cls)
    return tuple(
        Option(
            f.name,
            in_words(kinds[f.name]),
            None if f.default is MISSING else f.default,
            texts.get(f.name, ""),
        )
        for f in fields(cls)
    )


def _texts(cls: type[Any]) -> dict[str, str]:
    """What the docstrings of a class and its bases say of parameters, the nearest one first."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        document = inspect.cleandoc(base.__doc__ or "") if "__doc__" in vars(base) else ""
        _, _, section = document.partition("Parameters\n----------\n")
        for names, text in _ENTRY.findall(section):
            found |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return found


def fits(value: object, kind: Any) -> bool:
    """Whether a value may stand where the annotation of an option says `kind`; a whole number is a number too."""
    if get_origin(kind) is Literal:
        return value in get_args(kind)
    if get_origin(kind) in (Union, UnionType):
        return any(fits(value, part) for part in get_args(kind))
    if kind in (int, float):
        is_one = isinstance(value, Integral if kind is int else Real) and not isinstance(value, bool)
        return is_one and _is_small(value, LARGEST if kind is int else math.inf)
    return isinstance(value, kind) if isinstance(kind, type) else True


def _is_small(value: Any, most: float) -> bool:
    """Whether a number is one of the doubles, and no larger than `most`; what is not a number is left to others."""
    try:
        return not abs(float(value)) > most
    except OverflowError:
        return False


def in_words(kind: Any) -> str:
    """An annotation for people."""
    if get_origin(kind) is Literal:
        return "one of " + ", ".join(map(str, get_args(kind)))
    if get_origin(kind) in (Union, UnionType):
        return " or ".join(in_words(part) for part in get_args(kind))
    words = {
        int: "a whole number",
        float: "a number",
        bool: "true or false",
        str: "a string",
        NoneType: "None",
    }
    return words.get(kind, str(kind))
