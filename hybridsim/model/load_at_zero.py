"""A contact whose load is all but zero where its law divides by it, in words, for a run whose steps fail there."""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hybridsim.expr.grammar import TIME
from hybridsim.model.law import NORMAL
from hybridsim.model.meanings import Meanings
from hybridsim.model.one_sided import names_of, number_of

if TYPE_CHECKING:
    from hybridsim.model.contact import Contact
    from hybridsim.model.model import Model

_FADED = 1e-6  # of the load at the start: a law whose rates grow as its inverse has no steps left by then


def load_at_zero(
    model: Model,
    names: Sequence[str],
    start: tuple[float, Sequence[float]],
    now: tuple[float, Sequence[float]],
) -> str:
    """What to do about the first such contact, by times and states at the start and now; or empty.

    A load that is no expression of parameters, states and time is named where a state of its law is no number.
    """
    if model.flow is not None:
        return ""
    numbers, lookup = model.parameter_values(), Meanings(model).lookup
    for contact in filter(_divides_by_load, model.contacts):
        loads = [
            number_of(contact.normal.tree, {**numbers, TIME: t, **dict(zip(names, x))}, lookup)
            for t, x in (start, now)
        ]
        if None in loads:
            own = [k for k, name in enumerate(names) if name.startswith(contact.variable(""))]
            is_zero = not all(math.isfinite(now[1][k]) for k in own)
        else:
            before, here = map(abs, loads)  # type: ignore[arg-type]  # none is None
            is_zero = here <= _FADED * before
        if is_zero:
            return (
                f"the load of contact {contact.name}, {contact.normal.text}, comes to zero, and the law "
                f"'{contact.law.name}' divides by it: keep the load away from zero, as in max(load, least), or "
                "choose a law without states"
            )
    return ""


def _divides_by_load(contact: Contact) -> bool:
    """Whether the load stands in a denominator of a law with states, be it by its definitions."""
    law, loaded = contact.law, {NORMAL}
    for _ in law.definitions:
        loaded |= {name for name, expr in law.definitions.items() if expr.names & loaded}
    return bool(law.states) and any(
        isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div) and names_of(node.right) & loaded
        for _, expr in law.expressions()
        for node in ast.walk(expr.tree)
    )
