"""This module warns about loads and friction forces with the wrong sign."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping

from hybridsim.expr import Expression, parse
from hybridsim.expr.grammar import TIME
from hybridsim.model.laws.law import LOAD_RATE, NORMAL, SPEED
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import number_of, reached_names

# test speeds relative to the nominal velocity; a warning requires a wrong sign at all of them
_SPEEDS = (1e-3, 1e-2, 0.1, 1.0, 10.0)
_FRICTION = "a friction force must not be negative: correct the sign"


def wrong_signs(model: Model) -> Iterator[tuple[Contact, str, str]]:
    """Yield each contact with a load or friction force of the wrong sign, with a message and a remedy.

    Expressions are evaluated at the start, t = 0. Those that depend on an input or a mode are not checked.
    """
    numbers = model.parameter_values() | model.start_values() | model.discrete_values() | {TIME: 0.0}
    trees = {name: expr.tree for name, expr in model.definitions}
    for contact in model.contacts:
        found = _of_contact(model, contact, numbers, trees)
        if found:
            yield contact, f"contact {contact.name}: {found[0]}", found[1]


def wrong_reactions(model: Model) -> Iterator[tuple[Contact, str, str]]:
    """Yield each contact whose force at the start drives its velocity instead of opposing it."""
    numbers = model.parameter_values() | model.start_values() | model.discrete_values() | {TIME: 0.0}
    numbers |= dict.fromkeys((contact.name for contact in model.contacts), 0.0)
    trees = {name: expr.tree for name, expr in model.definitions}

    def slope(expr: Expression, name: str) -> float:
        """Return the slope of an expression with respect to a name, or 0 if the slope is undefined."""
        ends = [number_of(expr.tree, numbers | {name: numbers[name] + d}, trees.get) for d in (0.0, 1.0)]
        return 0.0 if None in ends else ends[1] - ends[0]  # type: ignore[operator]  # neither is None

    for contact in model.contacts:
        moving = reached_names(contact.velocity.tree, trees.get)
        for state in model.states:
            if state.name not in moving or contact.name not in reached_names(state.der.tree, trees.get):
                continue  # one of the slopes is zero
            if slope(contact.velocity, state.name) * slope(state.der, contact.name) > 0.0:
                yield (
                    contact,
                    f"contact {contact.name}: its force drives '{state.name}' in the direction of slip",
                    "a friction force must oppose the relative velocity: correct its sign in the derivative, unless "
                    "inertia couples the bodies",
                )


def _of_contact(
    model: Model, contact: Contact, numbers: Mapping[str, float], trees: Mapping[str, ast.expr]
) -> tuple[str, str] | None:
    def value(expr: Expression) -> float | None:
        return number_of(expr.tree, numbers, trees.get)

    load = value(contact.normal)
    if load is not None and load < 0.0:
        if contact.opens:
            return None
        remedy = "correct the sign of the load, or let the contact lift off (opens = true)"
        return f"the normal load '{contact.normal.text}' is {load:.6g} at the start", remedy
    sizes = [
        state.nominal for state in model.states if state.name in contact.velocity.names and state.nominal
    ]
    if not contact.law.is_set_valued:
        return _force_along_velocity(contact, value, load, max(sizes, default=1.0))
    if contact.law.tables or contact.opens:
        return None  # the force depends on variables that modes set
    for backward in (False, True):
        forces = {
            "the stick limit is {:.6g} at the start": contact.limit_force(backward),
            "the slip force at v = 0 is {:.6g} at the start": contact.onset_force(backward),
        }
        if sizes:
            usual = contact.slip_force(parse(max(sizes)), backward=backward)
            forces[f"the slip force is {{:.6g}} at the nominal speed v = {max(sizes):g}"] = usual
        for template, force in forces.items():
            found = value(force)
            if found is not None and found < 0.0:
                return template.format(found), _FRICTION
    return None


def _force_along_velocity(
    contact: Contact, value: Callable[[Expression], float | None], load: float | None, size: float
) -> tuple[str, str] | None:
    """Report a single-valued force that acts along the velocity; laws with states are not checked."""
    law = contact.law
    if law.states or law.modes or law.tables or law.copies or law.force is None:
        return None
    argument_values = {
        name: value(expr) for name, expr in contact.values(varies=False).items() if name != NORMAL
    }
    known = {name: number for name, number in argument_values.items() if number is not None}
    known |= {NORMAL: 1.0 if load is None else load, LOAD_RATE: 0.0}
    trees = {name: expr.tree for name, expr in law.definitions.items()}
    for speed in (sign * share * size for share in _SPEEDS for sign in (1.0, -1.0)):
        force = number_of(law.force.tree, known | {SPEED: speed}, trees.get)
        if force is None or not force * speed < 0.0:
            return None
    return (
        f"the force of the law '{law.name}' acts in the direction of the velocity, so it drives the motion",
        "a force that opposes the motion has the sign of v; correct its sign, unless this sign is intended",
    )
