"""This module infers the units that a model does not declare, from the expressions that set or use a name.

Several expressions may tell a unit: for a contact force its law, the rates in which it occurs, and an output that shows
it. The unit that most of them tell is taken, so that a single fault is reported where it is.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from hybridsim.expr import Expression
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.quantities import State
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.model.units.infer import factors_of, terms_of
from hybridsim.model.units.law_names import LawNames
from hybridsim.model.units.parse import read_unit
from hybridsim.model.units.quantities import Quantities, declared_quantities
from hybridsim.model.units.unit import ONE, Unit, most_frequent

# Largest number of passes over the names without a declared unit; each pass finds at least one more unit.
_PASSES = 50


def quantities_of(model: Model) -> Quantities | None:
    """Return the declared and the inferred units of the names of a model, or None if no unit is declared."""
    known = declared_quantities(model)
    if known is None:
        return None
    witnesses = _Witnesses(model, known)
    unknown = not_declared = [name for name in witnesses.names if name not in known.units]
    for _ in range(_PASSES):
        found = {name: unit for name in unknown if (unit := witnesses.unit(name)) is not None}
        if not found:
            break
        known.units |= found
        unknown = [name for name in unknown if name not in found]
        known.inferred |= found.keys()
    for name in not_declared:  # once more, since now all votes are known
        if former := known.units.pop(name, None):
            known.units[name] = witnesses.unit(name) or former
    return known


@dataclass(frozen=True)
class _Use:
    """An expression, and the source of its unit: a name, a label, or the state with this expression as its rate."""

    expr: Expression
    rate_of: str = ""
    value_of: str = ""
    label: str = ""

    def required(self, known: Quantities) -> Unit | None:
        """Return the unit that the expression needs, or None if the unit is unknown."""
        if self.rate_of:
            return known.rate(self.rate_of)
        return known.units.get(self.value_of) if self.value_of else read_unit(self.label)


def _uses(model: Model) -> Iterator[_Use]:
    """Yield the expressions that determine the unit of a name that occurs in the expression."""
    yield from (_Use(state.der, rate_of=state.name) for state in model.states)
    yield from (_Use(expr, value_of=name) for name, expr in model.definitions)
    yield from (_Use(output.expr, label=output.unit) for output in model.outputs)
    for contact in model.contacts:
        yield from (_Use(contact.velocity), _Use(contact.normal))
    yield from (_Use(impact.gap) for impact in model.impacts)


class _Witnesses:
    """The expressions that determine the units of names: those that set a name and those that use a name."""

    def __init__(self, model: Model, known: Quantities) -> None:
        self.known = known
        self.contacts = {contact.name: contact for contact in model.contacts}
        self.rates = {state.name: of for state in model.states for of in _of_law(model, state)}
        self.setting = _setting(model)
        signals = (*(part.name for part in model.discrete), *(signal.name for signal in model.inputs))
        numbers = {name for name, expr in model.definitions if expr.is_constant}
        # a number may stand for several quantities; each of these is one
        single = {*signals, *model.variables(), *dict(model.definitions)} - numbers
        self.uses: dict[str, list[_Use]] = {name: [] for name in single}
        for use in _uses(model):
            for name in use.expr.names & single:
                self.uses[name].append(use)
        self.names = [*dict.fromkeys((*self.setting, *self.rates, *self.contacts, *model.variables()))]

    def unit(self, name: str) -> Unit | None:
        """Return the unit of a name that follows from most expressions, or the first of several such units."""
        votes = [*self._votes(name)]
        return most_frequent(votes) if votes else None

    def _votes(self, name: str) -> Iterator[Unit]:
        known = self.known
        for use in self.uses.get(name, ()):
            required = use.required(known)
            yield from _solved(known, use.expr.tree, () if required is None else (required,), name)
        for expr in self.setting.get(name, ()):
            units = (known.inference().unit(term) for term in terms_of(expr.tree))
            yield from (unit for unit in units if unit is not None)
        if name in self.contacts:
            law = LawNames(known, self.contacts[name])
            for _, expr in law.forces():
                terms = map(law.unit, terms_of(law.tree(expr)))
                yield from (unit for unit in terms if unit is not None)
        if name in self.rates and known.time is not None:
            contact, der = self.rates[name]
            law = LawNames(known, contact)
            rate = law.unit(law.tree(der))
            if rate is not None:
                yield rate * known.time


def _of_law(model: Model, state: State) -> Iterator[tuple[Contact, Expression]]:
    """Yield the contact whose law adds a state, and the rate of the state in the names of the law."""
    if isinstance(state, ContactState):
        for contact in model.contacts:
            for own in contact.law.states:
                name = contact.variable(own.name)
                if state.name == name or (contact.law.copies and state.name.rstrip("0123456789") == name):
                    yield contact, own.der


def _setting(model: Model) -> dict[str, list[Expression]]:
    """Return the expressions that set each name."""
    found: dict[str, list[Expression]] = {part.name: [part.value] for part in model.parameters}
    found |= {name: [expr] for name, expr in model.definitions}
    for signal in model.inputs:
        found[signal.name] = [e for e in (signal.amplitude, signal.offset) if e is not None]
    found |= {discrete.name: [discrete.start] for discrete in model.discrete}
    found |= {state.name: [state.start] for state in model.states}
    contacts = {contact.name for contact in model.contacts}
    for component in model.all_components():
        for mode in component.modes:
            for name, expr in mode.set.items():
                if name not in contacts:
                    found.setdefault(name, []).append(expr)
    for resets in _resets(model):
        for name, expr in resets.items():
            found.setdefault(name, []).append(expr)
    return found


def _resets(model: Model) -> Iterator[Mapping[str, Expression]]:
    yield from (monitor.reset for monitor in model.monitors)
    yield from (schedule.reset for schedule in model.schedules)
    for component in model.components:
        guards = (guard for mode in component.modes for guard in mode.guards)
        yield from (choice.reset for guard in guards for choice in guard.then)


def _solved(known: Quantities, node: ast.expr, required: tuple[Unit, ...], name: str) -> Iterator[Unit]:
    """Yield the units that a name must have so that an expression has one of the given units."""
    match node:
        case ast.Name(id=own) if own == name:
            yield from required
        case ast.UnaryOp(operand=operand):
            yield from _solved(known, operand, required, name)
        case ast.BinOp(op=ast.Add() | ast.Sub()):
            common = known.inference().unit(node)
            both = required if common is None else (common, *required)
            for term in terms_of(node):
                if name in names_of(term):
                    yield from _solved(known, term, both, name)
        case ast.BinOp(op=ast.Mult() | ast.Div()):
            inside, rest = None, ONE
            for factor, sign in factors_of(node):
                unit = known.inference().unit(factor)
                if name in names_of(factor) and sign > 0 and inside is None:
                    inside = factor
                elif unit is None:
                    return
                else:
                    rest = rest * unit if sign > 0 else rest / unit
            if inside is not None:
                yield from _solved(known, inside, tuple(unit / rest for unit in required), name)
