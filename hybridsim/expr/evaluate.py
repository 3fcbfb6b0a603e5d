"""Values of expressions in double precision, and of parameters that are expressions of one another."""

from __future__ import annotations

from collections.abc import Mapping

from hybridsim.errors import ExpressionError
from hybridsim.expr.grammar import TIME
from hybridsim.expr.parse import Expression, require_names
from hybridsim.expr.walk import NoValue, value_of


def evaluate(expr: Expression, values: Mapping[str, float]) -> float:
    """Value of an expression; a condition gives 1.0 or 0.0.

    Raises
    ------
    ExpressionError
        Naming the expression and the values it was given: an unknown name, division by zero, a
        function outside its domain, overflow.
    """
    require_names(expr, values)
    try:
        return float(value_of(expr.tree, values))
    except NoValue as fault:
        given = ", ".join(f"{name} = {values[name]:g}" for name in sorted(expr.names))
        raise expr.error(
            f"'{expr.text}' has no finite real value: {fault.reason}",
            node=fault.node,
            remedy=f"it was evaluated with {given}." if given else "correct the numbers.",
        ) from None


def resolve(expressions: Mapping[str, Expression]) -> dict[str, float]:
    """Values of expressions that may refer to one another, in the order given.

    Raises
    ------
    ExpressionError
        Naming the circle (``a -> b -> a``), an unknown name, or a value that is not finite.
    """
    order = dependency_order(expressions, "parameters")
    values: dict[str, float] = {}
    for name in order:
        if TIME in expressions[name].names:
            raise expressions[name].error(
                f"'{name}' depends on time",
                remedy="a parameter is constant; a function of t is a definition or an input.",
            )
        require_names(expressions[name], expressions)
        values[name] = evaluate(expressions[name], values)
    return {name: values[name] for name in expressions}


def dependency_order(expressions: Mapping[str, Expression], kind: str) -> list[str]:
    """The names in an order where each depends on earlier ones only; names that are no keys are known.

    Raises
    ------
    ExpressionError
        Naming the circle.
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
                circle = " -> ".join([*path[path.index(name) :], name])
                raise ExpressionError(
                    f"a circle among {kind}: {circle}",
                    place=expressions[path[-1]].error("").place,
                    remedy="give one of them a value of its own.",
                )
            path.append(name)
            stack.append((name, True))
            stack.extend((other, False) for other in sorted(expressions[name].names) if other in expressions)
    return order
