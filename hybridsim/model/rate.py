"""How fast a quantity changes along the flow of a model, as an expression."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from hybridsim.errors import ModelError
from hybridsim.expr import Expression, parse, substitute

if TYPE_CHECKING:
    from hybridsim.model.model import Model


def rate_along(model: Model, quantity: Expression, what: str) -> Expression:
    """d(quantity)/dt = partial over t + sum over states of partial over x times x', definitions put in.

    Raises
    ------
    ModelError
        Where the quantity uses an input or a variable that a component sets: these have no rate here.
    """
    from hybridsim.expr.slope import slope

    definitions = dict(model.definitions)
    inner = inlined(quantity, definitions)
    known = {state.name for state in model.states} | {p.name for p in model.parameters} | {"t"}
    if foreign := sorted(inner.names - known - {d.name for d in model.discrete}):
        raise ModelError(
            f"{what} uses {', '.join(foreign)}, whose rate is not known",
            place=quantity.place,
            remedy="write it over states, parameters and t.",
        )
    rate = slope(inner, "t")
    for state in model.states:
        part = slope(inner, state.name)
        if part.text != "0":
            der = inlined(state.der, definitions)
            rate = substitute(parse("rate + part*der"), {"rate": rate, "part": part, "der": der})
    return rate


def inlined(expr: Expression, definitions: Mapping[str, Expression]) -> Expression:
    """An expression with its definitions put in."""
    while used := expr.names & definitions.keys():
        expr = substitute(expr, {name: definitions[name] for name in used})
    return expr
