"""Corners and automata of loads on the sides that hold just after an instant, before anything else is decided there.

Each is a component whose mode follows from the state alone: a corner (`abs`, `min`, a piece of a table), a step in
time, the load of a contact that opens. A value beyond its error bound decides the side. At zero the first derivative
along the flow decides that is beyond its own. Corners stand inside each other, and the flow depends on the sides of
others, so that the sides are taken again until none changes. This ends: what decides a side is of a lower order than
what the side changes, or stands further inside.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.events.input_jumps import gaps_jump
from hybridsim.engine.events.outcome import Change

if TYPE_CHECKING:
    from hybridsim.engine.events.resolve import Settling
    from hybridsim.engine.system.system import Automaton

_ROUNDS_PER_MODE = 4  # the orders of a series: each brings at least one more component to rest


def sides_along(
    settling: Settling, z: np.ndarray, x: np.ndarray, has_flow: bool = True
) -> tuple[np.ndarray, dict[int, int]]:
    """The modes z with each corner and load on its side along their flow, and the guards of these that are zero.

    The guard that was located at zero is zero on both sides of it, whatever rounding makes of its value. has_flow:
    False where values alone decide, as the modes of surfaces are still unknown.
    """
    system = settling.system
    side_of = side_after if settling.forward else side_before
    zero = {c: g for c in system.led for g in system.automata[c].guards[z[c]] if settling.fired[g]}
    for _ in range(_ROUNDS_PER_MODE * sum(len(system.automata[c].modes) for c in system.led)):
        series = settling.series_of(z, x)
        values, bounds, after = series.guards, series.guard_bounds, z
        for c in system.led:
            automaton, mode = system.automata[c], int(z[c])
            for j, g in enumerate(automaton.guards[mode]):
                is_zero = zero.get(c) == g
                side, order = side_of(values[g], bounds[g], int(is_zero))
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
    """The guard of a mode that leads back to the mode before."""
    ways = zip(automaton.guards[mode], automaton.targets[mode], strict=True)
    return next(g for g, targets in ways if to in targets)


def take_corners(settling: Settling) -> bool:
    """Bring the corners and loads of a settling to their sides; whether any changed."""
    at, system = settling.at, settling.system
    if not system.led:
        return False
    before = np.maximum(at.z, 0)
    z, zero = sides_along(settling, before, at.x, bool((at.z >= 0).all()))
    changed = [c for c in system.led if z[c] != before[c]]
    for c in changed:
        automaton, mode = system.automata[c], int(before[c])
        settling.fired[list(automaton.guards[mode])] = False
        settling.changes.append(
            Change(c, _guard_towards(automaton, mode, int(z[c])), mode, int(z[c]), at.x, at.x)
        )
        if automaton.is_corner:
            settling.is_kinked = True
            if c in zero:  # it is still at zero, on its other side
                settling.fired[zero[c]] = True
        settling.jumped = settling.jumped or not automaton.is_corner or automaton.is_step
    if changed:
        settling.jumped = settling.jumped or gaps_jump(system, at, before, z)
        at.z = at.z.copy()
        at.z[changed] = z[changed]
    return bool(changed)


def _guard_towards(automaton: Automaton, mode: int, target: int) -> str:
    """The name of the guard by which a mode is left for another, be it by those between them."""
    for name, targets in zip(automaton.guard_names[mode], automaton.targets[mode], strict=True):
        if (targets[0] > mode) == (target > mode):
            return name
    return ""
