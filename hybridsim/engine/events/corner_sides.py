"""Choose the modes that the state alone determines, such as the active branch of abs or min, at an instant.

They are chosen just after the instant, before all other modes. They belong to corners (`abs`, `min`, a piece of a
table), to steps in time, and to the loads of contacts that open. A value beyond its error bound decides the side. At
zero, the first derivative along the flow that is beyond its own bound decides. Corners can be nested, and the flow
depends on the sides of other corners, so the sides are computed again until none changes. This ends, because the
derivative that decides a side is of a lower order than what the side changes, or belongs to an inner corner.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.events.event_data import EventData
from hybridsim.engine.events.input_jumps import gaps_jump
from hybridsim.engine.events.outcome import Change

if TYPE_CHECKING:
    from hybridsim.engine.system.automaton import Automaton

_ROUNDS_PER_MODE = 4  # orders of a series: each order settles at least one more component


def sides_along(
    resolution: EventData, z: np.ndarray, x: np.ndarray, has_flow: bool = True
) -> tuple[np.ndarray, dict[int, int]]:
    """Choose the modes of corners and loads from the motion; return all modes, and the guards that are exactly zero.

    A guard that was located at zero is zero on both sides, whatever rounding makes of its value. If rounding hides all
    its derivatives, both sides are equally good. Then the computed derivatives decide, because the computed motion
    follows them. With has_flow=False only values decide, because the modes of surfaces are not known yet.
    """
    system = resolution.system
    side_of = side_after if resolution.forward else side_before
    zero = {c: g for c in system.led for g in system.automata[c].guards[z[c]] if resolution.fired[g]}
    for _ in range(_ROUNDS_PER_MODE * sum(len(system.automata[c].modes) for c in system.led)):
        series = resolution.series_of(z, x)
        values, bounds, after = series.guards, series.guard_bounds, z
        for c in system.led:
            automaton, mode = system.automata[c], int(z[c])
            for j, g in enumerate(automaton.guards[mode]):
                is_zero = zero.get(c) == g
                side, order = side_of(values[g], bounds[g], int(is_zero))
                if side == 0 and is_zero:
                    side, order = side_of(values[g], np.zeros_like(bounds[g]), 1)
                if side >= 0 or not (has_flow or order == 0):
                    continue
                target = automaton.targets[mode][j][0]
                after = z.copy() if after is z else after
                after[c] = target
                if is_zero:
                    zero[c] = _way_back(automaton, target, mode)
                break
        if after is z:
            break
        z = after
    return z, zero


def _way_back(automaton: Automaton, mode: int, to: int) -> int:
    """Return the guard of `mode` whose transition leads to the mode `to`."""
    ways = zip(automaton.guards[mode], automaton.targets[mode], strict=True)
    return next(g for g, targets in ways if to in targets)


def take_corners(resolution: EventData) -> bool:
    """Set the modes of corners, such as abs or min, and of loads at an event; return whether any mode changed."""
    at, system = resolution.at, resolution.system
    if not system.led:
        return False
    before = np.maximum(at.z, 0)
    z, zero = sides_along(resolution, before, at.x, bool((at.z >= 0).all()))
    changed = [c for c in system.led if z[c] != before[c]]
    for c in changed:
        automaton, mode = system.automata[c], int(before[c])
        resolution.fired[list(automaton.guards[mode])] = False
        resolution.changes.append(
            Change(c, automaton.guard_towards(mode, int(z[c])), mode, int(z[c]), at.x, at.x)
        )
        if automaton.is_corner:
            resolution.is_kinked = True
            if c in zero:  # it is still at zero, on the other side
                resolution.fired[zero[c]] = True
        resolution.jumped = resolution.jumped or not automaton.is_corner or automaton.is_step
    if changed:
        resolution.jumped = resolution.jumped or gaps_jump(system, at, before, z)
        at.z = at.z.copy()
        at.z[changed] = z[changed]
    return bool(changed)
