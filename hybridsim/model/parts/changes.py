"""This module computes the parts of a copy of a model that has other values or other friction laws."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from functools import partial
from numbers import Real
from os import PathLike
from typing import Any, TypeVar

from hybridsim.errors import ExpressionError, Place, UsageError, nearest
from hybridsim.expr import Expression, is_zero_dimensional, parse
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.quantities import Discrete, Parameter, State
from hybridsim.model.parts.remedies import remedy_for_value

Part = TypeVar("Part", State, Discrete)

_VALUES = (float, int, str, Expression, Real)  # types of values; the first ones are tested fastest


def changed_value(changes: Mapping[str, Any], name: str) -> Expression:
    """Return a changed value as an expression, or raise an error that names the changed quantity."""
    try:
        return parse(changes[name])
    except ExpressionError as error:
        where = error.place or Place()
        place = replace(where, file=where.file or name)
        raise ExpressionError(error.message, place=place, remedy=error.remedy) from None


def require_known(
    changes: Mapping[str, Any],
    allowed: Collection[str],
    kind: str,
    model: str,
    remedy: Callable[[str], str],
) -> None:
    """Raise an error for an invalid value, or for a changed quantity that the model does not have."""
    require_values(changes, kind)
    for name in changes:
        if name not in allowed:
            raise UsageError(f"the model '{model}' has no {kind} '{name}'", remedy=remedy(name))


def require_values(changes: Mapping[str, Any], kind: str) -> None:
    """Raise an error for a value that is neither a number nor an expression."""
    for name, value in changes.items():
        if not (isinstance(value, _VALUES) or is_zero_dimensional(value)):
            raise UsageError(f"{kind} {name} cannot be {value!r}", remedy="use a number or an expression")


def with_starts(parts: Iterable[Part], changes: Mapping[str, Any]) -> tuple[Part, ...]:
    """Return (discrete) states with the changed initial values."""
    return tuple(
        replace(part, start=changed_value(changes, part.name)) if part.name in changes else part
        for part in parts
    )


def started(
    contact: Contact, changes: Mapping[str, Any], states_of: Callable[[Contact], Iterable[State]]
) -> Contact:
    """Return the contact with new initial values for the states of its friction law."""
    own = {name for name in changes if name.startswith(contact.variable(""))}
    if not (own and contact.law.states):
        return contact
    own &= {state.name for state in states_of(contact)}
    start = {name.removeprefix(contact.variable("")): parse(changes[name]) for name in sorted(own)}
    return replace(contact, start={**contact.start, **start})


def with_law(
    model: Any,
    name: str,
    law: FrictionLaw | str | PathLike[str],
    passed: Mapping[str, Any],
    states_of: Callable[[Contact], Iterable[State]],
) -> Any:
    """Return the copy of a model in which a contact has another friction law (see `Model.with_law`)."""
    found = {contact.name: contact for contact in model.contacts}
    if name not in found:
        remedy = nearest(str(name), found, kind="contacts")
        raise UsageError(f"the model '{model.name}' has no contact {name!r}", remedy=remedy)
    changed = under_law(found[name], law, passed)
    gone = {s.name for s in states_of(found[name])} - {s.name for s in states_of(changed)}
    copy = replace(
        model,
        contacts=tuple(changed if contact.name == name else contact for contact in model.contacts),
        states=tuple(state for state in model.states if state.name not in gone),
    )
    vars(copy)["connected_units"] = model.connected_units
    return copy.validate()


def with_arguments(model: Any, changes: Mapping[str, Any]) -> tuple[Any, Mapping[str, Any]]:
    """Return a copy of a model with changed arguments of laws, by names such as "brake.mu", and the other changes."""
    parameters, rest = model._positions().keys(), dict(changes)
    if rest.keys() <= parameters:
        return model, changes
    for contact in model.contacts:
        names = {own: f"{contact.name}.{own}" for own in contact.law.parameters}
        passed = {own: rest.pop(name) for own, name in names.items() if name in rest.keys() - parameters}
        if passed:
            require_values({names[own]: value for own, value in passed.items()}, "argument")
            model = model.with_law(contact.name, contact.law, **passed)
    return model, rest


def changed_parameters(model: Any, changes: Mapping[str, Any]) -> tuple[tuple[Parameter, ...], bool]:
    """Return the parameters of a model with changed values, and whether all changes are from number to number."""
    positions = model._positions()
    require_known(changes, positions, "parameter", model.name, partial(remedy_for_value, model))
    parameters, are_numbers = list(model.parameters), True
    for name in changes:
        former, value = parameters[positions[name]], changed_value(changes, name)
        parameters[positions[name]] = former.with_value(value)
        are_numbers = are_numbers and former.value.is_constant and value.is_number
    return tuple(parameters), are_numbers


def under_law(contact: Contact, law: FrictionLaw | str | PathLike[str], passed: Mapping[str, Any]) -> Contact:
    """Return the contact with another law; parameters that are not passed keep their values."""
    fresh = Contact(contact.name, contact.velocity, contact.normal, law)  # type: ignore[arg-type]  # loads a name
    law, title = fresh.law, f"contact {contact.name}"
    for name in passed:
        if name not in law.parameters:
            remedy = nearest(name, law.parameters, kind="parameters of the law")
            raise UsageError(f"{title}: the law '{law.name}' has no parameter '{name}'", remedy=remedy)
    former = {name: value for name, value in contact.law.parameters.items() if value is not None}
    arguments = {}
    for name, default in law.parameters.items():
        if name in passed:
            arguments[name] = changed_value(passed, name)
        elif name in contact.arguments:
            arguments[name] = contact.arguments[name]
        elif default is None and name in former:
            arguments[name] = contact.values()[name]
    missing = [name for name, value in law.parameters.items() if value is None and name not in arguments]
    if missing:
        arguments_to_pass = ", ".join(f"{name}=..." for name in missing)
        raise UsageError(
            f"{title}: the law '{law.name}' needs a value for {', '.join(map(repr, missing))}",
            remedy=f"pass {arguments_to_pass}; the contact has {_listed(contact)}",
        )
    states = {state.name for state in law.states}

    def of_its_states(sizes: Mapping[str, Any]) -> dict[str, Any]:
        return {own: size for own, size in sizes.items() if {own, own.rstrip("0123456789")} & states}

    return replace(
        contact,
        law=law,
        arguments=arguments,
        start=of_its_states(contact.start),
        nominal=of_its_states(contact.nominal),
    )


def _listed(contact: Contact) -> str:
    """Return the law of a contact and the values of its parameters as text."""
    values = contact.values()
    listed = ", ".join(f"{name} = {values[name].text}" for name in contact.law.parameters)
    return f"the law '{contact.law.name}' with {listed or 'no parameters'}"
