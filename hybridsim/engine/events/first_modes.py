"""Find the modes in which conditions and resets are evaluated, and the components that certainly change their modes."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.events.corner_sides import sides_along
from hybridsim.engine.events.event_data import EventData
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.model.meanings import Meanings
from hybridsim.model.smoothing.one_sided import names_of

if TYPE_CHECKING:
    from hybridsim.engine.events.outcome import Situation
    from hybridsim.engine.system.system import System


_MAX_FLOWS = 3**4  # combinations of modes examined at most; each costs a Taylor series


def as_read_by_conditions(system: System, at: Situation, jumped: bool = False) -> Situation:
    """Return the state before an event for use in conditions and resets; the state is not projected.

    At a start some components have no mode yet. They are read in the mode of the side of their surface, or in the
    holding mode if they are at rest on it. At a start and after a jump no state is evaluated from a surface.
    """
    is_start = (at.z < 0).any()
    if not (is_start or jumped):
        return at
    z, p = at.z.copy(), at.p.copy()
    p[system.layout.pin_at] = 0.0
    if not is_start:
        return replace(at, p=p)
    series: Any = system.series(at.s, at.x, p, np.maximum(z, 0), at.x_error, at.s_error, at.is_put)
    for k, c in enumerate(system.surface_of):
        if z[c] >= 0:
            continue
        automaton = system.automata[c]
        value, rate = series.surfaces[k, :2]
        is_off, is_moving = np.abs((value, rate)) > series.surface_bounds[k, :2]
        if is_off and not automaton.is_unilateral:
            z[c] = automaton.above if value > 0.0 else automaton.below
        elif is_off or (is_moving and automaton.is_unilateral):
            z[c] = automaton.above
        else:
            z[c] = automaton.hold
    return replace(at, z=z, p=p)


def certainly_leaving(resolution: EventData) -> set[int]:
    """Return the components that leave their modes, whichever modes are chosen at the surfaces that are zero.

    The sides of their guards are set accordingly. If these surfaces have too many combinations of modes, only values of
    guards without forces are used.
    """
    system = resolution.system
    owners = [c for c in resolution.scope if not (system.has_surface[c] or c in system.led)]
    if not owners:
        return set()
    z, on = _modes_on_sides(resolution)
    modes = [range(len(system.automata[c].modes)) for c in on]
    if math.prod(map(len, modes)) > _MAX_FLOWS:
        free = _without_forces(system)
        negative = {g for g in _negative(resolution, owners, z, order=0) if free[g][z[system.owner[g]]]}
    else:
        negative = set()
        for number, chosen in enumerate(product(*modes)):
            z[on] = chosen
            found = _negative(resolution, owners, sides_along(resolution, z, resolution.at.x)[0])
            negative = negative & found if number else found
            if not negative:
                return set()
    for g in range(system.guard_count):
        if system.owner[g] in owners:
            resolution.sides[g] = -1 if g in negative else 1
    return {int(system.owner[g]) for g in negative}


def _modes_on_sides(resolution: EventData) -> tuple[np.ndarray, list[int]]:
    """Return the modes that follow from the signs of the surfaces, and the components whose surfaces are zero."""
    at, system = resolution.at, resolution.system
    p = at.p.copy()
    p[system.layout.pin_at] = 0.0
    z = np.maximum(at.z, 0)
    series: Any = system.series(at.s, at.x, p, z, at.x_error, at.s_error, at.is_put)
    values, bounds = series.surfaces[:, 0], series.surface_bounds[:, 0]
    on = []
    for k, c in enumerate(system.surface_of):
        automaton = system.automata[c]
        if abs(values[k]) <= bounds[k]:
            on.append(c)
        elif values[k] > 0.0 or not automaton.is_unilateral:
            z[c] = automaton.above if values[k] > 0.0 else automaton.below
    return z, on


def _negative(resolution: EventData, owners: list[int], z: np.ndarray, order: int = ORDER) -> set[int]:
    """Return the guards whose Taylor series, up to an order, show that they become negative in the modes `z`."""
    series = resolution.series_of(z)
    side_of = side_after if resolution.forward else side_before
    numbers = [g for c in owners for g in resolution.system.automata[c].guards[z[c]]]
    found = ((g, side_of(series.guards[g], series.guard_bounds[g], 0)) for g in numbers)
    return {g for g, (side, place) in found if side < 0 and place <= order}


@per_structure
def _without_forces(system: System) -> list[list[bool]]:
    """Return for each guard and mode whether the guard is independent of all surface forces."""
    meanings, components = Meanings(system.model), system.model.all_components()
    found: list[list[bool]] = [[] for _ in range(system.guard_count)]
    for automaton, component in zip(system.automata, components, strict=True):
        for guards, mode in zip(automaton.guards, component.modes, strict=True):
            for g in {g for numbers in automaton.guards for g in numbers}:
                own = [guard for number, guard in zip(guards, mode.guards, strict=True) if number == g]
                found[g].append(all(not names_of(guard.expr.tree) & meanings.forced for guard in own))
    return found
