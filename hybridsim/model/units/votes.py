"""This module infers the units that a model does not declare, from the expressions that set or use a name.

Several expressions may tell a unit: for a contact force its law, the rates in which it occurs, and an output that shows
it. The unit that most of them tell is taken, so that a single fault is reported where it is.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping

from hybridsim.expr import Expression
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.model.units.infer import factors_of, terms_of
from hybridsim.model.units.parse import read_unit
from hybridsim.model.units.quantities import Quantities, declared_quantities
from hybridsim.model.units.unit import Unit

# Largest number of passes over the names without a declared unit; each pass finds at least one more unit.
_PASSES = 50


def quantities_of(model: Model) -> Quantities | None:
    """Return the declared and the inferred units of the names of a model, or None if it declares none."""
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


class _Witnesses:
    """The expressions that tell the units of names: those that set a name, and those that use it."""

    def __init__(self, model: Model, known: Quantities) -> None:
        self.known = known
        self.rates = {state.name: state.der for state in model.states if isinstance(state, ContactState)}
        self.setting = _setting(model)
        self.shown = {output.expr.text: read_unit(output.unit) for output in model.outputs if output.unit}
        signals = (*(part.name for part in model.discrete), *(signal.name for signal in model.inputs))
        numbers = {name for name, expr in model.definitions if expr.is_constant}
        # a number may stand for several quantities; each of these is one
        single = {*signals, *model.variables(), *dict(model.definitions)} - numbers
        self.uses: dict[str, list[tuple[str, bool, Expression]]] = {name: [] for name in single}
        uses = [(state.name, True, state.der) for state in model.states]
        for use in (*uses, *((name, False, expr) for name, expr in model.definitions)):
            for name in use[2].names & single:
                self.uses[name].append(use)
        self.names = [*dict.fromkeys((*self.setting, *self.rates, *model.variables()))]

    def unit(self, name: str) -> Unit | None:
        """Return the unit that most expressions tell for a name; of equally many the first."""
        votes = [*self._votes(name)]
        if not votes:
            return None
        return max(votes, key=lambda unit: sum(not unit.differs(other) for other in votes))

    def _votes(self, name: str) -> Iterator[Unit]:
        known = self.known
        for expr in self.setting.get(name, ()):
            if (unit := known.inference().unit(expr.tree)) is not None:
                yield unit
        if name in self.rates and known.time is not None:
            rate = known.inference().unit(self.rates[name].tree)
            if rate is not None:
                yield rate * known.time
        for user, is_rate, expr in self.uses.get(name, ()):
            needed = known.rate(user) if is_rate else known.units.get(user)
            if needed is not None and (unit := _solved(known, expr.tree, needed, name)) is not None:
                yield unit
        if (shown := self.shown.get(name)) is not None:
            yield shown


def _setting(model: Model) -> dict[str, list[Expression]]:
    """Return the expressions that set each name."""
    found: dict[str, list[Expression]] = {part.name: [part.value] for part in model.parameters}
    found |= {name: [expr] for name, expr in model.definitions}
    for signal in model.inputs:
        found[signal.name] = [e for e in (signal.amplitude, signal.offset) if e is not None]
    found |= {discrete.name: [discrete.start] for discrete in model.discrete}
    found |= {state.name: [state.start] for state in model.states}
    contacts = {contact.name for contact in model.contacts if contact.law.is_set_valued}
    for contact in model.contacts:
        if contact.law.is_set_valued:
            found[contact.name] = [contact.slip_force(contact.velocity)]
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


def _solved(known: Quantities, node: ast.expr, needed: Unit, name: str) -> Unit | None:
    """Return the unit that a name must have for an expression to have a unit; None if it does not follow."""
    match node:
        case ast.Name(id=own):
            return needed if own == name else None
        case ast.UnaryOp(operand=operand):
            return _solved(known, operand, needed, name)
        case ast.BinOp(op=ast.Add() | ast.Sub()):
            common = known.inference().unit(node) or needed
            solved = (_solved(known, term, common, name) for term in terms_of(node))
            return next((unit for unit in solved if unit is not None), None)
        case ast.BinOp(op=ast.Mult() | ast.Div()):
            inside: list[ast.expr] = []
            for factor, sign in factors_of(node):
                unit = known.inference().unit(factor)
                if name in names_of(factor) and sign > 0:
                    inside.append(factor)
                elif unit is None:
                    return None
                else:
                    needed = needed / unit if sign > 0 else needed * unit
            return _solved(known, inside[0], needed, name) if len(inside) == 1 else None
    return None
