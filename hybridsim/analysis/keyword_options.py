"""This module checks the keyword arguments of an analysis before its first run."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

from hybridsim.arguments import integrator_name
from hybridsim.calls import name_of, refuse_both
from hybridsim.errors import UsageError, nearest
from hybridsim.integrators.registry import integrator_class, option_names

# the choices of "auto"; an option of any of them is accepted
_OF_AUTO = ("exact", "dop853", "taylor", "rodas5p", "cvode-bdf", "scipy-dop853", "scipy-radau")


def refuse_unknown(calls: Iterable[Callable[..., Any]], options: Mapping[str, Any]) -> None:
    """Reject options that neither the given functions nor the integrator accept.

    Raises
    ------
    UsageError
        For a name that no function and no integrator accepts, or an unknown integrator.
    """
    own = {name for call in calls for name in _names_of_ours(call)}
    if "keep" in own:
        own.add("save")  # the deprecated name of an argument of simulate
        if "keep" in options and "save" in options:
            refuse_both("simulate", "save", options["save"], "keep", options["keep"])
    name = integrator_name(options.get("integrator", "auto"))
    classes = [integrator_class(one) for one in (_OF_AUTO if name == "auto" else (name,))]
    known = own | {option for one in classes for option in option_names(one)}
    called = (
        "simulate or of the integrators that 'auto' selects from"
        if name == "auto"
        else f"simulate or of {name}"
    )
    _refuse(options, known, called)


def refuse_what_it_does_not_take(function: Callable[..., Any], options: Mapping[str, Any]) -> None:
    """Reject options that do not fit the signature of a user's measure."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # a builtin has no signature
        return
    if not any(p.kind is p.VAR_KEYWORD for p in parameters):
        _refuse(options, set(_names(function)), name_of(function))


def _names(call: Callable[..., Any]) -> list[str]:
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return [name for name, p in inspect.signature(call).parameters.items() if p.kind in kinds]


_names_of_ours = cache(
    _names
)  # a signature takes longer to read than a short run; users' functions are not kept


def _refuse(options: Mapping[str, Any], known: set[str], called: str) -> None:
    for option in options:
        if option not in known:
            raise UsageError(
                f"{option!r} is not an option of {called}", remedy=nearest(option, known, kind="options")
            )
