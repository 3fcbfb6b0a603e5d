"""This module finds modes that the state alone determines, such as the active branch of abs or a table interval."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hybridsim.engine.system.automaton import Automaton
    from hybridsim.engine.system.system import System


def modes_by_state(
    system: System, components: Iterable[int], s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray
) -> np.ndarray:
    """Return a copy of the modes `z` in which some components get the mode that is valid at `x`.

    A component on a border keeps its mode if that is one of the two; on a surface it holds if possible. An argument may
    have corners itself, so the modes are computed again until none changes.
    """
    z, row, numbers = z.copy(), np.ascontiguousarray(x)[None, :], tuple(components)

    def violated(c: int, mode: int) -> int | None:
        """Return the first guard of a mode that is negative at `x`, or None."""
        z[c] = mode
        values = system.rows("guards", system.guard_count, np.array([s]), row, p, z)[0]
        guards = system.automata[c].guards[mode]
        return next((k for k, number in enumerate(guards) if not values[number] >= 0.0), None)

    def on_surface(c: int, automaton: Automaton) -> int:
        """Return the mode of a surface: above, below, or holding if the holding mode is admissible."""
        above, below = violated(c, automaton.above) is None, violated(c, automaton.below) is None
        if above and below and violated(c, automaton.hold) is None:
            return automaton.hold
        return automaton.above if above else automaton.below

    def on_side(c: int, automaton: Automaton) -> int:
        """Return the mode of a corner or table at `x`, by a search from mode to neighbouring mode."""
        mode = int(z[c])
        for _ in automaton.modes:
            k = violated(c, mode)
            if k is None:
                break
            mode = automaton.targets[mode][k][0]
        return mode

    for _ in range(len(numbers) + 1):
        before = z.copy()
        for c in numbers:
            automaton = system.automata[c]
            z[c] = on_surface(c, automaton) if automaton.has_surface else on_side(c, automaton)
        if (z == before).all():
            break
    return z
