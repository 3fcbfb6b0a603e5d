"""This module gives a mechanical system the named parameters and states that a sweep needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from hybridsim.arguments import cannot_be, chosen_model
from hybridsim.engine.system.system_cache import system_of
from hybridsim.expr import Expression, evaluate, parse, resolve
from hybridsim.mechanics.declaration.named_values import values_of, with_values
from hybridsim.mechanics.declaration.system import MechanicalContact, MechanicalSystem
from hybridsim.model import Model
from hybridsim.model.checks.units import units_of
from hybridsim.solution.run_trajectory import relative_velocity


class Named(NamedTuple):
    """The name and the value of a parameter or a state; the unit is not known."""

    name: str
    value: Expression
    unit: str = ""


@dataclass(frozen=True)
class SweptSystem:
    """A mechanical system with the attributes of a `Model` that a sweep reads."""

    system: MechanicalSystem
    discrete = inputs = impacts = ()
    flow = True  # as a model of Python functions, it has no text

    @property
    def name(self) -> str:
        """The name of the system."""
        return self.system.name

    @property
    def contacts(self) -> tuple[MechanicalContact, ...]:
        """The contacts of the system."""
        return self.system.contacts

    @cached_property
    def parameters(self) -> tuple[Named, ...]:
        """The named values of the system; see `values_of`."""
        return tuple(Named(name, parse(value)) for name, value in values_of(self.system).items())

    @cached_property
    def states(self) -> tuple[Named, ...]:
        """The positions, then the velocities, with their initial values."""
        return tuple(Named(name, parse(value)) for name, value in self.start_values().items())

    @property
    def quantities(self) -> tuple[str, ...]:
        """The names of states, friction forces and relative velocities."""
        contacts = [contact.name for contact in self.contacts]
        return (*self.system.names, *self.system.velocities, *contacts, *map(relative_velocity, contacts))

    @property
    def modes(self) -> list[str]:
        """The names of all modes, such as "f.slip+"."""
        return [f"{contact.name}.{mode}" for contact in self.contacts for mode in ("stick", "slip+", "slip-")]

    def parameter_values(self) -> dict[str, float]:
        """Return the named values."""
        return values_of(self.system)

    def start_values(self) -> dict[str, float]:
        """Return the initial values of the states."""
        names = (*self.system.names, *self.system.velocities)
        return dict(zip(names, [*self.system.q0.tolist(), *self.system.v0.tolist()], strict=True))

    def validate(self) -> SweptSystem:
        """Return the system, which was checked when it was declared."""
        return self

    def with_start(self, **changes: Any) -> SweptSystem:
        """Return a copy with other initial values."""
        known = {p.name: p.value for p in self.parameters}
        values = resolve(known)
        start = self.start_values() | {n: evaluate(parse(v), values) for n, v in changes.items()}
        q0, v0 = list(start.values())[: self.system.n], list(start.values())[self.system.n :]
        return SweptSystem(self.system.with_(q0=q0, v0=v0))

    def with_(self, **changes: Any) -> MechanicalSystem:
        """Return the system with some named values changed; a value may be an expression of other values."""
        known = {p.name: p.value for p in self.parameters}
        found = resolve(known | {name: parse(value) for name, value in changes.items()})
        return with_values(self.system, {name: found[name] for name in changes})


def model_to_sweep(model: Any, params: Any) -> Any:
    """Return a `Model`, or a `SweptSystem` for a `MechanicalSystem`, with parameter values from `params`."""
    if isinstance(model, MechanicalSystem):
        model = SweptSystem(model)
    if not isinstance(model, SweptSystem):
        return chosen_model(model, params)
    if params is None:
        return model
    if not isinstance(params, Mapping) or not all(isinstance(name, str) for name in params):
        raise cannot_be("params", params, "use a dict of names and values, such as {'omega': 2.0}")
    return SweptSystem(model.with_(**params))


def quantities_of(model: Any) -> list[str]:
    """Return the names of the quantities of a model or a structure that can be measured."""
    return list(model.quantities if isinstance(model, SweptSystem) else units_of(model))


def modes_of(model: Any) -> list[str]:
    """Return the names of all modes of a model or a structure, such as "f.slip+"."""
    if isinstance(model, SweptSystem):
        return model.modes
    return [f"{a.name}.{mode}" for a in system_of(model).declared for mode in a.modes]


def is_structure(model: object) -> bool:
    """Return whether a sweep's model is a `SweptSystem`."""
    return isinstance(model, SweptSystem)


def declared(model: Model | SweptSystem) -> Any:
    """Return the declared system: a `Model` or a `MechanicalSystem`."""
    return model.system if isinstance(model, SweptSystem) else model
