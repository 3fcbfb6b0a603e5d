"""This module rewrites models: it replaces contacts by forces, changes friction laws and adds parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from hybridsim.analysis.ladder.ladder_step import DoesNotApply
from hybridsim.expr import Expression, parse, substitute
from hybridsim.model import Component, Contact, FrictionLaw, Mode, Model, Parameter
from hybridsim.model.free_name import free_name, names_of_model
from hybridsim.model.laws.law import SPEED

_SPEED = parse("abs(u)")


def with_forces(model: Model, forces: Mapping[str, Expression], mode: str, title: str) -> Model:
    """Return the model with each contact replaced by a one-mode component that sets its force.

    Other automata of a contact (lift-off, tables) stay. The states of a law with memory are removed with it.
    """

    def values(contact: Contact) -> dict[str, Expression]:
        speed = contact.table_speed
        force = {contact.name: forces[contact.name]}
        return force if speed is None else {**force, speed: substitute(_SPEED, {"u": contact.velocity})}

    components = tuple(
        Component(c.name, (Mode(mode, set=values(c)),)) if part.name == c.name else part
        for c in model.contacts
        for part in model.components_of(c)
        if not _is_copy(c, part)
    )
    outputs = tuple(
        replace(output, modes={p: e for p, e in output.modes.items() if p.rpartition(".")[0] not in forces})
        for output in model.outputs
    )
    return replace(
        model,
        contacts=(),
        components=(*components, *model.components),
        outputs=outputs,
        title=f"{model.title or model.name}, {title}",
    )


def _is_copy(contact: Contact, part: Component) -> bool:
    """Return whether an automaton belongs to one copy of a law with several copies, whose forces are added."""
    number = part.name.removeprefix(f"{contact.name}_")
    return contact.law.copies is not None and number != part.name and number.isdecimal()


def with_contacts(model: Model, change: Callable[[Contact], Contact], title: str) -> Model:
    """Return the model with each contact changed; the changed model's title states the change."""
    contacts = tuple(change(contact) for contact in model.contacts)
    return replace(model, contacts=contacts, title=f"{model.title or model.name}, {title}")


def at_speed(slip: Expression, speed: str) -> Expression:
    """Return the slip force at a speed, which is a number or the name of a parameter."""
    return substitute(slip, {SPEED: parse(speed)})


def need_plain_tables(contact: Contact) -> None:
    """Reject a law with a table that depends on the speed in another way than as its only argument."""
    for table in contact.law.tables:
        if any(SPEED in names for names in table.arguments()) and (
            table.over.text != SPEED or table.across is not None
        ):
            arguments = " and ".join(e.text for e in (table.over, table.across) if e is not None)
            raise DoesNotApply(
                f"the table {table.name} of contact {contact.name} depends on {arguments}, not on the speed v alone; "
                "compare it with a constant law by compare_laws"
            )


def law_at_speed(law: FrictionLaw, speed: float) -> FrictionLaw:
    """Return a set-valued law whose tables of the speed have their values at one speed, as constants."""
    of_speed = {t.name: t.expression_at(speed, t.name) for t in law.tables if t.over.text == SPEED}
    tables = tuple(table for table in law.tables if table.name not in of_speed)
    forces: dict[str, Any] = {
        name: substitute(force, of_speed)
        for name in ("slip", "stick", "slip_backward", "stick_backward")
        if (force := getattr(law, name)) is not None
    }
    return replace(law, tables=tables, **forces)


def with_law(contact: Contact, law: FrictionLaw) -> Contact:
    """Return the contact with another law, without the parameters that the new law does not use."""
    used = {name for _, expression in law.expressions() for name in expression.names}
    while more := {n for u in used if (e := law.parameters.get(u)) is not None for n in e.names} - used:
        used |= more
    parameters = {name: value for name, value in law.parameters.items() if name in used}
    arguments = {name: value for name, value in contact.arguments.items() if name in used}
    return replace(contact, law=replace(law, parameters=parameters), arguments=arguments)


def with_parameters(model: Model, wishes: Mapping[str, float]) -> tuple[Model, dict[str, str]]:
    """Return the model with additional parameters, and the unused name chosen for each of them."""
    taken, names = names_of_model(model), {}
    for wish in wishes:
        names[wish] = free_name(taken, wish)
        taken |= {names[wish]}
    more = tuple(Parameter(names[wish], value) for wish, value in wishes.items())  # type: ignore[arg-type]  # made an expression
    return replace(model, parameters=(*model.parameters, *more)), names


def inlined(model: Model, expression: Expression) -> Expression:
    """Return an expression in which the model's definitions are replaced by their formulas."""
    definitions = dict(model.definitions)
    while used := expression.names & definitions.keys():
        expression = substitute(expression, {name: definitions[name] for name in used})
    return expression
