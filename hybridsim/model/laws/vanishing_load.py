"""This module explains runs that fail because a friction law divides by a load near zero."""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence

from hybridsim.expr.grammar import TIME
from hybridsim.model.laws.law import NORMAL
from hybridsim.model.meanings import Meanings
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of, number_of

_FADED = 1e-6  # fraction of the initial load below which the steps of such a law are too small to continue


def vanishing_load(
    model: Model,
    names: Sequence[str],
    start: tuple[float, Sequence[float]],
    now: tuple[float, Sequence[float]],
) -> str:
    """Return the remedy for the first contact whose load vanishes during the run, or an empty text.

    A load that depends on other names than parameters, states and time is reported if a state of its law is not finite.
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
            before, here = map(abs, loads)  # type: ignore[arg-type]  # no load is None here
            is_zero = here <= _FADED * before
        if is_zero:
            return (
                f"the load '{contact.normal.text}' of contact {contact.name} reaches zero, but the law "
                f"'{contact.law.name}' divides by it: keep the load positive, for example by max(load, minimum), or "
                "use a law without states"
            )
    return ""


def _divides_by_load(contact: Contact) -> bool:
    """Return whether a law with states divides by the load, directly or in a definition."""
    law, loaded = contact.law, {NORMAL}
    for _ in law.definitions:
        loaded |= {name for name, expr in law.definitions.items() if expr.names & loaded}
    return bool(law.states) and any(
        isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div) and names_of(node.right) & loaded
        for _, expr in law.expressions()
        for node in ast.walk(expr.tree)
    )
