"""Find components that leave their holding mode at the located guard; test if the flow is continuous."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.system.system import System

_NO_GUARD = -1  # no located guard releases the component


class Releases:
    """The releases of one event. before: the modes at the event (C,), -1 for a component without a mode yet."""

    def __init__(self, system: System, before: np.ndarray) -> None:
        self.system, self.before = system, before
        # first located guard of each component: 0 releases to above, 1 to below
        self._by = [_NO_GUARD] * len(system.automata)

    def locate(self, located: set[int]) -> None:
        """Store the guards at which the event was located."""
        for c, automaton in enumerate(self.system.automata):
            held = automaton.has_surface and self.before[c] == automaton.hold
            guards = automaton.guards[automaton.hold] if held else ()
            self._by[c] = next((j for j, g in enumerate(guards) if g in located), _NO_GUARD)

    def has(self, c: int, z: np.ndarray) -> bool:
        """Return whether the located guard makes component c leave its holding mode."""
        hold = self.system.automata[c].hold
        if hold < 0 or self.before[c] != hold or z[c] == hold:
            return False
        return self._by[c] == self._side(c, z)

    def _side(self, c: int, z: np.ndarray) -> int:
        return 0 if z[c] == self.system.automata[c].above else 1

    def leave_unknowns(self, at: Situation, z: np.ndarray, components: Iterable[int]) -> bool:
        """Return whether every change among some components is a release without a jump of an unknown."""
        is_corner = self.system.is_corner
        changed = [c for c in components if z[c] != self.before[c] and not is_corner[c]]
        if not changed:
            return True
        jumps = self.system.jumps(at.s, at.x, at.p, z)
        return all(self.has(c, z) and jumps[c][self._side(c, z)] == 0.0 for c in changed)
