"""This module computes derivatives of parameters and initial values with respect to chosen parameters."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from hybridsim.analysis.variations.values.no_derivative import is_at_edge
from hybridsim.engine.system.slopes_at_edge import DISTANCES, agreed, limit_of
from hybridsim.errors import ExpressionError, UsageError
from hybridsim.expr import Expression, evaluate
from hybridsim.expr.slope import slope
from hybridsim.model import Model


def value_slopes(model: Model, chosen: Sequence[str]) -> np.ndarray:
    """Return the derivatives (P, C) of all parameters with respect to the C chosen parameters."""
    names = [p.name for p in model.parameters]
    slopes = {name: np.zeros(len(chosen)) for name in names}
    values = model.parameter_values()
    declared = {p.name: p.value for p in model.parameters}
    done: set[str] = set()

    def visit(name: str) -> None:
        if name in done:
            return
        done.add(name)
        for other in sorted(declared[name].names):
            visit(other)
        slopes[name] = expression_slope(declared[name], values, slopes, len(chosen))
        if name in chosen:
            slopes[name] = slopes[name] + np.eye(len(chosen))[list(chosen).index(name)]

    for name in names:
        visit(name)
    return np.array([slopes[name] for name in names]).reshape(len(names), len(chosen))


def start_slopes(expressions: Sequence[Expression], model: Model, by_parameter: np.ndarray) -> np.ndarray:
    """Return the derivatives of initial values with respect to the chosen parameters, one row per expression."""
    slopes = {p.name: row for p, row in zip(model.parameters, by_parameter, strict=True)}
    values = model.parameter_values()
    rows = [expression_slope(e, values, slopes, by_parameter.shape[1]) for e in expressions]
    return np.array(rows).reshape(len(rows), by_parameter.shape[1])


def expression_slope(
    expression: Expression, values: Mapping[str, float], slopes: Mapping[str, np.ndarray], width: int
) -> np.ndarray:
    """Return derivatives (width,) of an expression with respect to the chosen parameters, by the chain rule."""
    total = np.zeros(width)
    for name in sorted(expression.names):
        if slopes[name].any():
            total = total + _derivative(expression, name, values) * slopes[name]
    return total


def _derivative(expression: Expression, name: str, values: Mapping[str, float]) -> float:
    """Return the derivative of an expression with respect to a name; at a kink, return the limits from both sides."""
    found = _slope(expression, name)
    if not any(is_at_edge(node, values) for node in ast.walk(expression.tree) if isinstance(node, ast.expr)):
        return evaluate(found, values)
    size = abs(values[name]) or 1.0

    def near(distance: float) -> np.ndarray:
        try:
            return np.array([[evaluate(found, {**values, name: values[name] + distance * size})]])
        except ExpressionError:  # it has no value on this side
            return np.array([[np.nan]])

    sides = [limit_of([near(sign * distance) for distance in DISTANCES]) for sign in (1.0, -1.0)]
    value = float(agreed(sides)[0, 0])
    if np.isnan(value):
        raise UsageError(
            f"{expression.text} has no derivative with respect to {name} at {name} = {values[name]:.6g}",
            remedy=f"leave out the derivatives with respect to {name}, or use another value of {name}",
        )
    return value


@lru_cache(maxsize=4096)
def _slope(expression: Expression, name: str) -> Expression:
    return slope(expression, name)
