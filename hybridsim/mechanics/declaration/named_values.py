"""This module gives names to the numbers of a mechanical system, so that they can be set and swept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from hybridsim.errors import UsageError, nearest
from hybridsim.expr import parse
from hybridsim.mechanics.declaration.system import Harmonic, MechanicalContact, MechanicalSystem

OMEGA = "omega"
_NORMAL, _BASE = "normal", "base"


def values_of(system: MechanicalSystem) -> dict[str, float]:
    """Return the named values of a system.

    ``omega`` is the lowest angular frequency of the forces and bases. ``CONTACT.normal``, ``CONTACT.base``
    and ``CONTACT.PARAMETER`` are the load of a contact, a constant speed of its base, and the parameters of
    its law. A name without a contact, such as ``normal``, belongs to all contacts that have the same value.
    """
    rates = [abs(rate) for rate in _rates(system) if rate != 0.0]
    found = {OMEGA: min(rates)} if rates else {}
    of_contacts = {c.name: _of_contact(c) for c in system.contacts}
    shared: dict[str, set[float]] = {}
    for values in of_contacts.values():
        for name, value in values.items():
            shared.setdefault(name, set()).add(value)
    found |= {name: min(values) for name, values in shared.items() if len(values) == 1}
    return found | {f"{c}.{name}": v for c, values in of_contacts.items() for name, v in values.items()}


def with_values(system: MechanicalSystem, values: Mapping[str, float]) -> MechanicalSystem:
    """Return a copy of a system with some named values changed; other frequencies keep their ratio to ``omega``.

    Raises
    ------
    UsageError
        For a name that the system does not have, or that stands for different values of its contacts.
    """
    of_contacts = {c.name: _of_contact(c) for c in system.contacts}
    known = list(values_of(system))
    for name in values:
        if owners := [f"{c}.{name}" for c, own in of_contacts.items() if name not in known and name in own]:
            raise UsageError(
                f"{system.name}: its contacts have different values of {name!r}, so this name stands for none of them",
                remedy=f"set each contact: {', '.join(owners[:4])}{', ...' if len(owners) > 4 else ''}",
            )
        if name not in known:
            raise UsageError(
                f"{system.name} has no parameter {name!r} to set",
                remedy=nearest(str(name), known, kind="parameters"),
            )
    contacts = []
    for contact in system.contacts:
        shared = {name: v for name, v in values.items() if name in of_contacts[contact.name]}
        own = {name: values[f"{contact.name}.{name}"] for name in of_contacts[contact.name]
               if f"{contact.name}.{name}" in values}  # fmt: skip
        contacts.append(_changed(contact, {**shared, **own}))
    changed = system.with_(contacts=contacts)
    if OMEGA in values:
        return _at_frequency(changed, values[OMEGA] / values_of(system)[OMEGA])
    return changed


def _of_contact(contact: MechanicalContact) -> dict[str, float]:
    base = {} if isinstance(contact.base, Harmonic) else {_BASE: contact.base}
    return {_NORMAL: contact.normal, **base, **contact.values()}


def _changed(contact: MechanicalContact, values: dict[str, float]) -> MechanicalContact:
    if not values:
        return contact
    fields: dict[str, Any] = {name: values.pop(name) for name in (_NORMAL, _BASE) if name in values}
    arguments = {**contact.arguments, **{name: parse(value) for name, value in values.items()}}
    direction = dict(contact.direction)
    return replace(contact, direction=direction, arguments=arguments, **fields)


def _rates(system: MechanicalSystem) -> list[float]:
    forces = [t.omega for terms in system.forcing.values() for t in terms if isinstance(t, Harmonic)]
    return forces + [c.base.omega for c in system.contacts if isinstance(c.base, Harmonic)]


def _at_frequency(system: MechanicalSystem, factor: float) -> MechanicalSystem:
    def scaled(term: Any) -> Any:
        return replace(term, omega=factor * term.omega) if isinstance(term, Harmonic) else term

    contacts = [
        replace(contact, direction=dict(contact.direction), base=scaled(contact.base))
        for contact in system.contacts
    ]
    forcing = {i: tuple(scaled(term) for term in terms) for i, terms in system.forcing.items()}
    return system.with_(forcing=forcing, contacts=contacts)
