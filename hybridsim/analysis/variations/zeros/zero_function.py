"""This module describes a guard or surface that is zero with zero rate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybridsim.engine.system.system import System


class StaysZero(NamedTuple):
    """A function that is zero along a segment, which begins at time t.

    moves : mask (M,) of the directions that make it nonzero. z (C,) : the modes on its other side.
    """

    t: float
    name: str
    moves: np.ndarray
    z: np.ndarray


class ZeroFunction(NamedTuple):
    """A guard or surface of component `c` that is zero with zero rate, in the mode `here`.

    there : the mode on its other side. guard, back : numbers of the guards between the two modes; back is -1 if the
    component does not return. surface : number of the surface, or -1 for a guard. noted : mask (M,) of the directions
    that are described already. gone : mask (M,) of the directions that have left to the mode `there` for good.
    """

    name: str
    c: int
    here: int
    there: int
    noted: np.ndarray
    guard: int = -1
    back: int = -1
    surface: int = -1
    gone: np.ndarray | None = None

    def seen_from(self, mode: int) -> ZeroFunction | None:
        """Return the function with `here` as the given mode, or None if the function does not belong to this mode."""
        if mode == self.here:
            return self
        if mode != self.there or (self.surface < 0 and self.back < 0):
            return None
        return self._replace(here=self.there, there=self.here, guard=self.back, back=self.guard)


def are_alike(system: System, c: int, mode: int, other: int) -> bool:
    """Return whether two modes of a component set the same values, and neither has a guard that leads elsewhere."""
    modes = system.model.all_components()[c].modes
    one, two = modes[mode], modes[other]
    return (one.der, one.set) == (two.der, two.set) and len(one.guards) == 1 and not two.guards
