"""This module checks values for the current parameters: finite numbers, positive periods, loads."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import product
from typing import Any, NamedTuple

from hybridsim.errors import ModelError
from hybridsim.expr import Expression, evaluate
from hybridsim.expr.evaluate import dependency_order
from hybridsim.model.checks.impacts import check_restitution
from hybridsim.model.checks.scope import Findings
from hybridsim.model.checks.whole_numbers import divisors
from hybridsim.model.elements.requirement import Requirement
from hybridsim.model.laws.law import SPEED
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.quantities import Discrete, State
from hybridsim.model.parts.schedule import Schedule

# Relative difference between the stick limit and the slip force at v = 0 that counts as rounding. It occurs in
# laws such as Stribeck's if both coefficients are equal; each of the few operations has an error of 1e-16.
ROUNDING = 1e-12


class _Check(NamedTuple):
    """The check of one value: a function, its part of the model, and the names that the value depends on."""

    function: Callable[[Findings, Any, dict[str, float]], None]
    part: Any
    names: frozenset[str]
    defines: str | None = None  # the definition whose value is checked


def errors_of_numbers(model: Model, changed: frozenset[str]) -> tuple[ModelError, ...]:
    """Return the errors of a copy of a valid model, in which some parameters have other values."""
    findings = Findings(model)
    _carry_out(findings, model.once_per_expressions(("checks", changed), lambda: _affected(model, changed)))
    return tuple(findings.errors)


def _affected(model: Model, changed: frozenset[str]) -> list[_Check]:
    """Return the checks that depend on some parameters, and the definitions that these checks use."""
    checks = _checks_of(model)
    used = frozenset[str]().union(*(check.names for check in checks if not changed.isdisjoint(check.names)))
    return [check for check in checks if not changed.isdisjoint(check.names) or check.defines in used]


def check_values(findings: Findings) -> None:
    """Report parameters without a value, and values outside their valid range."""
    _carry_out(findings, None)


def _carry_out(findings: Findings, checks: Iterable[_Check] | None) -> None:
    """Carry out the given checks, or all checks of the model."""
    try:
        values = findings.model.parameter_values()
    except ModelError as fault:
        findings.errors.append(fault)
        return
    for check in _checks_of(findings.model) if checks is None else checks:
        check.function(findings, check.part, values)


def checked_names(model: Model) -> frozenset[str]:
    """Return the parameters that these checks depend on; all other parameters may have any finite value."""
    used = frozenset[str]().union(*(check.names for check in _checks_of(model) if check.defines is None))
    return used & {parameter.name for parameter in model.parameters}


def _checks_of(model: Model) -> list[_Check]:
    """Return all checks in order; copies of the model with other numbers share the checks."""
    found: list[_Check] = model.once_per_expressions("checks of values", lambda: list(_all_checks(model)))
    return found


def _all_checks(model: Model) -> Iterator[_Check]:
    made_of = {p.name: p.value.names for p in model.parameters} | {n: e.names for n, e in model.definitions}

    def check(function: Callable[..., None], part: Any, *expressions: Expression | None) -> _Check:
        waiting = frozenset[str]().union(*(e.names for e in expressions if e is not None))
        reached = set(waiting)
        while waiting:
            waiting = frozenset[str]().union(*(made_of.get(name, ()) for name in waiting)) - reached
            reached |= waiting
        return _Check(function, part, frozenset(reached))

    if model.duration is not None:
        yield check(_duration, model.duration, model.duration)
    starts: tuple[State | Discrete, ...] = (*model.discrete, *model.states)
    for part in starts:
        yield check(_start, part, part.start)
    for schedule in model.schedules:
        yield check(_schedule, schedule, *schedule.times, schedule.start, schedule.period)
    for signal in model.inputs:
        yield check(_input, signal, *signal.expressions.values())
    definitions = dict(model.definitions)
    for name in dependency_order(definitions, "definitions"):
        yield check(_definition, (name, definitions[name]), definitions[name])._replace(defines=name)
    for contact in model.contacts:
        yield check(_contact, contact, contact.normal, *_forces_at_points(contact))
    for requirement in model.requirements:
        yield check(_requirement, requirement, requirement.low, requirement.high)
    for divisor in divisors(model):
        yield check(_divisor, divisor, divisor)
    for impact in model.impacts:
        yield check(check_restitution, impact, impact.restitution)


def _forces_at_points(contact: Contact) -> Iterator[Expression]:
    """Yield the stick limit and the slip force at rest and at the points of tables, in both directions."""
    for backward in (False, True) if contact.law.is_set_valued else ():
        yield from (contact.limit_force(backward), contact.onset_force(backward))
        yield from (contact.slip_force_at(speed, backward) for speed in _speeds_of_tables(contact))


def _duration(findings: Findings, duration: Expression, values: dict[str, float]) -> None:
    what = f"model {findings.model.name}"
    _positive(findings, Declared(place=duration.place), what, "duration", duration, values)


def _start(findings: Findings, part: State | Discrete, values: dict[str, float]) -> None:
    _value(findings, part.start, values)
    if isinstance(part, State):
        _size(findings, part, f"state {part.name}: 'nominal'", part.nominal)


def _schedule(findings: Findings, schedule: Schedule, values: dict[str, float]) -> None:
    for time in (*schedule.times, *([schedule.start] if schedule.start else [])):
        _value(findings, time, values)
    _positive(findings, schedule, f"schedule {schedule.name}", "period", schedule.period, values)


def _definition(findings: Findings, part: tuple[str, Expression], values: dict[str, float]) -> None:
    """Store the value of a definition in `values` if the definition depends on parameters only."""
    name, expr = part
    value = _value(findings, expr, values) if expr.names <= values.keys() else None
    if value is not None:
        values[name] = value


def _requirement(findings: Findings, requirement: Requirement, values: dict[str, float]) -> None:
    if requirement.low.names | requirement.high.names <= values.keys():
        low, high = (_value(findings, expr, values) for expr in (requirement.low, requirement.high))
        if low is not None and high is not None and not requirement.is_met(low, high):
            findings.fail(requirement, *requirement.fault(low, high))


def _divisor(findings: Findings, divisor: Expression, values: dict[str, float]) -> None:
    if _value(findings, divisor, values) == 0.0:
        findings.errors.append(
            divisor.error(f"the divisor '{divisor.text}' of mod is 0", remedy="use another number")
        )


def _value(findings: Findings, expr: Expression, values: dict[str, float]) -> float | None:
    """Return the value of an expression; if it has no value, report this and return None."""
    try:
        return evaluate(expr, values)
    except ModelError as fault:
        findings.errors.append(fault)
        return None


def _size(findings: Findings, part: Declared, what: str, size: float | None) -> None:
    """Report a nominal size that is not positive and finite."""
    if size is not None and not 0 < size < math.inf:
        findings.fail(part, f"{what} cannot be {size!r}", "use a finite number above zero")


def _positive(
    findings: Findings,
    part: Declared,
    what: str,
    field: str,
    expr: Expression | None,
    values: dict[str, float],
) -> None:
    value = None if expr is None else _value(findings, expr, values)
    if expr is not None and value is not None and value <= 0:
        shown = "" if expr.is_constant else f" ({expr.text})"
        findings.fail(part, f"{what}: '{field}' cannot be {value:g}{shown}", "use a value above zero")


def _input(findings: Findings, signal: Input, values: dict[str, float]) -> None:
    what = f"input {signal.name}"
    for field, expr in signal.expressions.items():
        if field in ("period", "duration"):
            _positive(findings, signal, what, field, expr, values)
            continue
        value = _value(findings, expr, values)
        if field == "duty" and value is not None and not 0 < value < 1:
            findings.fail(signal, f"{what}: 'duty' cannot be {value:g}", "use a value between 0 and 1")


def _contact(findings: Findings, contact: Contact, values: dict[str, float]) -> None:
    """Check constant loads and constant friction forces of a contact."""
    what = f"contact {contact.name}"
    for name, size in contact.nominal.items():
        _size(findings, contact, f"{what}: 'nominal' of {name}", size)
    if contact.normal.names <= values.keys():
        load = _value(findings, contact.normal, values)
        if load is not None and load < 0:
            shown = "" if contact.normal.is_constant else f" ({contact.normal.text})"
            findings.fail(
                contact,
                f"{what}: the normal load cannot be {load:g}{shown}",
                "use a load that is not negative",
            )
            return
    if not contact.law.is_set_valued:
        return
    for backward in (False, True):
        _onset(findings, contact, values, backward)
        _slip_at_points(findings, contact, values, backward)


def _onset(findings: Findings, contact: Contact, values: dict[str, float], backward: bool) -> None:
    """Check that the stick limit is not below the slip force at v = 0, in one direction of slip."""
    what = f"contact {contact.name}"
    if backward and contact.law.slip_backward is None and contact.law.stick_backward is None:
        return
    forces = contact.limit_force(backward), contact.onset_force(backward)
    if not all(force.names <= values.keys() for force in forces):
        return
    limit, onset = (_value(findings, force, values) for force in forces)
    if limit is None or onset is None:
        return
    for name, force in (("stick limit", limit), ("slip force at v = 0", onset)):
        if force < 0:
            findings.fail(
                contact, f"{what}: the {name} cannot be {force:g}", "a friction force must not be negative"
            )
            return
    if onset - limit > ROUNDING * onset:
        message = f"{what}: the stick limit {limit:g} is below the slip force {onset:g} at v = 0"
        findings.fail(contact, message, "static friction must be at least kinetic friction (mu_s >= mu_k)")


def _slip_at_points(findings: Findings, contact: Contact, values: dict[str, float], backward: bool) -> None:
    """Check that the slip force in one direction is not negative at the points of its tables."""
    if backward and contact.law.slip_backward is None:
        return
    for speed, (across, rows) in product(_speeds_of_tables(contact), _columns_of_tables(contact)):
        force, known = contact.slip_force_at(speed, backward), values | rows
        value = _value(findings, force, known) if force.names <= known.keys() else None
        if value is not None and value < 0:
            message = f"contact {contact.name}: the slip force at v = {speed:g}{across} cannot be {value:g}"
            findings.fail(contact, message, "a friction force must not be negative")
            return


def _columns_of_tables(contact: Contact) -> list[tuple[str, dict[str, float]]]:
    """Return the variables of each table column, with a text that names the value of the second argument."""
    found: list[tuple[str, dict[str, float]]] = []
    for table in contact.law.tables:
        if table.across is not None:
            names = table.row_names(contact.variable(table.name))
            for at, column in zip(table.across_at, zip(*table.values, strict=True), strict=True):
                found.append((f", {table.across.text} = {at:g}", dict(zip(names, column, strict=True))))
    return found or [("", {})]


def _speeds_of_tables(contact: Contact) -> list[float]:
    return sorted({speed for table in contact.law.tables if table.over.text == SPEED for speed in table.at})
