"""A Python function where an expression may stand: carried along, never looked into."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hybridsim.errors import Place
from hybridsim.expr.parse import Expression


@dataclass(frozen=True)
class FunctionExpression(Expression):
    """A function f(t, x, p) of a model whose rates are a Python function; two are equal when the functions are."""

    function: Callable[..., Any]


def of_function(function: Callable[..., Any], place: Place | None = None) -> FunctionExpression:
    """Wrap a function; its name is its text."""
    return FunctionExpression(function_name(function), frozenset(), place, ast.Constant(0.0), function)


def function_name(function: Callable[..., Any]) -> str:
    """What a function is called in messages."""
    return str(getattr(function, "__name__", None) or type(function).__name__)
