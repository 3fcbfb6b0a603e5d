"""This module checks the calls of public functions: unknown, missing and renamed arguments."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from inspect import Signature, signature
from pathlib import Path
from typing import Any, ParamSpec, TypeVar
from warnings import warn

from hybridsim.errors import UsageError, near

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def refusing(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Wrap a function or method so that unknown or missing arguments raise `UsageError` with a remedy."""

    @wraps(function)
    def call(*args: Arguments.args, **keywords: Arguments.kwargs) -> Result:
        try:
            return function(*args, **keywords)
        except TypeError:
            refuse_unless_taken(function.__name__, signature(function), args, keywords, "self")
            raise

    return call


class Default(str):
    """A default value that can be distinguished from an equal text passed by the caller."""


def renamed(function: str, options: dict[str, Any], former: str, name: str, value: Any) -> Any:
    """Take the value of an argument out of `options` under its former name, and warn that the name is deprecated.

    `value` is the argument under its present name. `UsageError` is raised unless it is a `Default`.
    """
    refuse_both(function, former, options[former], name, value)
    text = f"{function}({former}=...) is deprecated; version 0.2 removes it. Use {name}=..."
    package = __name__.partition(".")[0]
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        level, frame = level + 1, frame.f_back
    warn(text, DeprecationWarning, stacklevel=level)
    return options.pop(former)


def refuse_both(function: str, former: str, old: Any, name: str, new: Any) -> None:
    """Raise `UsageError` if a call has an argument under its former and under its present name."""
    if not isinstance(new, Default):
        raise UsageError(
            f"{function}() has both {former}={old!r} and {name}={new!r}, but {former} is the former name of {name}",
            remedy=f"remove `{former}`",
        )


def name_of(function: Callable[..., Any]) -> str:
    """Return the name of a function for messages and tables; an unnamed one is named by its line."""
    name = str(getattr(function, "__name__", "function"))
    if name != "<lambda>":
        return name
    code = function.__code__
    return f"lambda (line {code.co_firstlineno} of {Path(code.co_filename).name})"


def refuse_unless_taken(
    title: str, takes: Signature, args: Iterable[Any], keywords: Mapping[str, Any], unsaid: str
) -> None:
    """Raise `UsageError` if the arguments do not fit the signature; unknown names are reported first.

    `unsaid` is an argument to omit from the list, such as self.
    """
    try:
        takes.bind(*args, **keywords)
    except TypeError as error:
        names = [name for name in takes.parameters if name != unsaid]
        takes_text = f"arguments: {', '.join(names)}"
        for name in keywords:
            if name not in takes.parameters:
                close = near(name, names)
                remedy = f"did you mean '{close[0]}'? {takes_text}" if close else takes_text
                raise UsageError(f"{title}() has no argument '{name}'", remedy=remedy) from None
        raise UsageError(f"{title}(): {error}", remedy=takes_text) from None
