"""Surfaces that are at zero within rounding although nothing was located there: what may leave with another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.outcome import Change

if TYPE_CHECKING:
    from hybridsim.engine.events.resolve import Settling


def at_zero(settling: Settling, cluster: tuple[int, ...]) -> set[int]:
    """Components of a cluster on their surfaces to rounding.

    A surface that stays at zero while another component holds its function still (a contact that sticks where a relay
    switches on the speed) is crossed by no step; it leaves when that component lets go.
    """
    system, at = settling.system, settling.at
    series = system.series(at.s, at.x, at.p, np.maximum(at.z, 0), at.x_error, at.s_error, at.is_put)
    near = np.abs(series.surfaces[:, 0]) <= series.surface_bounds[:, 0]
    return {c for k, c in enumerate(system.surface_of) if near[k]} & set(cluster)


def past_zero(settling: Settling, cluster: tuple[int, ...]) -> set[int]:
    """Components of a cluster past their surfaces, which nothing has crossed.

    A step that is taken once more, to end at an event, may end past a surface that it did not cross before, by its
    error: that was crossed first.
    """
    system, at = settling.system, settling.at
    series = system.series(at.s, at.x, at.p, np.maximum(at.z, 0), at.x_error, at.s_error, at.is_put)
    found = set()
    for c, value in zip(system.surface_of, series.surfaces[:, 0], strict=True):
        automaton, mode = system.automata[c], at.z[c]
        if automaton.is_unilateral:
            continue  # there is no other side of a gap
        if value < 0.0 if mode == automaton.above else value > 0.0 and mode == automaton.below:
            found.add(c)
    return found & set(cluster)


def cross(settling: Settling, components: set[int]) -> None:
    """Take components to the other side of their surfaces, before what was located."""
    at = settling.at
    settling.fired[:] = False
    for c in sorted(components):
        automaton, mode = settling.system.automata[c], int(at.z[c])
        at.z[c] = automaton.below if mode == automaton.above else automaton.above
        name = automaton.guard_names[mode][0]
        settling.changes.append(Change(c, name, mode, int(at.z[c]), at.x, at.x))
