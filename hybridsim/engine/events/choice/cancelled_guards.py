"""This module finds guards that reached zero but do not fire, because the modes of surfaces keep them non-negative.

A guard on the velocity of a contact reaches zero together with it, according to the motion before. If the contact then
sticks, the guard stays at zero. If an impact reverses the motion, the guard only touches zero.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace

from hybridsim.engine.events.choice.cluster_choice import ClusterChoice
from hybridsim.engine.events.choice.verdict import LEAVES
from hybridsim.engine.events.corner_sides import take_corners
from hybridsim.engine.events.jumps.impact import strike


def cancelled_by_surfaces(resolution: ClusterChoice, automata: set[int], surfaces: set[int]) -> set[int]:
    """Return the automata whose guards reached zero but do not fire, once the modes at surfaces are chosen."""
    ahead = copy(resolution)
    ahead.at = replace(resolution.at, z=resolution.at.z.copy())
    ahead.fired, ahead.on_surface = resolution.fired.copy(), resolution.on_surface.copy()
    ahead.sides, ahead.orders = resolution.sides.copy(), resolution.orders.copy()
    ahead.floors = resolution.floors.copy()
    ahead.changes, ahead.warnings, ahead.series = [], [], {}
    open_ = set(surfaces)
    if strike(ahead, open_) or ahead.choose_jointly(open_):
        return set()
    take_corners(ahead)
    return {c for c in automata if ahead.verdict(ahead.at.z, [c]) != LEAVES}
