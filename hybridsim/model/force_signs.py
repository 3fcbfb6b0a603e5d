"""Loads and friction forces whose sign is wrong where that shows: at the start, at a usual speed, or at all speeds."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from hybridsim.expr import Expression, parse
from hybridsim.expr.grammar import TIME
from hybridsim.model.contact import Contact
from hybridsim.model.law import LOAD_RATE, NORMAL, SPEED
from hybridsim.model.one_sided import number_of

if TYPE_CHECKING:
    from hybridsim.model.model import Model

# in units of a usual one: a sign that is wrong at all of these is no detail
_SPEEDS = (
    1e-3,
    1e-2,
    0.1,
    1.0,
    10.0,
)
_FRICTION = "a friction force must not be negative: correct the sign"


def wrong_signs(model: Model) -> Iterator[tuple[Contact, str, str]]:
    """Contacts, with what is wrong and what to do; what is wrong for constant values is an error already.

    Values are those of a start at t = 0; nothing is said of what depends on an input or on a mode.
    """
    numbers = model.parameter_values() | model.start_values() | model.discrete_values() | {TIME: 0.0}
    trees = {name: expr.tree for name, expr in model.definitions}
    for contact in model.contacts:
        found = _of_contact(model, contact, numbers, trees)
        if found:
            yield contact, f"contact {contact.name}: {found[0]}", found[1]


def _of_contact(
    model: Model, contact: Contact, numbers: Mapping[str, float], trees: Mapping[str, ast.expr]
) -> tuple[str, str] | None:
    def value(expr: Expression) -> float | None:
        return number_of(expr.tree, numbers, trees.get)

    load = value(contact.normal)
    if load is not None and load < 0.0:
        if contact.opens:
            return None
        remedy = "it must not be negative: correct its sign, or let the contact open (opens = true)"
        return f"the normal load '{contact.normal.text}' is {load:.6g} at the start", remedy
    sizes = [
        state.nominal for state in model.states if state.name in contact.velocity.names and state.nominal
    ]
    if not contact.law.is_set_valued:
        return _driving(contact, value, load, max(sizes, default=1.0))
    if contact.law.tables or contact.opens:
        return None  # its force is over what modes set
    for backward in (False, True):
        forces = {
            "the limit of stick is {:.6g} at the start": contact.limit_force(backward),
            "the slip force at v = 0 is {:.6g} at the start": contact.onset_force(backward),
        }
        if sizes:
            usual = contact.slip_force(parse(max(sizes)), backward=backward)
            forces[f"the slip force is {{:.6g}} at v = {max(sizes):g}, a usual speed (nominal)"] = usual
        for words, force in forces.items():
            found = value(force)
            if found is not None and found < 0.0:
                return words.format(found), _FRICTION
    return None


def _driving(
    contact: Contact, value: Callable[[Expression], float | None], load: float | None, size: float
) -> tuple[str, str] | None:
    """A single-valued force along the velocity at all speeds; a law that remembers is not looked at."""
    law = contact.law
    if law.states or law.modes or law.tables or law.copies or law.force is None:
        return None
    given = {name: value(expr) for name, expr in contact.values(varies=False).items() if name != NORMAL}
    known = {name: number for name, number in given.items() if number is not None}
    known |= {NORMAL: 1.0 if load is None else load, LOAD_RATE: 0.0}
    trees = {name: expr.tree for name, expr in law.definitions.items()}
    for speed in (sign * share * size for share in _SPEEDS for sign in (1.0, -1.0)):
        force = number_of(law.force.tree, known | {SPEED: speed}, trees.get)
        if force is None or not force * speed < 0.0:
            return None
    return (
        f"the force of the law '{law.name}' acts along the velocity at all speeds: it drives the motion",
        "a force that opposes the motion has the sign of v: correct its sign, unless it is meant to drive",
    )
