"""A frictional contact: relative velocity, normal load and a law become the modes slip+, slip- and stick."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from hybridsim.errors import ModelError, nearest
from hybridsim.expr import Expression, parse, substitute
from hybridsim.expr.evaluate import dependency_order
from hybridsim.model.component import Component, Guard, Mode, Surface
from hybridsim.model.declared import Declared
from hybridsim.model.frozen_map import FrozenMap
from hybridsim.model.law import NORMAL, SPEED, FrictionLaw


@dataclass(frozen=True)
class Contact(Declared):
    """Dry friction between two bodies; its name is the friction force, which opposes the relative velocity.

    A positive force opposes a positive relative velocity: a body that slides with v has ``- f`` in its
    equation.

    Parameters
    ----------
    velocity : relative velocity, an expression of states, inputs, parameters and t.
    normal : normal load, >= 0. Where it can vary, a guard ends the run should it become negative.
    law : a `FrictionLaw`, or the name of one that comes with the package.
    arguments : law parameter to number or expression over the model's names; what is not given has the law's
        default.

    Examples
    --------
    >>> Contact("f", velocity="v", normal="N", law="coulomb", arguments={"mu": 0.5}).component().modes[0].set
    {'f': Expression(text='0.5*N')}
    """

    name: str
    velocity: Expression
    normal: Expression
    law: FrictionLaw
    arguments: Mapping[str, Expression] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("velocity", "normal")
        self._maps("arguments")
        law: object = self.law
        if isinstance(law, str):
            from hybridsim.model.library import load_law

            object.__setattr__(self, "law", load_law(law))
        elif not isinstance(law, FrictionLaw):
            raise self._fault(f"law is {law!r}", "give hs.FrictionLaw(...), or the name of a law")

    def component(self, constants: Collection[str] = ()) -> Component:
        """The automaton: three modes on the surface velocity = 0.

            slip+ : velocity >= 0,  f = +slip(v = velocity)
            slip- : velocity <= 0,  f = -slip(v = -velocity)
            stick : velocity = 0,   -stick <= f <= stick,  f solved for

        Parameters
        ----------
        constants : names known to be constant (the model's parameters); a normal load that uses any other
            name gets a guard in every mode.

        Errors
        ------
        ModelError for an argument that the law does not have, or one that is missing.
        """
        varies = bool(self.normal.names - set(constants))
        if varies not in self._expanded:
            self._expanded[varies] = self._component(varies)
        return self._expanded[varies]

    @cached_property
    def _expanded(self) -> dict[bool, Component]:
        """What `component` has found: copies of a model with other values have the same contacts."""
        return {}

    def _component(self, varies: bool) -> Component:
        force = parse(self.name, self.place)
        backward = self._form("-v", v=self.velocity)
        forward_slip = self.slip_force(self.velocity)
        backward_slip = self._form("-f", f=self.slip_force(backward))
        at_rest, limit = self.onset_force, self.limit_force
        loaded: tuple[Guard, ...] = ()
        if varies:
            message = f"normal load of contact {self.name} became negative: {self.normal.text} < 0"
            loaded = (Guard("normal", self.normal, fatal=message, place=self.place),)
        upper = self._form("limit - f", limit=limit, f=force)
        lower = self._form("limit + f", limit=limit, f=force)
        modes = (
            Mode("slip+", (Guard("velocity", self.velocity), *loaded), set={self.name: forward_slip}),
            Mode("slip-", (Guard("velocity", backward), *loaded), set={self.name: backward_slip}),
            Mode("stick", (Guard("upper", upper), Guard("lower", lower), *loaded)),
        )
        surface = Surface(
            function=self.velocity,
            unknown=self.name,
            above="slip+",
            below="slip-",
            hold="stick",
            jump_above=self._form("limit - slip", limit=limit, slip=at_rest),
            jump_below=self._form("slip - limit", limit=limit, slip=at_rest),
        )
        return Component(self.name, modes, surface=surface, place=self.place)

    @cached_property
    def onset_force(self) -> Expression:
        """Magnitude of the force at the onset of slip, over the model's names."""
        return self.slip_force(parse(0))

    def slip_force(self, speed: Expression) -> Expression:
        """Magnitude of the force when sliding at a speed >= 0, over the model's names."""
        return substitute(self._form("slip", slip=self.law.slip), {SPEED: speed, **self._values()})

    @cached_property
    def limit_force(self) -> Expression:
        """The most that stick can carry, over the model's names."""
        return substitute(self._form("stick", stick=self.law.stick), self._values())

    def _form(self, template: str, **parts: Expression) -> Expression:
        """An expression built from parts, placed where the contact stands."""
        return substitute(parse(template, self.velocity.place or self.place), parts)

    def _values(self) -> dict[str, Expression]:
        """Normal load and law parameters as expressions over the model's names."""
        law = self.law
        for name, value in self.arguments.items():
            if name not in law.parameters:
                raise ModelError(
                    f"contact {self.name}: the law '{law.name}' has no parameter '{name}'",
                    place=value.place or self.place,
                    remedy=nearest(name, law.parameters, kind="parameters of the law"),
                )
        own = {**law.parameters, **self.arguments}
        missing = [name for name, value in own.items() if value is None]
        if missing:
            raise self.error(
                f"contact {self.name}: the law '{law.name}' needs a value for '{missing[0]}'",
                f'write law = {{ name = "{law.name}", {missing[0]} = ... }}.',
            )
        defaults = {
            name: value for name, value in law.parameters.items() if name not in self.arguments and value
        }
        values: dict[str, Expression] = dict(self.arguments)
        for name in dependency_order(defaults, f"defaults of the law '{law.name}'"):
            values[name] = substitute(defaults[name], values)
        return {NORMAL: self.normal, **values}
