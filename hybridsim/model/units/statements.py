"""This module lists the expressions of a model, each with the unit that is required of it."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from hybridsim.expr import Expression
from hybridsim.expr.grammar import TIME
from hybridsim.expr.write import write
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.component import Component
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.model import Model
from hybridsim.model.units.law_names import LawNames
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
    counts: bool = False  # whether numbers in products are pure numbers, as in a duration of 20 periods
    law: LawNames | None = None  # the names of the friction law to which the expression belongs

    @property
    def tree(self) -> ast.expr:
        """The tree of the expression, in which the names of a law that are only numbers are inserted."""
        return self.law.tree(self.expr) if self.law else self.expr.tree

    def text(self, node: ast.expr) -> str:
        """Return the text of a part of the expression."""
        return self.law.text(node, self.expr) if self.law else write(node)


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
        yield from _of_contact(known, contact)
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
        "phase": (ONE, "an angle") if signal.kind == "chirp" else (time, TIME),
    }  # fmt: skip
    for field, expr in signal.expressions.items():
        unit, because = required.get(field, (known.units.get(signal.name), signal.name))
        yield Statement(f"input {signal.name}, {field}", expr, unit, because)


def _of_contact(known: Quantities, contact: Contact) -> Iterator[Statement]:
    what = f"contact {contact.name}"
    speed = _unless(known, contact.velocity, _SPEEDS)
    yield Statement(f"{what}, velocity", contact.velocity, speed, "a relative velocity")
    yield Statement(f"{what}, normal", contact.normal)
    what += f", law {contact.law.name}"
    law = LawNames(known, contact)
    for name, expr in contact.arguments.items():
        declared = read_unit(contact.law.units.get(name, ""))
        yield Statement(f"{what}, {name}", expr, declared, f"{name} of the law")
    for part, expr, required, because in law.formulas():
        yield Statement(f"{what}, {part}", expr, required, because, law=law)


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
