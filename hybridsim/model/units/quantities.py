"""This module collects the units of the names of a model: those declared, and those inferred from expressions."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from hybridsim.expr import Expression
from hybridsim.expr.grammar import TIME
from hybridsim.model.laws.law_with_states import ContactState
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.quantities import Discrete, Parameter, State
from hybridsim.model.smoothing.one_sided import names_of
from hybridsim.model.units.infer import Inference, factors_of, terms_of
from hybridsim.model.units.parse import read_unit
from hybridsim.model.units.unit import ONE, Unit

_TIMES = ("s", "ms", "us", "µs", "min", "h", "d")
# Largest number of passes over the names without a declared unit; each pass finds at least one more unit.
_PASSES = 50


@dataclass
class Quantities:
    """The units of the names of a model.

    Parameters
    ----------
    texts : the declared units as they are written, by name, without empty ones.
    units : the known units by name.
    inferred : the names whose units follow from expressions.
    parameters : the names of the parameters.
    """

    texts: dict[str, str]
    units: dict[str, Unit]
    parameters: frozenset[str]
    inferred: set[str] = field(default_factory=set)

    @property
    def time(self) -> Unit | None:
        """The unit of t."""
        return self.units.get(TIME)

    def inference(self) -> Inference:
        """Return an empty inference that knows these units."""
        return Inference(self.units, self.parameters)

    def rate(self, name: str) -> Unit | None:
        """Return the unit of the time derivative of a quantity."""
        return self.units[name] / self.time if name in self.units and self.time else None

    def learn(self, name: str, unit: Unit | None) -> bool:
        """Add an inferred unit, and return whether it is new."""
        if unit is None or name in self.units:
            return False
        self.units[name] = unit
        self.inferred.add(name)
        return True


def quantities_of(model: Model) -> Quantities | None:
    """Return the units of the names of a model, or None if no unit is declared."""
    texts = declared_texts(model)
    if not texts:
        return None
    units = {name: unit for name, text in texts.items() if (unit := read_unit(text)) is not None}
    units |= dict.fromkeys((surface.name for surface in model.surfaces), ONE)
    found = Quantities(texts, units, frozenset(parameter.name for parameter in model.parameters))
    found.learn(TIME, _time_of([*texts.values()]))
    sources, forces = _sources(model), _forces(model)
    for _ in range(_PASSES):
        news = [_learn(found, name, exprs) for name, exprs in sources.items()]
        news += [_learn_rates(found, model), *(_learn_from_use(found, name, model) for name in forces)]
        if not any(news):
            break
    return found


def declared_texts(model: Model) -> dict[str, str]:
    """Return the units that a model declares; those of the states of friction laws follow from their equations."""
    states = (state for state in model.states if not isinstance(state, ContactState))
    parts: tuple[Parameter | State | Discrete | Input, ...]
    parts = (*model.parameters, *states, *model.discrete, *model.inputs)
    return {part.name: part.unit for part in parts if part.unit} | model.connected_units


def _time_of(texts: Iterable[str]) -> Unit | None:
    """Return the unit of t: the unit of time that most declarations contain, or s if they imply it."""
    used: Counter[str] = Counter()
    for text in texts:
        symbols = [symbol for symbol in _TIMES if _contains(text, symbol)]
        used.update(symbols)
        unit = read_unit(text)
        if not symbols and unit is not None and "s" in dict(unit.powers):
            used["s"] += 0  # as in N, if no other unit of time is found
    if not used:
        return None
    return read_unit(max(used, key=lambda symbol: (used[symbol], symbol == "s")))


def _contains(text: str, symbol: str) -> bool:
    return symbol in "".join(c if c.isalpha() else " " for c in text).split()


def _sources(model: Model) -> dict[str, list[Expression]]:
    """Return the expressions that tell the units of names, by name."""
    found: dict[str, list[Expression]] = {name: [expr] for name, expr in model.definitions}
    found |= {part.name: [part.value] for part in model.parameters}
    for signal in model.inputs:
        found[signal.name] = [e for e in (signal.amplitude, signal.offset) if e is not None]
    for part in model.discrete:
        found[part.name] = [part.start]
    for component in model.all_components():
        for mode in component.modes:
            for name, expr in mode.set.items():
                found.setdefault(name, []).append(expr)
    for resets in _resets(model):
        for name, expr in resets.items():
            found.setdefault(name, []).append(expr)
    return found


def _resets(model: Model) -> Iterator[Mapping[str, Expression]]:
    yield from (monitor.reset for monitor in model.monitors)
    yield from (schedule.reset for schedule in model.schedules)
    for component in model.components:
        yield from (
            choice.reset for mode in component.modes for guard in mode.guards for choice in guard.then
        )


def _forces(model: Model) -> list[str]:
    """Return the names of the forces of contacts and impacts, whose units may follow from the rates of states."""
    return [*(contact.name for contact in model.contacts), *(impact.name for impact in model.impacts)]


def _learn(found: Quantities, name: str, exprs: Iterable[Expression]) -> bool:
    if name in found.units:
        return False
    units = (found.inference().unit(expr.tree) for expr in exprs)
    return found.learn(name, next((unit for unit in units if unit is not None), None))


def _learn_rates(found: Quantities, model: Model) -> bool:
    """Infer the units of the states of friction laws from their rates, or else from their start values."""
    news = False
    for state in model.states:
        if not isinstance(state, ContactState) or state.name in found.units:
            continue
        rate, start = (found.inference().unit(expr.tree) for expr in (state.der, state.start))
        unit = rate * found.time if rate is not None and found.time else start
        news |= found.learn(state.name, unit)
    return news


def _learn_from_use(found: Quantities, name: str, model: Model) -> bool:
    """Infer the unit of a force from the first rate or definition in which it is the only unknown."""
    if name in found.units:
        return False
    rates = [(found.rate(state.name), state.der) for state in model.states]
    known = [(found.units.get(name), expr) for name, expr in model.definitions]
    for needed, expr in (*rates, *known):
        if name in expr.names and needed is not None:
            unit = _solved(found, expr.tree, needed, name)
            if unit is not None:
                return found.learn(name, unit)
    return False


def _solved(found: Quantities, node: ast.expr, needed: Unit, name: str) -> Unit | None:
    """Return the unit that a name must have for an expression to have a unit; None if it does not follow."""
    match node:
        case ast.Name(id=own):
            return needed if own == name else None
        case ast.UnaryOp(operand=operand):
            return _solved(found, operand, needed, name)
        case ast.BinOp(op=ast.Add() | ast.Sub()):
            common = found.inference().unit(node) or needed
            solved = (_solved(found, term, common, name) for term in terms_of(node))
            return next((unit for unit in solved if unit is not None), None)
        case ast.BinOp(op=ast.Mult() | ast.Div()):
            inside: list[ast.expr] = []
            for factor, sign in factors_of(node):
                unit = found.inference().unit(factor)
                if name in names_of(factor) and sign > 0:
                    inside.append(factor)
                elif unit is None:
                    return None
                else:
                    needed = needed / unit if sign > 0 else needed * unit
            return _solved(found, inside[0], needed, name) if len(inside) == 1 else None
    return None
