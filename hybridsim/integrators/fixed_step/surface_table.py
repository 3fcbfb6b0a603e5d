"""This module lists the components with a surface as a table of numbers, which kernels read."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.system.system import System


def surface_table(system: System) -> np.ndarray:
    """Return the numbers of component, modes and guards for each component with a surface.

    The entries of a gap that do not exist are -1.
    """
    return np.array(
        [
            (c, a.above, a.below, a.hold, *((*a.guards[a.hold], -1)[:2]))
            for c, a in enumerate(system.automata)
            if a.has_surface
        ],
        dtype=np.int64,
    ).reshape(-1, 6)
