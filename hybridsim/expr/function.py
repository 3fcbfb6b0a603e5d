"""Python functions that are used as expressions."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hybridsim.errors import Place
from hybridsim.expr.parse import Expression


@dataclass(frozen=True)
class FunctionExpression(Expression):
    """A function f(t, x, p) of a model with a Python flow; two objects with the same function are equal."""

    function: Callable[..., Any]


def of_function(function: Callable[..., Any], place: Place | None = None) -> FunctionExpression:
    """Wrap a function as an expression; its text is the name of the function."""
    return FunctionExpression(function_name(function), frozenset(), place, ast.Constant(0.0), function)


def function_name(function: Callable[..., Any]) -> str:
    """Return the name of a function for messages."""
    return str(getattr(function, "__name__", None) or type(function).__name__)
