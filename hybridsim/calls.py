"""Functions that say what they take where they are called with something else."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import wraps
from inspect import signature
from typing import ParamSpec, TypeVar

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
            takes = signature(function)
            try:
                takes.bind(*args, **keywords)
            except TypeError as error:
                names = [name for name in takes.parameters if name != "self"]
                raise refusal(function.__name__, names, keywords, error) from None
            raise

    return call


def refusal(title: str, names: list[str], keywords: Iterable[str], error: TypeError) -> UsageError:
    """What is wrong with the arguments: an unknown one before a missing one, which may be the same."""
    takes = f"it takes {', '.join(names)}"
    for name in keywords:
        if name not in names:
            close = near(name, names)
            remedy = f"did you mean '{close[0]}'? {takes}" if close else takes
            return UsageError(f"{title} has no argument '{name}'", remedy=remedy)
    return UsageError(f"{title}: {error}", remedy=takes)
