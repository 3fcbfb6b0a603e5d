"""This module represents the components of a model by numbers of modes and guards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hybridsim.model.parts.component import Corner, LoadAutomaton, WholeNumber
from hybridsim.model.smoothing.jumps import SIGN

CORNER = "corner"  # kind of the event in which a corner changes its side
RESET = "reset"  # named in place of a guard if a reset or an impact changes the side of a contact


@dataclass(frozen=True)
class Automaton:
    """One component as the engine represents it, with numbers for modes and guards."""

    name: str
    modes: tuple[str, ...]
    guards: tuple[tuple[int, ...], ...]  # mode -> global numbers of its guards
    guard_names: tuple[tuple[str, ...], ...]
    targets: tuple[tuple[tuple[int, ...], ...], ...]  # mode, guard -> target modes of its choices
    fatal: tuple[tuple[str | None, ...], ...]
    above: int = -1
    below: int = -1
    hold: int = -1
    initial: int = -1
    is_unilateral: bool = False  # its surface is a gap: there is no mode below
    is_unique: bool = False  # a switching surface: one motion alone must be admissible
    is_corner: bool = False  # a corner: both modes agree at the border
    is_step: bool = False  # a corner whose sides may differ at the border: a step in time, or a whole number
    number: str = ""  # the discrete state that is the whole number of floor
    is_load: bool = False  # the load of a contact that opens
    limit: int = -1  # mode that is entered at the limit of its transitions

    @property
    def kind(self) -> str:
        """Return the kind of event that is recorded when the component changes its mode."""
        return CORNER if self.is_corner else "transition"

    @property
    def limit_mode(self) -> int:
        """Return the mode that the component takes when its events accumulate, or -1."""
        return self.hold if self.has_surface else self.limit

    @property
    def has_surface(self) -> bool:
        """Return whether the component has a surface, and a mode that holds it."""
        return self.hold >= 0

    def guard_towards(self, mode: int, target: int) -> str:
        """Return the name of the guard that leads from one mode to another, directly or through other modes."""
        for name, targets in zip(self.guard_names[mode], self.targets[mode], strict=True):
            if (targets[0] > mode) == (target > mode):
                return name
        return ""


def automaton_of(component: Any, guards: tuple[tuple[int, ...], ...]) -> Automaton:
    """Return a component of a model as the engine represents it."""
    names = tuple(m.name for m in component.modes)
    surface = component.surface
    number = component.number if isinstance(component, WholeNumber) else ""
    return Automaton(
        component.name,
        names,
        guards,
        tuple(tuple(g.name for g in m.guards) for m in component.modes),
        tuple(tuple(tuple(names.index(c.to) for c in g.then) for g in m.guards) for m in component.modes),
        tuple(tuple(g.fatal for g in m.guards) for m in component.modes),
        *(
            (
                names.index(surface.above),
                -1 if surface.below is None else names.index(surface.below),
                names.index(surface.hold),
            )
            if surface
            else (-1, -1, -1)
        ),
        initial=-1 if component.initial is None else names.index(component.initial),
        is_unilateral=bool(surface and surface.is_unilateral),
        is_unique=bool(surface and surface.unique),
        is_corner=isinstance(component, Corner),
        is_step=(isinstance(component, Corner) and any(v.startswith(SIGN) for v in component.variables))
        or number != "",
        number=number,
        is_load=isinstance(component, LoadAutomaton),
        limit=names.index(component.limit.to) if component.limit else -1,
    )
