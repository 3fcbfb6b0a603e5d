"""This module lists the units of the quantities and expressions of a model, for `hybridsim check --units`."""

from __future__ import annotations

from collections.abc import Iterator

from hybridsim.expr.grammar import TIME
from hybridsim.model.parts.model import Model
from hybridsim.model.units.faults import units_of_expressions
from hybridsim.model.units.parse import write_unit
from hybridsim.model.units.quantities import Quantities, quantities_of

HEADER = ("what", "unit", "how it is known")
DECLARED, INFERRED, UNKNOWN, AGREES, DISAGREES = "declared", "inferred", "unknown", "agrees", "disagrees"


def unit_rows(model: Model) -> Iterator[tuple[str, str, str]]:
    """Yield what has a unit, the unit, and how it is known: first the quantities, then the expressions.

    Expressions that are only numbers are left out.
    """
    known = quantities_of(model)
    if known is None:
        return
    yield from _quantities(model, known)
    for expression in units_of_expressions(model, known):
        what, expr = expression.statement.what, expression.statement.expr
        if expr.is_constant:
            continue
        if expression.unit is None and not expression.cautions:
            yield what, "", f"{UNKNOWN}: {'; '.join(dict.fromkeys(expression.unknown))}"
        else:
            unit = "" if expression.unit is None else write_unit(expression.unit, known.texts.values())
            yield what, unit, DISAGREES if expression.cautions else AGREES


def _quantities(model: Model, known: Quantities) -> Iterator[tuple[str, str, str]]:
    names = [
        part.name for kind in (model.parameters, model.states, model.discrete, model.inputs) for part in kind
    ]
    for name in dict.fromkeys((TIME, *names, *dict(model.definitions), *model.variables())):
        text = known.texts.get(name, "")
        if name not in known.units:
            yield name, text, f"{UNKNOWN}: this text is not a known unit" if text else UNKNOWN
        elif text and name not in known.inferred:
            yield name, text, DECLARED
        else:
            yield name, write_unit(known.units[name], known.texts.values()), INFERRED
