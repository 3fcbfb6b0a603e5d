"""This module replaces floor, mod and round in the expressions of a model by discrete states with whole values.

floor(u) becomes a discrete state k with k <= u < k + 1. Its component has one mode with a guard on each side. At an
event these numbers are chosen first, together with the sides of corners (`hybridsim.engine.events.corner_sides`), so
that guards, loads and conditions read the new numbers. mod(x, d) is x - d*floor(x/d), and round(x) is floor(x + 1/2).
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from hybridsim.expr import Expression, FunctionExpression, Increment, of_tree, parse
from hybridsim.expr.grammar import STAIRS
from hybridsim.expr.increment import HEAD
from hybridsim.expr.rebuild import rebuilt, with_names
from hybridsim.expr.walk import stairs_in, value_of
from hybridsim.expr.write import write
from hybridsim.model.free_name import free_name, names_of_model
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.parts.component import Choice, Component, Guard, Mode, WholeNumber
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.frozen_map import FrozenMap
from hybridsim.model.parts.model import Model
from hybridsim.model.parts.quantities import Discrete
from hybridsim.model.smoothing.one_sided import names_of

Part = TypeVar("Part", bound=Declared)

UP, DOWN = "up", "down"  # the guards at which the number grows and shrinks, in this order
_CALL = re.compile(rf"\b({'|'.join(sorted(STAIRS))})\s*\(")
_ROUND, _REST, _QUOTIENT = (parse(text).tree for text in ("x + 0.5", "x - d*k", "x/d"))
_ABOVE, _BELOW, _MORE, _LESS = (parse(text).tree for text in ("end - u", "u - k", "k + 1", "k - 1"))


def with_whole_numbers(model: Model) -> Model:
    """Return the model with whole numbers in place of floor, mod and round, or the model itself if it has none."""
    is_plain = model.flow is not None or not any(_CALL.search(expr.text) for expr in model_expressions(model))
    return model if is_plain else _WholeNumbers(model).run()


def model_expressions(model: Model) -> Iterator[Expression]:
    """Yield the expressions of a model that are computed during a run, except those of friction laws."""
    kinds = (model.states, model.components, model.contacts, model.surfaces, model.monitors, model.schedules)
    return _expressions((*kinds, model.outputs, tuple(expr for _, expr in model.definitions)))


def _expressions(value: Any) -> Iterator[Expression]:
    """Yield the expressions in some declarations, except those of friction laws, which have names of their own."""
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, Mapping):
        yield from _expressions(tuple(value.values()))
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _expressions(item)
    elif isinstance(value, Declared) and not isinstance(value, FrictionLaw):
        yield from _expressions([getattr(value, one.name) for one in fields(value)])


class _WholeNumbers:
    """Replaces floor, mod and round in one model."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.taken = set(names_of_model(model))
        # text of the argument -> name of the number, argument
        self.numbers: dict[str, tuple[str, ast.expr]] = {}

    def run(self) -> Model:
        """Return the rewritten model."""
        model, change = self.model, self._changed
        definitions = tuple((name, change(expr)) for name, expr in model.definitions)
        rewritten: dict[str, Any] = {
            "states": _each(model.states, lambda s: {"der": change(s.der)}),
            "components": _each(model.components, self._component),
            "contacts": _each(
                model.contacts, lambda c: {"normal": change(c.normal), "arguments": self._map(c.arguments)}
            ),
            "surfaces": _each(
                model.surfaces, lambda s: {"above": self._map(s.above), "below": self._map(s.below)}
            ),
            "monitors": _each(
                model.monitors, lambda m: {"expr": change(m.expr), "reset": self._map(m.reset)}
            ),
            "schedules": _each(model.schedules, lambda s: {"reset": self._map(s.reset)}),
            "outputs": _each(model.outputs, lambda o: {"expr": change(o.expr), "modes": self._map(o.modes)}),
        }
        components = [self._made(name, argument) for name, argument in self.numbers.values()]
        discrete = tuple(Discrete(name, parse(0)) for name, _ in self.numbers.values())
        rewritten["components"] += tuple(components)
        return replace(model, definitions=definitions, discrete=(*model.discrete, *discrete), **rewritten)

    def _made(self, name: str, argument: ast.expr) -> WholeNumber:
        """Return the component of a number."""
        title = f"floor({write(argument)})"
        while title in self.taken:
            title += "'"
        self.taken.add(title)
        # a variable for k + 1, so that each guard is one subtraction: k + 1 - u may be rounded at zero
        end = free_name(self.taken, f"{name}_end")
        parts, guards = {"k": ast.Name(name, ast.Load()), "end": ast.Name(end, ast.Load()), "u": argument}, []
        for side, tree, step in ((UP, _ABOVE, _MORE), (DOWN, _BELOW, _LESS)):
            guard, reset = (of_tree(with_names(part, parts)) for part in (tree, step))
            guards.append(Guard(side, guard, (Choice("on", None, {name: reset}),)))
        values = {end: of_tree(with_names(_MORE, parts))}
        return WholeNumber(
            title, (Mode("on", tuple(guards), set=values),), number=name, argument=of_tree(argument)
        )

    def _changed(self, expr: Expression) -> Expression:
        if isinstance(expr, FunctionExpression) or not any(stairs_in(expr.tree)):
            return expr
        tree = self._tree(expr.tree)
        head = HEAD if isinstance(expr, Increment) else ""
        return replace(expr, text=head + write(tree), names=names_of(tree), tree=tree)

    def _tree(self, node: ast.expr) -> ast.expr:
        made = rebuilt(node, self._tree)
        if made is not node and not names_of(made) and next(stairs_in(made), None) is made:
            return parse(float(value_of(made, {}))).tree
        match made:
            case ast.Call(func=ast.Name(id="floor"), args=[x]):
                return self._number(x)
            case ast.Call(func=ast.Name(id="round"), args=[x]):
                return self._number(with_names(_ROUND, {"x": x}))
            case ast.Call(func=ast.Name(id="mod"), args=[x, d]):
                quotient = self._number(with_names(_QUOTIENT, {"x": x, "d": d}))
                return with_names(_REST, {"x": x, "d": d, "k": quotient})
        return made

    def _number(self, argument: ast.expr) -> ast.expr:
        """Return the name of the whole number at or below an expression."""
        text = write(argument)
        if text not in self.numbers:
            name = free_name(self.taken, f"whole_{len(self.numbers) + 1}")
            self.numbers[text] = name, argument
        return ast.Name(self.numbers[text][0], ast.Load())

    def _map(self, values: Mapping[str, Expression]) -> FrozenMap[Expression]:
        return FrozenMap({name: self._changed(expr) for name, expr in values.items()})

    def _component(self, component: Component) -> dict[str, Any]:
        return {
            "modes": _each(component.modes, self._mode),
            "limit": component.limit and replace(component.limit, **self._choice(component.limit)),
        }

    def _mode(self, mode: Mode) -> dict[str, Any]:
        guards = _each(
            mode.guards, lambda g: {"expr": self._changed(g.expr), "then": _each(g.then, self._choice)}
        )
        return {"guards": guards, "der": self._map(mode.der), "set": self._map(mode.set)}

    def _choice(self, choice: Choice) -> dict[str, Any]:
        return {"when": choice.when and self._changed(choice.when), "reset": self._map(choice.reset)}


def _each(parts: Iterable[Part], changes: Callable[[Part], Mapping[str, Any]]) -> tuple[Part, ...]:
    """Return copies of declarations with some fields changed."""
    return tuple(replace(part, **changes(part)) for part in parts)
