"""This module differentiates a quantity with respect to time along the flow of a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from hybridsim.errors import ModelError
from hybridsim.expr import Expression, parse, substitute

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model


def rate_along(model: Model, quantity: Expression, what: str) -> Expression:
    """Return the time derivative of a quantity along the flow, by the chain rule.

    Raises
    ------
    ModelError
        If the quantity uses an input or a variable of a component, whose rates are unknown.
    """
    from hybridsim.expr.slope import slope

    definitions = dict(model.definitions)
    inner = inlined(quantity, definitions)
    known = {state.name for state in model.states} | {p.name for p in model.parameters} | {"t"}
    if foreign := sorted(inner.names - known - {d.name for d in model.discrete}):
        raise ModelError(
            f"{what} depends on {', '.join(foreign)}, whose time derivative is unknown",
            place=quantity.place,
            remedy="use only states, parameters and t",
        )
    rate = slope(inner, "t")
    for state in model.states:
        part = slope(inner, state.name)
        if part.text != "0":
            der = inlined(state.der, definitions)
            rate = substitute(parse("rate + part*der"), {"rate": rate, "part": part, "der": der})
    return rate


def inlined(expr: Expression, definitions: Mapping[str, Expression]) -> Expression:
    """Return an expression with its definitions inserted."""
    while used := expr.names & definitions.keys():
        expr = substitute(expr, {name: definitions[name] for name in used})
    return expr
