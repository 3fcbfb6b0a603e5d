"""This module lists the expressions of a model, each with the unit that is required of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from hybridsim.expr import Expression
from hybridsim.expr.grammar import TIME
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.component import Component
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.model import Model
from hybridsim.model.units.parse import read_unit
from hybridsim.model.units.quantities import Quantities
from hybridsim.model.units.seconds import SECOND
from hybridsim.model.units.unit import ONE, TURN, Unit

_TURN = Unit(((TURN, Fraction(1)),))
_METRE = Unit((("m", Fraction(1)),))
_LENGTHS, _SPEEDS = (_METRE, ONE), (_METRE / SECOND, ONE / SECOND)  # the second ones are those of angles


@dataclass(frozen=True)
class Statement:
    """An expression, its name for messages, and the unit that is required of it, if there is one."""

    what: str
    expr: Expression
    required: Unit | None = None
    because: str = ""
    is_of_law: bool = False  # whether it is an expression of a friction law, in which arguments are inserted
    counts: bool = False  # whether numbers in products are pure numbers, as in a duration of 20 periods


def statements_of(model: Model, known: Quantities) -> Iterator[Statement]:
    """Yield the expressions of a model, in the order of the declarations in a file."""
    time = known.time
    if model.duration is not None:
        yield Statement("duration", model.duration, time, TIME, counts=True)
    for part in model.parameters:
        yield _value(known, f"parameter {part.name}", part.value, part.name)
    for state in model.states:
        if not isinstance(state, ContactState):
            yield _value(known, f"state {state.name}, start", state.start, state.name)
            yield _rate(known, f"state {state.name}, der", state.der, state.name)
    for discrete in model.discrete:
        yield _value(known, f"discrete state {discrete.name}, start", discrete.start, discrete.name)
    for name, expr in model.definitions:
        yield _value(known, f"definition {name}", expr, name)
    for signal in model.inputs:
        yield from _of_input(known, signal)
    for contact in model.contacts:
        yield from _of_contact(known, contact, model)
    for surface in model.surfaces:
        yield Statement(f"surface {surface.name}", surface.expr)
        for side, values in (("above", surface.above), ("below", surface.below)):
            for name, expr in values.items():
                yield _value(known, f"surface {surface.name}, {name} {side}", expr, name)
    for impact in model.impacts:
        yield Statement(
            f"impact {impact.name}, gap", impact.gap, _unless(known, impact.gap, _LENGTHS), "a gap"
        )
        yield Statement(f"impact {impact.name}, restitution", impact.restitution, ONE, "a ratio of speeds")
    for component in model.components:
        yield from _of_component(known, component)
    for monitor in model.monitors:
        yield Statement(f"monitor {monitor.name}", monitor.expr)
        yield from _resets(known, f"monitor {monitor.name}", monitor.reset)
    for schedule in model.schedules:
        what = f"schedule {schedule.name}"
        for field, time_expr in (("start", schedule.start), ("period", schedule.period)):
            if time_expr is not None:
                yield Statement(f"{what}, {field}", time_expr, time, TIME, counts=True)
        yield from (Statement(f"{what}, times", expr, time, TIME, counts=True) for expr in schedule.times)
        yield from _resets(known, what, schedule.reset)
    for output in model.outputs:
        unit, label = read_unit(output.unit), f"output {output.name}"
        yield Statement(f"output {output.name}", output.expr, unit, label)
        for key, expr in output.modes.items():
            yield Statement(f"output {output.name} in {key}", expr, unit, label)


def _value(known: Quantities, what: str, expr: Expression, name: str) -> Statement:
    return Statement(what, expr, known.units.get(name), name)


def _rate(known: Quantities, what: str, expr: Expression, name: str) -> Statement:
    return Statement(what, expr, known.rate(name), f"the rate of {name}")


def _unless(known: Quantities, expr: Expression, kinds: Sequence[Unit]) -> Unit | None:
    """Return the first of some required units, or None if the expression has the dimension of one of them."""
    unit = known.inference().unit(expr.tree)
    is_one = unit is None or any(unit.dimension == kind.dimension for kind in kinds)
    return None if is_one else kinds[0]


def _resets(known: Quantities, what: str, resets: Mapping[str, Expression]) -> Iterator[Statement]:
    for name, expr in resets.items():
        yield _value(known, f"{what}, reset of {name}", expr, name)


def _of_input(known: Quantities, signal: Input) -> Iterator[Statement]:
    time = known.time
    frequency = None if time is None else _TURN / time
    required: dict[str, tuple[Unit | None, str]] = {
        "period": (time, TIME), "duration": (time, TIME), "duty": (ONE, "a share"),
        "f0": (frequency, "a frequency"), "f1": (frequency, "a frequency"),
        "phase": (time, TIME) if signal.kind == "wave" else (ONE, "an angle"),
    }  # fmt: skip
    for field, expr in signal.expressions.items():
        unit, because = required.get(field, (known.units.get(signal.name), signal.name))
        yield Statement(f"input {signal.name}, {field}", expr, unit, because)


def _of_contact(known: Quantities, contact: Contact, model: Model) -> Iterator[Statement]:
    what = f"contact {contact.name}"
    speed = _unless(known, contact.velocity, _SPEEDS)
    yield Statement(f"{what}, velocity", contact.velocity, speed, "a relative velocity")
    yield Statement(f"{what}, normal", contact.normal)
    what += f", law {contact.law.name}"
    for name, expr in contact.arguments.items():
        yield Statement(f"{what}, {name}", expr)
    positions = (argument.place for argument in contact.arguments.values())
    place = next(positions, None) or contact.place
    load = known.inference().unit(contact.normal.tree)
    for part, expr, required, because in _of_law(known, contact, model):
        at = contact.normal.place if _is_of_load(known, expr, load, required) else place
        there = Expression(expr.text, expr.names, at, expr.tree)
        yield Statement(f"{what}, {part}", there, required, because, is_of_law=True)


def _is_of_load(known: Quantities, expr: Expression, load: Unit | None, required: Unit | None) -> bool:
    """Return whether a force is a pure number times a load whose unit differs from the unit of the force."""
    if load is None or required is None or not load.differs(required):
        return False
    unit = known.inference().unit(expr.tree)
    return unit is not None and not unit.differs(load)


def _of_law(
    known: Quantities, contact: Contact, model: Model
) -> Iterator[tuple[str, Expression, Unit | None, str]]:
    """Yield the names and expressions of the forces and states of a law, each with the required unit."""
    law, name, force = contact.law, contact.name, known.units.get(contact.name)
    if law.is_set_valued:
        for backward in (False, True) if law.slip_backward or law.stick_backward else (False,):
            suffix = " backward" if backward else ""
            yield f"slip{suffix}", contact.slip_force(contact.velocity, backward=backward), force, name
            yield f"stick{suffix}", contact.limit_force(backward), force, name
        return
    for component in model.components_of(contact):
        for mode in component.modes:
            for name, expr in mode.set.items():
                yield f"{name} in {mode.name}", expr, known.units.get(name), name
            for name, expr in mode.der.items():
                yield f"rate of {name} in {mode.name}", expr, known.rate(name), f"the rate of {name}"
            for guard in mode.guards:
                yield f"guard {guard.name} of {mode.name}", guard.expr, None, ""
                for name, expr in (pair for choice in guard.then for pair in choice.reset.items()):
                    yield f"reset of {name} in {mode.name}", expr, known.units.get(name), name
    own = tuple(contact.variable(state.name) for state in law.states)
    for state in model.states:
        if isinstance(state, ContactState) and state.name.startswith(own):
            yield f"rate of {state.name}", state.der, known.rate(state.name), f"the rate of {state.name}"


def _of_component(known: Quantities, component: Component) -> Iterator[Statement]:
    head = f"component {component.name}"
    if component.surface is not None:
        yield Statement(f"{head}, surface", component.surface.function)
    if component.limit is not None:
        yield from _resets(known, f"{head}, limit", component.limit.reset)
    for mode in component.modes:
        where = f"{head}, mode {mode.name}"
        for name, expr in mode.der.items():
            yield _rate(known, f"{where}, der of {name}", expr, name)
        for name, expr in mode.set.items():
            yield _value(known, f"{where}, set {name}", expr, name)
        for guard in mode.guards:
            yield Statement(f"{where}, guard {guard.name}", guard.expr)
            for choice in guard.then:
                if choice.when is not None:
                    yield Statement(f"{where}, guard {guard.name}, when", choice.when)
                yield from _resets(known, f"{where}, guard {guard.name}", choice.reset)
