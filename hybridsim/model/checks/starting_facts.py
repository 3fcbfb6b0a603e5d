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
    starts = (line for component in model.all_components() for line in _starts(model, component, meanings))
    return (*starts, *_loads(model, meanings))


def _starts(model: Model, component: Component, meanings: Meanings) -> Iterator[str]:
    """Yield sentences about a component if one of its guards or its surface is zero at the start."""
    name, surface = component.name, component.surface
    if isinstance(component, Corner):
        return
    if surface is not None and surface.is_unilateral:
        gap = _value_at_start(model, surface.function, meanings)
        if gap is not None and gap < 0.0 and not _is_zero_at_start(model, surface.function, meanings):
            yield (
                f"the gap of impact {name} ({surface.function.text}) is {gap:.6g} at the start: the body begins beyond "
                "its stop"
            )
    if surface is not None and _is_zero_at_start(model, surface.function, meanings):
        text = surface.function.text
        if surface.is_unilateral:
            yield (
                f"the gap of impact {name} ({text}) is zero at the start: its time derivatives decide whether it is "
                "closed"
            )
        elif any(contact.name == name for contact in model.contacts):
            yield (
                f"the relative velocity of contact {name} ({text}) is zero at the start: "
                "the forces decide whether it sticks"
            )
        else:
            yield (
                f"the surface function of {name} ({text}) is zero at the start: the rates on both sides decide the "
                "mode"
            )
    if surface is None and component.initial:
        for guard in component.mode(component.initial).guards:
            if _is_zero_at_start(model, guard.expr, meanings):
                yield (
                    f"guard {guard.name} of mode {component.initial}, component {name} ({guard.expr.text}) is zero at "
                    "the start: its first nonzero time derivative decides whether it fires immediately"
                )


def _value_at_start(model: Model, expr: Expression, meanings: Meanings) -> float | None:
    """Return the value of an expression at the start, or None if the value is undefined."""
    starts = model.start_values() | model.discrete_values()
    values = {**model.parameter_values(), **starts, TIME: 0.0}
    return number_of(meanings.written_out(expr.tree), values, meanings.lookup)


def _is_zero_at_start(model: Model, expr: Expression, meanings: Meanings) -> bool:
    """Return whether an expression is zero at the start within rounding errors."""
    starts = model.start_values() | model.discrete_values()
    values = {**model.parameter_values(), **starts, TIME: 0.0}
    tree = meanings.written_out(expr.tree)
    value = number_of(tree, values, meanings.lookup)
    if value is None:
        return False
    trees = {state.name: state.start.tree for state in model.states}
    trees |= {discrete.name: discrete.start.tree for discrete in model.discrete}
    bound = rounding_of(of_tree(with_names(tree, trees)), values)
    for name in names_of(tree) & starts.keys():
        if starts[name] != round(starts[name]):
            moved = number_of(tree, values | {name: starts[name] * (1.0 + _ULP)}, meanings.lookup)
            bound += 0.0 if moved is None else abs(moved - value)
    return abs(value) <= bound


def _loads(model: Model, meanings: Meanings) -> Iterator[str]:
    """Yield sentences about normal loads that can reach zero."""
    numbers = model.parameter_values()
    for contact in model.contacts:
        tree = meanings.written_out(contact.normal.tree)
        load = f"the normal load of contact {contact.name} ({contact.normal.text})"
        if contact.opens:
            yield f"{load} can become negative: the contact opens when it reaches zero"
            continue
        if not meanings.moves(tree) or is_clear_of_zero(tree, numbers, meanings):
            continue
        if never_negative(tree, numbers, meanings.lookup):
            yield f"{load} can reach zero: friction is then zero until the load is positive again"
