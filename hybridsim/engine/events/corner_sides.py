"""Choose the modes that the state alone determines, such as the active branch of abs or min, at an instant.

They are chosen just after the instant, before all other modes. They belong to corners (`abs`, `min`, a piece of a
table), to steps in time, and to the loads of contacts that open. A value beyond its error bound decides the side. At
zero, the first derivative along the flow that is beyond its own bound decides. Corners can be nested, and the flow
depends on the sides of other corners, so the sides are computed again until none changes. This ends, because the
derivative that decides a side is of a lower order than what the side changes, or belongs to an inner corner.

The whole numbers of `floor` are chosen with them. Away from whole values, the value decides. At a whole value, the
number is this value if the argument rises or rests, and the value minus 1 if the argument falls. If the argument falls
to a whole value and rests below it, the number is the value minus 1, too.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.events.event_data import EventData
from hybridsim.engine.events.input_jumps import gaps_jump
from hybridsim.engine.events.outcome import Change

if TYPE_CHECKING:
    from hybridsim.engine.series.short_series import Series
    from hybridsim.engine.system.automaton import Automaton

_FAR = 1e-6  # a guard of a whole number that is located at zero is nearer to zero than this
_ROUNDS_PER_MODE = 4  # orders of a series: each order settles at least one more component


def sides_along(
    resolution: EventData, z: np.ndarray, x: np.ndarray, has_flow: bool = True
) -> tuple[np.ndarray, dict[int, int]]:
    """Choose the modes of corners and loads from the motion; return all modes, and the guards that are exactly zero.

    A guard that was located at zero is zero on both sides, whatever rounding makes of its value. If rounding hides all
    its derivatives, both sides are equally good. Then the computed derivatives decide, because the computed motion
    follows them. With has_flow=False only values decide, because the modes of surfaces are not known yet. The run-time
    vector with the whole numbers that belong to these modes is stored in `resolution.vectors`.
    """
    system, p = resolution.system, resolution.at.p
    side_of = side_after if resolution.forward else side_before
    zero = {c: g for c in system.led for g in system.automata[c].guards[z[c]] if resolution.fired[g]}
    for number in range(_ROUNDS_PER_MODE * sum(len(system.automata[c].modes) for c in system.led)):
        series = resolution.series_of(z, x, p)
        values, bounds, after, vector = series.guards, series.guard_bounds, z, p
        for c in system.led:
            automaton, mode = system.automata[c], int(z[c])
            if c in system.numbers:
                if c in zero and abs(values[zero[c], 0]) > max(bounds[zero[c], 0], _FAR):
                    del zero[c]  # a jump of the state has passed the zero
                change = _change_of_number(resolution, series, c, zero.get(c), has_flow, number == 0)
                if change != 0.0:
                    vector = p.copy() if vector is p else vector
                    vector[system.numbers[c]] += change
                    if c in zero:  # at the other end of the interval
                        zero[c] = next(g for g in automaton.guards[mode] if g != zero[c])
                continue
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
        if after is z and vector is p:
            break
        z, p = after, vector
    if p is not resolution.at.p:
        resolution.vectors[z.tobytes()] = resolution.at.p, p
    else:
        resolution.vectors.pop(z.tobytes(), None)
    return z, zero


def _way_back(automaton: Automaton, mode: int, to: int) -> int:
    """Return the guard of `mode` whose transition leads to the mode `to`."""
    ways = zip(automaton.guards[mode], automaton.targets[mode], strict=True)
    return next(g for g, targets in ways if to in targets)


def _change_of_number(
    resolution: EventData,
    series: Series,
    c: int,
    zero: int | None,
    has_flow: bool = True,
    is_first: bool = False,
) -> float:
    """Return by how much the whole number of a component has to change, in the flow of the present number.

    zero : the guard of the component that was located at zero, or None. is_first : a whole value is tried first.
    """
    up, down = resolution.system.automata[c].guards[0]
    value, bound = series.guards[down, 0], series.guard_bounds[down, 0]  # of the argument minus the number
    if not math.isfinite(value):
        return 0.0
    nearest = float(np.rint(value)) if zero is None else float(zero == up)  # a whole value, minus the number
    if zero is None and abs(value - nearest) > bound:
        return float(math.floor(value))
    if nearest not in (0.0, 1.0):
        return nearest  # the flow there decides next
    if not has_flow:
        return 0.0
    if is_first and nearest == 1.0:
        return 1.0
    side_of = side_after if resolution.forward else side_before
    side, _ = side_of(series.guards[down], series.guard_bounds[down], 1)
    if side == 0:  # at rest, also just below a whole value to which the argument has fallen
        return 0.0
    return nearest if side > 0 else nearest - 1.0


def take_corners(resolution: EventData) -> bool:
    """Set the modes of corners and loads, and the whole numbers, at an event; return whether anything changed."""
    at, system = resolution.at, resolution.system
    if not system.led:
        return False
    before, vector = np.maximum(at.z, 0), at.p
    z, zero = sides_along(resolution, before, at.x, bool((at.z >= 0).all()))
    p = resolution.vectors.get(z.tobytes(), (None, vector))[1]
    moved = {c for c, place in system.numbers.items() if p[place] != vector[place]}
    changed = [c for c in system.led if z[c] != before[c] or c in moved]
    for c in changed:
        automaton, mode = system.automata[c], int(before[c])
        resolution.fired[list(automaton.guards[mode])] = False
        name = automaton.guard_towards(mode, int(z[c]))
        if c in moved:
            name = automaton.guard_names[mode][0 if p[system.numbers[c]] > vector[system.numbers[c]] else 1]
        resolution.changes.append(Change(c, name, mode, int(z[c]), at.x, at.x))
        if automaton.is_corner:
            resolution.is_kinked = True
            if c in zero:  # it is still at zero, on the other side
                resolution.fired[zero[c]] = True
        resolution.jumped = resolution.jumped or not automaton.is_corner or automaton.is_step
    if changed:
        resolution.jumped = resolution.jumped or gaps_jump(system, at, before, z)
        at.z, at.p = at.z.copy(), p
        at.z[changed] = z[changed]
    if moved:
        _release_jumped(resolution, (before, vector), (z, p))
    return bool(changed)


def _release_jumped(resolution: EventData, *ways: tuple[np.ndarray, np.ndarray]) -> None:
    """Forget that guards of other components were located at zero if a whole number moved them off zero.

    ways : modes and run-time vector before and after the change.
    """
    x, system = resolution.at.x, resolution.system
    first, last = (resolution.series_of(z, x, p) for z, p in ways)
    moved = np.abs(last.guards - first.guards)[:, 0] > (first.guard_bounds + last.guard_bounds)[:, 0]
    resolution.fired &= ~moved | np.isin(system.owner, system.led)


def message_on_numbers(resolution: EventData) -> str:
    """Return a message if a motion could begin on both sides of a whole value, otherwise an empty text."""
    at, system = resolution.at, resolution.system
    z = np.maximum(at.z, 0)
    for c, place in system.numbers.items():
        down = system.automata[c].guards[0][1]
        series = resolution.series_of(z, at.x, at.p)
        is_on = abs(series.guards[down, 0]) <= series.guard_bounds[down, 0] and not resolution.fired[down]
        if not is_on or side_after(series.guards[down], series.guard_bounds[down], 1)[0] <= 0:
            continue
        other = at.p.copy()
        other[place] -= 1.0
        below = resolution.series_of(z, at.x, other)
        if side_after(below.guards[down], below.guard_bounds[down], 1)[0] < 0:
            name, number = system.automata[c].name, at.p[place]
            return (
                f"the motion can begin with {name} = {number:g}, rising, and with {number - 1.0:g}, falling"
            )
    return ""
