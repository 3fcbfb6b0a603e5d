"""Which components leave their holding mode by the guard that was located, and whether the motion goes on smoothly."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.system.system import System

_NONE = -1  # no located guard releases the component


class Releases:
    """The releases of one event; `before`: the modes that it found, -1 for what had none yet."""

    def __init__(self, system: System, before: np.ndarray) -> None:
        self.system, self.before = system, before
        # the first located guard of each: 0 releases above, 1 below
        self._by = [_NONE] * len(system.automata)

    def locate(self, located: set[int]) -> None:
        """Note the guards at which the event was located."""
        for c, automaton in enumerate(self.system.automata):
            held = automaton.has_surface and self.before[c] == automaton.hold
            guards = automaton.guards[automaton.hold] if held else ()
            self._by[c] = next((j for j, g in enumerate(guards) if g in located), _NONE)

    def has(self, c: int, z: np.ndarray) -> bool:
        """Whether c leaves its holding mode through the guard that was located for it."""
        hold = self.system.automata[c].hold
        if hold < 0 or self.before[c] != hold or z[c] == hold:
            return False
        return self._by[c] == self._side(c, z)

    def _side(self, c: int, z: np.ndarray) -> int:
        return 0 if z[c] == self.system.automata[c].above else 1

    def leave_unknowns(self, at: Situation, z: np.ndarray, components: Iterable[int]) -> bool:
        """Whether every change among some components leaves all unknowns as they were: a release without a jump."""
        is_corner = self.system.is_corner
        changed = [c for c in components if z[c] != self.before[c] and not is_corner[c]]
        if not changed:
            return True
        jumps = self.system.jumps(at.s, at.x, at.p, z)
        return all(self.has(c, z) and jumps[c][self._side(c, z)] == 0.0 for c in changed)
