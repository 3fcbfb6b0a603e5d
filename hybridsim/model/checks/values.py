"""This module checks values for the current parameters: finite numbers, positive periods, loads."""

from __future__ import annotations

import math

from hybridsim.errors import ModelError
from hybridsim.expr import Expression, evaluate
from hybridsim.expr.evaluate import dependency_order
from hybridsim.model.checks.impacts import check_restitution
from hybridsim.model.checks.scope import Scope
from hybridsim.model.laws.law import SPEED
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.model import Model

# Relative difference between the stick limit and the slip force at v = 0 that counts as rounding. It occurs in
# laws such as Stribeck's if both coefficients are equal; each of the few operations has an error of 1e-16.
ROUNDING = 1e-12


def errors_of_numbers(model: Model, changed: frozenset[str]) -> tuple[ModelError, ...]:
    """Return the errors of a copy of a valid model that differs in the values of some parameters."""
    checked = model.once_per_expressions("checked names", lambda: checked_names(model))
    if changed.isdisjoint(checked):
        try:
            model.parameter_values()
        except ModelError as fault:
            return (fault,)
        return ()
    scope = Scope(model)
    check_values(scope)
    return tuple(scope.errors)


def check_values(scope: Scope) -> None:
    """Report parameters without a value, and values outside their valid range."""
    model = scope.model
    try:
        values = model.parameter_values()
    except ModelError as fault:
        scope.errors.append(fault)
        return
    if model.duration is not None:
        declared = Declared(place=model.duration.place)
        _positive(scope, declared, f"model {model.name}", "duration", model.duration, values)
    for discrete in model.discrete:
        _value(scope, discrete.start, values)
    for state in model.states:
        _value(scope, state.start, values)
        _size(scope, state, f"state {state.name}: 'nominal'", state.nominal)
    for schedule in model.schedules:
        for time in (*schedule.times, *([schedule.start] if schedule.start else [])):
            _value(scope, time, values)
        _positive(scope, schedule, f"schedule {schedule.name}", "period", schedule.period, values)
    for signal in model.inputs:
        _input(scope, signal, values)
    constants = _constant_definitions(scope, values)
    for contact in model.contacts:
        _contact(scope, contact, constants)
    for requirement in model.requirements:
        if requirement.low.names | requirement.high.names <= constants.keys():
            low, high = (_value(scope, expr, constants) for expr in (requirement.low, requirement.high))
            if low is not None and high is not None and not low < high:
                scope.fail(requirement, *requirement.fault(low, high))
    for impact in model.impacts:
        check_restitution(scope, impact, constants)


def checked_names(model: Model) -> frozenset[str]:
    """Return the parameters that these checks depend on; all others may have any finite value."""
    used: set[str] = set() if model.duration is None else set(model.duration.names)
    for start in (*(d.start for d in model.discrete), *(s.start for s in model.states)):
        used |= start.names
    for schedule in model.schedules:
        for time in (*schedule.times, schedule.start, schedule.period):
            used |= time.names if time is not None else set()
    for signal in model.inputs:
        used |= set().union(*(expression.names for expression in signal.expressions.values()))
    for contact in model.contacts:
        used |= contact.normal.names
        if contact.law.is_set_valued:
            used |= set().union(
                *(contact.limit_force(b).names | contact.onset_force(b).names for b in (False, True))
            )
    for requirement in model.requirements:
        used |= requirement.low.names | requirement.high.names
    if model.impacts:
        used |= {parameter.name for parameter in model.parameters}
    made_of = {p.name: p.value.names for p in model.parameters} | {n: e.names for n, e in model.definitions}
    waiting = set(used)
    while waiting:
        waiting = set().union(*(made_of.get(name, frozenset()) for name in waiting)) - used
        used |= waiting
    return frozenset(used & {parameter.name for parameter in model.parameters})


def _value(scope: Scope, expr: Expression, values: dict[str, float]) -> float | None:
    """Return the value of an expression, or None after reporting that it has no value."""
    try:
        return evaluate(expr, values)
    except ModelError as fault:
        scope.errors.append(fault)
        return None


def _size(scope: Scope, part: Declared, what: str, size: float | None) -> None:
    """Report a nominal size that is not positive and finite."""
    if size is not None and not 0 < size < math.inf:
        scope.fail(part, f"{what} cannot be {size!r}", "use a finite number above zero")


def _positive(
    scope: Scope, part: Declared, what: str, field: str, expr: Expression | None, values: dict[str, float]
) -> None:
    value = None if expr is None else _value(scope, expr, values)
    if expr is not None and value is not None and value <= 0:
        shown = "" if expr.is_constant else f" ({expr.text})"
        scope.fail(part, f"{what}: '{field}' cannot be {value:g}{shown}", "use a value above zero")


def _input(scope: Scope, signal: Input, values: dict[str, float]) -> None:
    what = f"input {signal.name}"
    for field, expr in signal.expressions.items():
        if field in ("period", "duration"):
            _positive(scope, signal, what, field, expr, values)
            continue
        value = _value(scope, expr, values)
        if field == "duty" and value is not None and not 0 < value < 1:
            scope.fail(signal, f"{what}: 'duty' cannot be {value:g}", "use a value between 0 and 1")


def _constant_definitions(scope: Scope, values: dict[str, float]) -> dict[str, float]:
    """Return the values of the parameters and of the definitions that depend only on them."""
    found = dict(values)
    definitions = dict(scope.model.definitions)
    for name in dependency_order(definitions, "definitions"):
        if definitions[name].names <= found.keys():
            value = _value(scope, definitions[name], found)
            if value is not None:
                found[name] = value
    return found


def _contact(scope: Scope, contact: Contact, values: dict[str, float]) -> None:
    """Check constant loads and constant friction forces of a contact."""
    what = f"contact {contact.name}"
    for name, size in contact.nominal.items():
        _size(scope, contact, f"{what}: 'nominal' of {name}", size)
    if contact.normal.names <= values.keys():
        load = _value(scope, contact.normal, values)
        if load is not None and load < 0:
            shown = "" if contact.normal.is_constant else f" ({contact.normal.text})"
            scope.fail(
                contact,
                f"{what}: the normal load cannot be {load:g}{shown}",
                "use a load that is not negative",
            )
            return
    if not contact.law.is_set_valued:
        return
    for backward in (False, True):
        _onset(scope, contact, values, backward)
        _slip_at_points(scope, contact, values, backward)


def _onset(scope: Scope, contact: Contact, values: dict[str, float], backward: bool) -> None:
    """Check that the stick limit is not below the slip force at v = 0, in one direction of slip."""
    what = f"contact {contact.name}"
    if backward and contact.law.slip_backward is None and contact.law.stick_backward is None:
        return
    forces = contact.limit_force(backward), contact.onset_force(backward)
    if not all(force.names <= values.keys() for force in forces):
        return
    limit, onset = (_value(scope, force, values) for force in forces)
    if limit is None or onset is None:
        return
    for name, force in (("stick limit", limit), ("slip force at v = 0", onset)):
        if force < 0:
            scope.fail(
                contact, f"{what}: the {name} cannot be {force:g}", "a friction force must not be negative"
            )
            return
    if onset - limit > ROUNDING * onset:
        message = f"{what}: the stick limit {limit:g} is below the slip force {onset:g} at v = 0"
        scope.fail(contact, message, "static friction must be at least kinetic friction (mu_s >= mu_k)")


def _slip_at_points(scope: Scope, contact: Contact, values: dict[str, float], backward: bool) -> None:
    """Check that the slip force is not negative at the points of tables, in one direction of slip."""
    if backward and contact.law.slip_backward is None:
        return
    speeds = {speed for table in contact.law.tables if table.over.text == SPEED for speed in table.at}
    for speed in sorted(speeds):
        force = contact.slip_force_at(speed, backward)
        value = _value(scope, force, values) if force.names <= values.keys() else None
        if value is not None and value < 0:
            message = f"contact {contact.name}: the slip force at v = {speed:g} cannot be {value:g}"
            scope.fail(contact, message, "a friction force must not be negative")
            return
