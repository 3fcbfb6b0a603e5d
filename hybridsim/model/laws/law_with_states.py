"""This module creates the states and automata of contacts with a single-valued friction law."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from hybridsim.expr import Expression, parse, substitute, substitute_in_reset
from hybridsim.expr.evaluate import dependency_order
from hybridsim.model.laws.law import FORCE, INDEX, LOAD_RATE, SPEED
from hybridsim.model.parts.component import Choice, Component, Guard, Mode
from hybridsim.model.parts.quantities import State

if TYPE_CHECKING:
    from hybridsim.model.parts.contact import Contact

# Each copy adds a component and states; for more copies use a MechanicalSystem.
MOST_COPIES = 64
SINGLE = "smooth"  # name of the only mode of a law without declared modes


@dataclass(frozen=True)
class ContactState(State):
    """A state that the friction law of a contact adds to the model."""


def states_of(contact: Contact, values: Mapping[str, Expression]) -> tuple[State, ...]:
    """Return the states of all copies of a contact, in the order of the copies."""
    found = []
    for index in _indices(contact, values):
        names = _names(contact, values, index)
        for state in contact.law.states:
            name = _own(contact, state.name, index)
            own = name.removeprefix(contact.variable(""))  # z, or z3 in the third copy
            nominal = contact.nominal.get(own, contact.nominal.get(state.name, state.nominal))
            own_start = contact.start.get(own, contact.start.get(state.name))
            start = substitute(state.start, names) if own_start is None else own_start
            der = substitute(state.der, names)
            found.append(ContactState(name, start, der, state.unit, nominal, place=contact.place))
    return tuple(found)


def components_of(
    contact: Contact, values: Mapping[str, Expression], loaded: tuple[Guard, ...]
) -> Iterator[Component]:
    """Yield the automata of a law: a single automaton, or one for each of several copies and one for their sum."""
    law, name, parts = contact.law, contact.name, []
    for index in _indices(contact, values):
        names = _names(contact, values, index)
        if index is None:
            yield _automaton(contact, name, names, None, loaded)
            return
        own = f"{name}_{index}"
        if law.modes:
            component = _automaton(contact, own, names, index, ())
            yield component
            parts.append(parse(own))
        else:
            parts.append(_force(contact, names))
    total = parts[0]
    for part in parts[1:]:
        total = substitute(parse("total + part"), {"total": total, "part": part})
    yield Component(name, (Mode(SINGLE, loaded, set={name: total}),), place=contact.place)


def _automaton(
    contact: Contact, name: str, names: Mapping[str, Expression], index: int | None, loaded: tuple[Guard, ...]
) -> Component:
    law, force, modes = contact.law, _force(contact, names), []
    for mode in law.modes or (Mode(SINGLE),):
        guards = tuple(
            replace(
                guard,
                expr=substitute(guard.expr, names),
                then=tuple(_choice(contact, choice, names, index) for choice in guard.then),
            )
            for guard in mode.guards
        )
        der = {_own(contact, state, index): substitute(e, names) for state, e in mode.der.items()}
        own = {name: substitute(mode.set.get(FORCE, force), names) if FORCE in mode.set else force}
        modes.append(Mode(mode.name, (*guards, *loaded), der=der, set=own, place=mode.place))
    return Component(name, tuple(modes), law.initial or modes[0].name, place=contact.place)


def _choice(contact: Contact, choice: Choice, names: Mapping[str, Expression], index: int | None) -> Choice:
    reset = {_own(contact, state, index): substitute_in_reset(e, names) for state, e in choice.reset.items()}
    when = None if choice.when is None else substitute(choice.when, names)
    return replace(choice, when=when, reset=reset)


def _force(contact: Contact, names: Mapping[str, Expression]) -> Expression:
    assert contact.law.force is not None  # the law is not set-valued
    return substitute(contact.law.force, names)


def _names(contact: Contact, values: Mapping[str, Expression], index: int | None) -> dict[str, Expression]:
    """Return the expression for each name of the law, for one copy of the contact."""
    law = contact.law
    names = {SPEED: contact.velocity, **values}
    if contact.opens and LOAD_RATE in names:
        names[LOAD_RATE] = parse(contact.variable(LOAD_RATE))
    if index is not None:
        names[INDEX] = parse(index)
    names |= {state.name: parse(_own(contact, state.name, index)) for state in law.states}
    for name in dependency_order(dict(law.definitions), f"definitions of the law '{law.name}'"):
        names[name] = substitute(law.definitions[name], names)
    return names


def _own(contact: Contact, name: str, index: int | None) -> str:
    return contact.variable(name) + ("" if index is None else str(index))


def _indices(contact: Contact, values: Mapping[str, Expression]) -> list[int | None]:
    """Return 1, 2, ... for the copies, or a single None for a law without copies."""
    law = contact.law
    if law.copies is None:
        return [None]
    copies = values.get(law.copies, parse("none"))
    try:
        count = int(copies.text)
    except ValueError:
        count = 0
    if not 0 < count <= MOST_COPIES:
        raise contact.error(
            f"contact {contact.name}: the number of copies, {law.copies}, cannot be {copies.text}",
            f"write a whole number from 1 to {MOST_COPIES}, not an expression, because each copy adds states",
        )
    return list(range(1, count + 1))
