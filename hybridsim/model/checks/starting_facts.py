"""This module finds guards that are zero at the start, and loads that can become zero."""

from __future__ import annotations

from collections.abc import Iterator

from hybridsim.expr import Expression, of_tree, rounding_of
from hybridsim.expr.grammar import TIME
from hybridsim.expr.rebuild import with_names
from hybridsim.model.meanings import Meanings
from hybridsim.model.parts.component import Component, Corner
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.nonsmooth import is_clear_of_zero
from hybridsim.model.smoothing.one_sided import names_of, never_negative, number_of

_ULP = 2.0**-52  # relative spacing of doubles: the uncertainty of a start value that is not a whole number


def starting_facts(model: Model) -> tuple[str, ...]:
    """Return a sentence for each guard, surface or gap that is zero at the start, and for each vanishing load."""
    if model.flow is not None:
        return ()
    meanings = Meanings(model)
    start = _Start(model, meanings)
    starts = (line for component in model.all_components() for line in _starts(model, component, start))
    return (*starts, *_loads(model, meanings))


class _Start:
    """The values of a model at the start."""

    def __init__(self, model: Model, meanings: Meanings) -> None:
        self.meanings = meanings
        self.starts = model.start_values() | model.discrete_values()
        self.values = {**model.parameter_values(), **self.starts, TIME: 0.0}
        self.trees = {state.name: state.start.tree for state in model.states}
        self.trees |= {discrete.name: discrete.start.tree for discrete in model.discrete}

    def value(self, expr: Expression) -> float | None:
        """Return the value of an expression at the start, or None if the value is undefined."""
        return number_of(self.meanings.written_out(expr.tree), self.values, self.meanings.lookup)

    def is_zero(self, expr: Expression) -> bool:
        """Return whether an expression is zero at the start within rounding errors."""
        tree = self.meanings.written_out(expr.tree)
        value = number_of(tree, self.values, self.meanings.lookup)
        if value is None:
            return False
        bound = rounding_of(of_tree(with_names(tree, self.trees)), self.values)
        for name in names_of(tree) & self.starts.keys():
            start = self.starts[name]
            if start != round(start):
                moved = number_of(tree, self.values | {name: start * (1.0 + _ULP)}, self.meanings.lookup)
                bound += 0.0 if moved is None else abs(moved - value)
        return abs(value) <= bound


def _starts(model: Model, component: Component, start: _Start) -> Iterator[str]:
    """Yield sentences about a component if one of its guards or its surface is zero at the start."""
    name, surface = component.name, component.surface
    if isinstance(component, Corner):
        return
    if surface is not None and surface.is_unilateral:
        gap = start.value(surface.function)
        if gap is not None and gap < 0.0 and not start.is_zero(surface.function):
            yield (
                f"the gap of impact {name} ({surface.function.text}) is {gap:.6g} at the start: the body begins beyond "
                "its stop"
            )
    if surface is not None and start.is_zero(surface.function):
        text = surface.function.text
        if surface.is_unilateral:
            yield (
                f"the gap of impact {name} ({text}) is zero at the start: its time derivatives decide whether "
                "the gap is closed"
            )
        elif any(contact.name == name for contact in model.contacts):
            yield (
                f"the relative velocity of contact {name} ({text}) is zero at the start: "
                "the forces decide whether the contact sticks"
            )
        else:
            yield (
                f"the surface function of {name} ({text}) is zero at the start: the rates on both sides decide the "
                "mode"
            )
    if surface is None and component.initial:
        for guard in component.mode(component.initial).guards:
            if start.is_zero(guard.expr):
                yield (
                    f"guard {guard.name} of mode {component.initial}, component {name} ({guard.expr.text}) is zero at "
                    "the start: its first nonzero time derivative decides whether the guard fires immediately"
                )


def _loads(model: Model, meanings: Meanings) -> Iterator[str]:
    """Yield sentences about normal loads that can reach zero."""
    numbers = model.parameter_values()
    for contact in model.contacts:
        tree = meanings.written_out(contact.normal.tree)
        load = f"the normal load of contact {contact.name} ({contact.normal.text})"
        if contact.opens:
            yield f"{load} can become negative: the contact opens when the load reaches zero"
            continue
        if not meanings.moves(tree) or is_clear_of_zero(tree, numbers, meanings):
            continue
        if never_negative(tree, numbers, meanings.lookup):
            yield f"{load} can reach zero: friction is then zero until the load is positive again"
