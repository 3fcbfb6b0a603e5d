"""This module differentiates a quantity with respect to time along the flow of a model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from hybridsim.errors import ModelError
from hybridsim.expr import Expression, parse, substitute
from hybridsim.model.parts.quantities import State


def rate_along(
    quantity: Expression,
    what: str,
    states: Sequence[State],
    definitions: Iterable[tuple[str, Expression]],
    constants: Iterable[Any],  # `Parameter` and `Discrete`
) -> Expression:
    """Return the time derivative of a quantity along the flow, by the chain rule.

    constants : quantities that are constant along the flow.

    Raises
    ------
    ModelError
        If the quantity uses an input or a variable of a component, whose rates are unknown.
    """
    from hybridsim.expr.slope import slope

    formulas = dict(definitions)
    inner = inlined(quantity, formulas)
    known = {"t", *(part.name for part in (*states, *constants))}
    if foreign := sorted(inner.names - known):
        raise ModelError(
            f"{what} depends on {', '.join(foreign)}, whose time derivative is unknown",
            place=quantity.place,
            remedy="use only states, parameters and t",
        )
    rate = slope(inner, "t")
    for state in states:
        part = slope(inner, state.name)
        if part.text != "0":
            der = inlined(state.der, formulas)
            rate = substitute(parse("rate + part*der"), {"rate": rate, "part": part, "der": der})
    return rate


def inlined(expr: Expression, definitions: Mapping[str, Expression]) -> Expression:
    """Return an expression with its definitions inserted."""
    while used := expr.names & definitions.keys():
        expr = substitute(expr, {name: definitions[name] for name in used})
    return expr
