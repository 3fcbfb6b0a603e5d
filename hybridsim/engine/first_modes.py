"""Which modes hold before surfaces are decided: those in which resets read a start, automata that leave in any case."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.model.meanings import Meanings
from hybridsim.model.one_sided import names_of

if TYPE_CHECKING:
    from hybridsim.engine.outcome import Situation
    from hybridsim.engine.settle import Settling
    from hybridsim.engine.system import System


def as_given(system: System, at: Situation) -> Situation:
    """A situation with the modes and the run-time vector in which conditions and resets read the state as it is.

    At a start some components have no mode yet. They are read on the side of their surface on which the state is, and
    as holding where it rests there. No state is evaluated from a surface.
    """
    if not (at.z < 0).any():
        return at
    z, p = at.z.copy(), at.p.copy()
    p[system.layout.pin_at] = 0.0
    series: Any = system.series(at.s, at.x, p, np.maximum(z, 0), at.x_error, at.s_error)
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


def certainly_leaving(settling: Settling) -> set[int]:
    """Automata with a negative guard that no force of a surface enters: they leave, whatever is decided there.

    Their guards have their sides from the values alone.
    """
    at, system = settling.at, settling.system
    free = system.code.shared("guards without forces", lambda: _without_forces(system))
    series = settling.series_of(np.maximum(at.z, 0))
    found = set()
    for c in settling.scope:
        if not free[c]:
            continue
        guards = system.automata[c].guards[at.z[c]]
        is_negative = [
            bool(is_free and series.guards[g, 0] < -series.guard_bounds[g, 0])
            for g, is_free in zip(guards, free[c][at.z[c]], strict=True)
        ]
        settling.sides[list(guards)] = np.where(is_negative, -1, 1)
        if any(is_negative):
            found.add(c)
    return found


def _without_forces(system: System) -> list[list[list[bool]]]:
    """For each declared automaton, mode and guard: whether no force of a surface enters it. Empty for others."""
    meanings = Meanings(system.model)
    found: list[list[list[bool]]] = []
    for automaton, component in zip(system.automata, system.model.all_components(), strict=True):
        is_other = automaton.has_surface or automaton.is_corner or automaton.is_load
        modes = () if is_other else component.modes
        found.append(
            [[not names_of(guard.expr.tree) & meanings.forced for guard in mode.guards] for mode in modes]
        )
    return found
