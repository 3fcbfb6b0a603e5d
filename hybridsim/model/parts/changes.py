"""This module checks the changes of values in a copy of a model."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from numbers import Real
from typing import Any

from hybridsim.errors import ExpressionError, Place, UsageError
from hybridsim.expr import Expression, parse


def changed_value(changes: Mapping[str, Any], name: str) -> Expression:
    """Return a changed value as an expression, or raise an error that names the changed quantity."""
    try:
        return parse(changes[name])
    except ExpressionError as error:
        where = error.place or Place()
        place = replace(where, file=where.file or name)
        raise ExpressionError(error.message, place=place, remedy=error.remedy) from None


def require_known(
    changes: Mapping[str, Any],
    allowed: Collection[str],
    kind: str,
    model: str,
    remedy: Callable[[str], str],
) -> None:
    """Raise an error for a changed quantity that the model does not have, or for an invalid value."""
    for name, value in changes.items():
        if not isinstance(value, Expression | str | Real):
            raise UsageError(f"{kind} {name} cannot be {value!r}", remedy="use a number or an expression")
        if name not in allowed:
            raise UsageError(f"the model '{model}' has no {kind} '{name}'", remedy=remedy(name))
