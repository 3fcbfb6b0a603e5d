"""This module checks contacts and their friction laws."""

from __future__ import annotations

import ast
from collections.abc import Collection
from dataclasses import dataclass
from difflib import get_close_matches

from hybridsim.errors import near, nearest
from hybridsim.expr import Expression
from hybridsim.model.checks.names import check_identifier
from hybridsim.model.checks.scope import Scope
from hybridsim.model.laws.law import FORCE, INDEX, LOAD_RATE, NORMAL, SPEED, FrictionLaw
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.declared import Declared

# Keys of a law in TOML, which a parameter of a law cannot be called.
_KEYS = (
    "name", "slip", "stick", "slip_backward", "stick_backward", "force", "states", "definitions", "modes", "initial",
    "copies", "tables", "parameters", "title", "source", "file",
)  # fmt: skip
_TAKEN = {
    SPEED: "the speed",
    NORMAL: "the normal load",
    LOAD_RATE: "the rate of the normal load",
    INDEX: "the index of a copy",
} | dict.fromkeys(_KEYS, "a key of the declaration")
_AT_REST = ("stick", "stick_backward")


def check_contacts(scope: Scope) -> None:
    """Report invalid friction laws, and contacts whose velocity contains no state."""
    checked: list[FrictionLaw] = []
    for contact in scope.model.contacts:
        _contact(scope, contact)
        if contact.law not in checked:
            checked.append(contact.law)
            check_law(scope, contact.law, contact.arguments)


def check_law(scope: Scope, law: FrictionLaw, passed: Collection[str] = ()) -> None:
    """Report names in a law other than `v`, `N`, `dN` and the names that the law declares.

    passed : names of the values that a contact passes.
    """
    what = f"law {law.name}"
    names = _own_names(scope, law)
    known = names | {SPEED, NORMAL, LOAD_RATE} | ({INDEX} if law.copies else set())
    parameters = frozenset(law.parameters)
    at_rest = {t.name for t in law.tables if t.is_at_rest}
    used = {name for _, expr in law.expressions() for name in expr.names}
    used |= {name for value in law.parameters.values() if value is not None for name in value.names}
    foreign = _ForeignName(known, frozenset(passed), parameters - used - {law.copies})
    count = len(scope.errors)
    for field, expr in law.expressions():
        if field.endswith(", when"):
            continue  # a condition, which is checked with the automaton of the contact
        if field in _AT_REST:
            allowed = parameters | at_rest | {NORMAL}
        elif field.startswith("slip"):
            allowed = parameters | {table.name for table in law.tables} | {SPEED, NORMAL}
        elif field.endswith((", start", ", values")):
            allowed = parameters
        elif field.startswith("table "):
            allowed = parameters | {SPEED}
        else:
            allowed = known
        _need_own(scope, expr, f"{what}, {field}", allowed, foreign)
    for name, value in law.parameters.items():
        if value is not None:
            _need_own(scope, value, f"{what}, parameter {name}", parameters, foreign)
    # a parameter that seems unused may be the misspelt name of an error above
    for name in sorted(foreign.unused if len(scope.errors) == count else ()):
        where = "neither in 'slip' nor in 'stick'" if law.is_set_valued else "nowhere in the law"
        default = law.parameters[name]
        scope.fail(
            law if default is None else Declared(place=default.place or law.place),
            f"{what}: the parameter '{name}' is used {where}",
            f"use or remove the parameter '{name}'",
        )
    _form(scope, law, what)


@dataclass(frozen=True)
class _ForeignName:
    """What the remedy for a wrong name in a law depends on.

    Parameters
    ----------
    known : names that some expression of the law can use.
    passed : names of the values that a contact passes.
    unused : parameters that no expression uses.
    """

    known: frozenset[str]
    passed: frozenset[str]
    unused: frozenset[str]

    def remedy(self, name: str, allowed: Collection[str]) -> str:
        """Return the remedy for a name that is not one of the allowed names."""
        listed = f"allowed here: {', '.join(sorted(allowed)) or 'numbers'}"
        if name in self.known:
            return listed
        if name in self.passed:
            return f"add '{name}' to the `parameters` of the law"
        if close := get_close_matches(name, sorted(self.unused & set(allowed)), n=1, cutoff=0.4):
            return f"did you mean '{close[0]}'?"
        if near(name, allowed):
            return nearest(name, allowed)
        return f"{listed}; to pass another quantity, add '{name}' to the `parameters` of the law"


def _need_own(
    scope: Scope, expr: Expression, what: str, allowed: Collection[str], foreign: _ForeignName
) -> None:
    """Report names that an expression of a law cannot use, and conditions."""
    nodes = [n for n in ast.walk(expr.tree) if isinstance(n, ast.Name) and n.id in expr.names - set(allowed)]
    if nodes:
        node = min(nodes, key=lambda node: getattr(node, "col_offset", 0))
        known = node.id in foreign.known
        reason = f"'{node.id}' cannot be used here" if known else f"unknown name '{node.id}'"
        message = f"{what}: {reason}"
        scope.errors.append(expr.error(message, node=node, remedy=foreign.remedy(node.id, allowed)))
    elif expr.is_boolean:
        remedy = "write an expression with a numeric value"
        scope.errors.append(expr.error(f"{what}: '{expr.text}' is a condition", remedy=remedy))


def _own_names(scope: Scope, law: FrictionLaw) -> frozenset[str]:
    """Return the names that a law declares, and report invalid and duplicate names."""
    seen: dict[str, str] = {}
    named = [("parameter", name) for name in law.parameters]
    named += [("definition", name) for name in law.definitions]
    named += [("table", table.name) for table in law.tables] + [("state", state.name) for state in law.states]
    for kind, name in named:
        what = f"law {law.name}"
        if not check_identifier(scope, law, f"{what}, {kind}", name):
            continue
        if name in _TAKEN:
            scope.fail(law, f"{what}: the {kind} '{name}' has the name of {_TAKEN[name]}", "rename it")
        elif name in seen:
            scope.fail(law, f"{what}: '{name}' is both a {seen[name]} and a {kind}", "rename one of them")
        seen.setdefault(name, kind)
    return frozenset(seen)


def _form(scope: Scope, law: FrictionLaw, what: str) -> None:
    """Report fields that do not fit the kind of law, and modes of a law that set more than the force."""
    if law.is_set_valued:
        for table in law.tables:
            if table.over.text == SPEED and table.at[0] < 0.0:
                scope.fail(
                    table,
                    f"{what}, table {table.name}: the point {table.at[0]:g} is negative, but v is the absolute speed",
                    "start the table at 0; for a law that depends on the direction add 'slip_backward' with a table",
                )
        for field in ("states", "definitions", "modes", "copies"):
            if getattr(law, field):
                scope.fail(
                    law,
                    f"{what}: a law with 'slip' and 'stick' cannot have '{field}'",
                    "write 'force' instead of 'slip' and 'stick'",
                )
        return
    states = [state.name for state in law.states]
    for mode in law.modes:
        resets = [name for guard in mode.guards for choice in guard.then for name in choice.reset]
        for name in (*mode.der, *resets):
            if name not in states:
                scope.unknown(law, f"{what}, mode {mode.name}: the law has no state", name, states, "states")
        if any(guard.direction for guard in mode.guards):
            message = f"{what}, mode {mode.name}: a guard of a law cannot have a direction"
            scope.fail(
                law, message, "remove `direction`; the guard fires as soon as its expression is negative"
            )
        for name in mode.set:
            if name != FORCE:
                message = f"{what}, mode {mode.name} sets '{name}'"
                scope.fail(law, message, "a mode of a law can only set the force")
    if law.copies is not None and law.copies not in law.parameters:
        scope.fail(
            law,
            f"{what}: 'copies' is '{law.copies}', which is not a parameter",
            f'write parameters = ["{law.copies}", ...]; the contact then sets the number of copies',
        )


def _contact(scope: Scope, contact: Contact) -> None:
    what = f"contact {contact.name}"
    known = scope.all_names - {contact.name}
    scope.need(contact.velocity, f"{what}, velocity", known)
    scope.need(contact.normal, f"{what}, normal", known)
    for name, value in contact.arguments.items():
        scope.need(value, f"{what}, law argument {name}", known)
    own = [state.name for state in contact.law.states]
    for field in ("start", "nominal"):
        for name in getattr(contact, field):
            if name.rstrip("0123456789") not in own and name not in own:
                scope.unknown(contact, f"{what}, {field}: the law has no state", name, own, "states")
    reached = scope.reached(contact.velocity)
    if not (reached <= scope.all_names and contact.law.is_set_valued):
        return
    forces = sorted(name for name in reached if scope.is_switched(name))
    if forces:
        message = f"{what}: the velocity depends on '{forces[0]}', which depends on a mode"
        scope.fail(contact, message, "use only states, inputs, parameters and t")
    elif not any(scope.kinds.get(name) == "state" for name in reached):
        message = f"{what}: the velocity '{contact.velocity.text}' contains no state"
        scope.fail(contact, message, "write the relative velocity, e.g. 'v - v_belt'")
