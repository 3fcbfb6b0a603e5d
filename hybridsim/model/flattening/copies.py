"""This module copies the declarations of a part with the names that they have in the whole model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from hybridsim.errors import Place
from hybridsim.expr import Expression
from hybridsim.model.elements.requirement import Requirement
from hybridsim.model.flattening.prefix import prefixed
from hybridsim.model.parts.component import Choice, Component, Mode, Surface
from hybridsim.model.parts.contact import Contact
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.impact import SPEED, Impact
from hybridsim.model.parts.inputs import Input
from hybridsim.model.parts.monitor import Monitor
from hybridsim.model.parts.quantities import Discrete, Output, Parameter, State
from hybridsim.model.parts.schedule import Schedule
from hybridsim.model.parts.shape import Shape
from hybridsim.model.parts.switching import SwitchingSurface

Part = TypeVar("Part", bound=Declared)


class Copies:
    """Copies declarations of one part: every name gets the prefix, and every place names the part."""

    def __init__(self, prefix: str, use: str) -> None:
        self.prefix = prefix
        self.use = use
        self._by_kind: Mapping[type, Callable[[Any], dict[str, Any]]] = {
            Parameter: lambda p: {"value": self.expr(p.value)},
            State: lambda s: {"start": self.expr(s.start), "der": self.expr(s.der)},
            Discrete: lambda d: {"start": self.expr(d.start)},
            Input: lambda i: {name: self.expr(value) for name, value in i.expressions.items()},
            Contact: self._contact,
            SwitchingSurface: lambda s: {
                "expr": self.expr(s.expr),
                "above": self.named(s.above),
                "below": self.named(s.below),
            },
            Impact: lambda i: {"gap": self.expr(i.gap), "restitution": self.expr(i.restitution, SPEED)},
            Component: self._component,
            Monitor: lambda m: {"expr": self.expr(m.expr), "reset": self.named(m.reset)},
            Schedule: self._schedule,
            Shape: self._shape,
            Requirement: lambda r: {"low": self.expr(r.low), "high": self.expr(r.high)},
            Output: lambda o: {"expr": self.expr(o.expr), "modes": self.named(o.modes)},
        }

    def of(self, part: Part) -> Part:
        """Return the copy of a named declaration."""
        kind = next(kind for kind in type(part).__mro__ if kind in self._by_kind)
        changed = {"name": self.prefix + vars(part)["name"], "place": self.place(part)}
        return replace(part, **changed, **self._by_kind[kind](part))

    def place(self, part: Declared) -> Place:
        """Return the place of a declaration as seen from the whole model."""
        return (part.place or Place()).inside(self.use)

    def expr(self, expr: Expression, *own: str) -> Expression:
        """Return an expression with names of the whole model, except for names that the expression defines itself."""
        return prefixed(expr, self.prefix, self.use, own)

    def named(self, values: Mapping[str, Expression]) -> dict[str, Expression]:
        """Return a dict from names of quantities in the whole model to expressions."""
        return {self.prefix + name: self.expr(value) for name, value in values.items()}

    def _contact(self, contact: Contact) -> dict[str, Any]:
        return {
            "velocity": self.expr(contact.velocity),
            "normal": self.expr(contact.normal),
            "arguments": {name: self.expr(value) for name, value in contact.arguments.items()},
            "start": {name: self.expr(value) for name, value in contact.start.items()},
        }

    def _shape(self, shape: Shape) -> dict[str, Any]:
        return {field: self._shown(getattr(shape, field)) for field in shape.fields() if field != "text"}

    def _shown(self, value: Any) -> Any:
        """Return a field of a shape: an expression, a name of another shape, or several of these."""
        if isinstance(value, Expression):
            return self.expr(value)
        return self.prefix + value if isinstance(value, str) else tuple(map(self._shown, value))

    def _schedule(self, schedule: Schedule) -> dict[str, Any]:
        return {
            "times": tuple(map(self.expr, schedule.times)),
            "start": schedule.start and self.expr(schedule.start),
            "period": schedule.period and self.expr(schedule.period),
            "reset": self.named(schedule.reset),
        }

    def _component(self, component: Component) -> dict[str, Any]:
        return {
            "modes": tuple(map(self._mode, component.modes)),
            "surface": component.surface and self._surface(component.surface),
            "limit": component.limit and self._choice(component.limit),
        }

    def _mode(self, mode: Mode) -> Mode:
        guards = tuple(
            replace(
                guard,
                expr=self.expr(guard.expr),
                then=tuple(map(self._choice, guard.then)),
                place=self.place(guard),
            )
            for guard in mode.guards
        )
        der, values = self.named(mode.der), self.named(mode.set)
        return replace(mode, guards=guards, der=der, set=values, place=self.place(mode))

    def _choice(self, choice: Choice) -> Choice:
        when = choice.when and self.expr(choice.when)
        return replace(choice, when=when, reset=self.named(choice.reset), place=self.place(choice))

    def _surface(self, surface: Surface) -> Surface:
        restitution = surface.restitution
        return replace(
            surface,
            function=self.expr(surface.function),
            unknown=self.prefix + surface.unknown,
            jump_above=self.expr(surface.jump_above),
            jump_below=self.expr(surface.jump_below),
            restitution=None if restitution is None else self.expr(restitution, SPEED),
            place=self.place(surface),
        )
