"""Evaluate expressions, and parameters that depend on each other, in double precision."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence

from hybridsim.errors import ExpressionError, Place
from hybridsim.expr.grammar import TIME
from hybridsim.expr.parse import Expression, require_names
from hybridsim.expr.walk import NoValue, value_of


class CyclicDependency(ExpressionError):
    """Raised for expressions that depend on each other in a circle; ``circle`` lists their names."""

    def __init__(
        self, message: str, circle: Sequence[str], *, place: Place | None = None, remedy: str | None = None
    ) -> None:
        super().__init__(message, place=place, remedy=remedy)
        self.circle = tuple(circle)


def evaluate(expr: Expression, values: Mapping[str, float]) -> float:
    """Return the value of an expression; a condition has the value 1.0 or 0.0.

    Raises
    ------
    ExpressionError
        For an unknown name, a division by zero, a function outside its domain, or an overflow, with the expression and
        the values of its names.
    """
    if isinstance(expr.tree, ast.Constant):  # most values of parameters
        return float(expr.tree.value)  # type: ignore[arg-type]  # a number or a truth value
    require_names(expr, values)
    try:
        return float(value_of(expr.tree, values))
    except NoValue as fault:
        values_shown = ", ".join(f"{name} = {values[name]:g}" for name in sorted(expr.names))
        raise expr.error(
            f"'{expr.text}' has no finite real value: {fault.reason}",
            node=fault.node,
            remedy=f"the expression was evaluated with {values_shown}"
            if values_shown
            else "correct the numbers",
        ) from None


def resolve(expressions: Mapping[str, Expression]) -> dict[str, float]:
    """Return the values of expressions that may refer to each other, in the given order.

    Raises
    ------
    ExpressionError
        For a cyclic definition (``a -> b -> a``), an unknown name, or a value that is not finite.
    """
    order = dependency_order(expressions, "parameters")
    values: dict[str, float] = {}
    for name in order:
        if TIME in expressions[name].names:
            raise expressions[name].error(
                f"parameter '{name}' depends on time",
                remedy="declare a function of t as a definition or an input",
            )
        require_names(expressions[name], expressions)
        values[name] = evaluate(expressions[name], values)
    return {name: values[name] for name in expressions}


def dependency_order(expressions: Mapping[str, Expression], kind: str) -> list[str]:
    """Return the names in an order in which each name depends only on earlier names.

    Raises
    ------
    CyclicDependency
        For a cyclic definition.
    """
    order: list[str] = []
    done: set[str] = set()
    for root in expressions:
        path: list[str] = []
        stack = [(root, False)]
        while stack:
            name, finished = stack.pop()
            if finished:
                path.pop()
                done.add(name)
                order.append(name)
                continue
            if name in done:
                continue
            if name in path:
                circle = (*path[path.index(name) :], name)
                raise CyclicDependency(
                    f"cyclic dependency among {kind}: {' -> '.join(circle)}",
                    circle,
                    place=expressions[path[-1]].error("").place,
                    remedy=f"set one of these {kind} to an independent value",
                )
            path.append(name)
            stack.append((name, True))
            stack.extend((other, False) for other in sorted(expressions[name].names) if other in expressions)
    return order
