"""This module replaces guards with a direction by guards of automata that follow the sign of their expressions.

A guard with a direction waits for a crossing: its expression may have any sign when its mode begins. Its automaton has
the modes ``above`` and ``below``, for the signs of the expression, and ``start``, for a sign that is not known yet. In
each mode a variable is what remains >= 0 while there is no crossing in the direction of the guard.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from hybridsim.errors import nearest
from hybridsim.expr import Expression, FunctionExpression, parse
from hybridsim.model.parts.component import DIRECTIONS, Choice, Component, Guard, Mode

_START, _ABOVE, _BELOW = "start", "above", "below"


Definition = tuple[str, Expression]


def without_directions(components: Iterable[Component], definitions: Iterable[Definition]) -> dict[str, Any]:
    """Replace the directions of guards by automata; return the components, and all definitions with the added ones.

    Each component is followed by the automata of its guards.
    """
    found: list[Component] = []
    values: list[Definition] = []
    for component in components:
        modes, sides = [], []
        for mode in component.modes:
            guards = [*mode.guards]
            for k, guard in enumerate(mode.guards):
                if guard.direction is not None:
                    _refuse(component, guard, guard.direction)
                    name = f"{component.name}_{_word(mode.name)}_{_word(guard.name)}"
                    values.append((f"{name}_value", guard.expr))
                    sides.append(_side(name, guard))
                    guards[k] = replace(guard, expr=parse(name, guard.expr.place), direction=None)
            modes.append(replace(mode, guards=tuple(guards)))
        found += (replace(component, modes=tuple(modes)), *sides) if sides else (component,)
    return {"components": tuple(found), "definitions": (*definitions, *values)}


def _refuse(component: Component, guard: Guard, direction: str) -> None:
    """Raise an error for a guard that cannot have a direction."""
    title = f"component {component.name}, guard {guard.name}"
    if direction not in DIRECTIONS:
        raise guard.error(
            f"{title}: unknown direction '{direction}'", nearest(direction, DIRECTIONS, kind="directions")
        )
    if component.surface is not None:
        raise guard.error(
            f"{title} cannot have a direction, because the surface selects the next mode",
            "remove `direction`",
        )
    if isinstance(guard.expr, FunctionExpression):
        remedy = "write the guard as an expression, or use hs.Monitor with this direction and a reset"
        raise guard.error(f"{title} cannot have a direction, because it is a Python function", remedy)


def _word(label: str) -> str:
    """Return a label with only characters that names may contain."""
    return re.sub(r"\W", "_", label)


def _side(name: str, guard: Guard) -> Component:
    """Return the automaton that follows the sign of a guard's expression; ``NAME_value`` is the expression."""
    rising, falling = (parse(f"{sign}{name}_value", guard.expr.place) for sign in ("", "-"))
    one = parse(1)
    both = guard.direction == "both"
    variable = {
        _START: one,
        _ABOVE: one if guard.direction == "up" else rising,
        _BELOW: one if guard.direction == "down" else falling,
    }
    # The sign after a crossing is found anew if a reset at the crossing could cause a second one.
    ways = {
        _START: (("falls", rising, _BELOW), ("rises", falling, _ABOVE)),
        _ABOVE: (("falls", rising, _START if both else _BELOW),),
        _BELOW: (("rises", falling, _START if both else _ABOVE),),
    }
    modes = tuple(
        Mode(
            mode,
            tuple(_way(*way, guard) for way in ways[mode]),
            set={name: variable[mode]},
            place=guard.place,
        )
        for mode in (_START, _ABOVE, _BELOW)
    )
    return Component(name, modes, _START, place=guard.place)


def _way(name: str, expr: Expression, target: str, guard: Guard) -> Guard:
    return Guard(name, expr, (Choice(target, place=guard.place),), place=guard.place)
