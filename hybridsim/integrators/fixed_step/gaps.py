"""This module finds the signs of the gaps of unilateral contacts at a given state."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.system import System


def gaps(system: System, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> dict[int, tuple[int, bool]]:
    """Return the sign of each gap, and whether the rate of the gap is not zero.

    p : run-time vector with its pin off, so that the states are used unchanged.
    """
    series: Any = system.series(0.0, x, p, z, 4.0 * UNIT * np.abs(x), 0.0)
    values, bounds = series.surfaces, series.surface_bounds
    found = {}
    for k, c in enumerate(system.surface_of):
        if system.automata[c].is_unilateral:
            (gap, rate), (gap_bound, rate_bound) = values[k, :2].tolist(), bounds[k, :2].tolist()
            found[c] = (0 if abs(gap) <= gap_bound else 1 if gap > 0.0 else -1, abs(rate) > rate_bound)
    return found
