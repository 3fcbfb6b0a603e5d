"""Functions that say what they take where they are called with something else."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from inspect import Signature, signature
from typing import Any, ParamSpec, TypeVar

from hybridsim.errors import UsageError, near

Given = ParamSpec("Given")
Result = TypeVar("Result")


def refusing(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """A function, or a method, that refuses arguments which it does not take as everything else is refused."""

    @wraps(function)
    def call(*args: Given.args, **keywords: Given.kwargs) -> Result:
        try:
            return function(*args, **keywords)
        except TypeError:
            refuse_unless_taken(function.__name__, signature(function), args, keywords, "self")
            raise

    return call


def refuse_unless_taken(
    title: str, takes: Signature, args: Iterable[Any], keywords: Mapping[str, Any], unsaid: str
) -> None:
    """Say what is wrong with arguments, if anything is: an unknown one before a missing one, which may be the same.

    unsaid: an argument that nobody has to know of.
    """
    try:
        takes.bind(*args, **keywords)
    except TypeError as error:
        names = [name for name in takes.parameters if name != unsaid]
        said = f"it takes {', '.join(names)}"
        for name in keywords:
            if name not in takes.parameters:
                close = near(name, names)
                remedy = f"did you mean '{close[0]}'? {said}" if close else said
                raise UsageError(f"{title} has no argument '{name}'", remedy=remedy) from None
        raise UsageError(f"{title}: {error}", remedy=said) from None
