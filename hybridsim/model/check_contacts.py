"""Checks of contacts and of the laws they use."""

from __future__ import annotations

from hybridsim.model.check_names import check_identifier
from hybridsim.model.contact import Contact
from hybridsim.model.law import NORMAL, SPEED, FrictionLaw
from hybridsim.model.scope import Scope

# Keys of a law in TOML, which parameters of a law cannot be told from.
_KEYS = ("name", "slip", "stick", "parameters", "title", "source")


def check_contacts(scope: Scope) -> None:
    """Report laws that use what they do not have, and contacts that cannot hold anything."""
    checked: list[FrictionLaw] = []
    for contact in scope.model.contacts:
        _contact(scope, contact)
        if contact.law not in checked:
            checked.append(contact.law)
            check_law(scope, contact.law)


def check_law(scope: Scope, law: FrictionLaw) -> None:
    """Report a law that uses other names than v, N and its own parameters."""
    what = f"law {law.name}"
    for name in law.parameters:
        if check_identifier(scope, law, f"{what}, parameter", name) and name in (SPEED, NORMAL, *_KEYS):
            taken = (
                "the speed"
                if name == SPEED
                else "the normal load"
                if name == NORMAL
                else "a key of the declaration"
            )
            scope.fail(law, f"{what}: the parameter '{name}' is already {taken}", "rename it.")
    own = frozenset(law.parameters)
    defaults = {name: value for name, value in law.parameters.items() if value is not None}
    _law_names(scope, law, "slip", own | {SPEED, NORMAL})
    _law_names(scope, law, "stick", own | {NORMAL})
    for name, value in defaults.items():
        scope.need_own(value, f"{what}, parameter {name}", own)
    used = law.slip.names | law.stick.names | {name for value in defaults.values() for name in value.names}
    for name in sorted(own - used):
        scope.fail(
            law,
            f"{what}: the parameter '{name}' is used in neither slip nor stick",
            "use it or leave it out.",
        )


def _law_names(scope: Scope, law: FrictionLaw, field: str, known: frozenset[str]) -> None:
    scope.need_own(getattr(law, field), f"law {law.name}, {field}", known)


def _contact(scope: Scope, contact: Contact) -> None:
    what = f"contact {contact.name}"
    known = scope.all_names - {contact.name}
    scope.need(contact.velocity, f"{what}, velocity", known)
    scope.need(contact.normal, f"{what}, normal", known)
    for name, value in contact.arguments.items():
        scope.need(value, f"{what}, law argument {name}", known)
    reached = scope.reached(contact.velocity)
    if not reached <= scope.all_names:
        return
    forces = sorted(
        name
        for name in reached
        if "variable" in scope.kinds.get(name, "") or scope.kinds.get(name) == "contact force"
    )
    if forces:
        message = f"{what}: the velocity depends on '{forces[0]}', which depends on a mode"
        scope.fail(contact, message, "write it over states, inputs, parameters and t.")
    elif not any(scope.kinds.get(name) == "state" for name in reached):
        message = f"{what}: the velocity '{contact.velocity.text}' contains no state to hold"
        scope.fail(contact, message, "write the relative velocity, e.g. 'v - v_belt'.")
