"""Whether an input's jump carries a surface away from where it was: what was held on it is held no longer."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.outcome import Situation
from hybridsim.engine.system import Series, System
from hybridsim.engine.timepair import Instant


def surfaces_jump(system: System, instant: Instant, at: Situation, forward: bool) -> bool:
    """Whether the values of surfaces differ, beyond rounding, before and after the inputs' pieces change."""
    if not (system.signals and system.surface_of):
        return False
    before = system.vector(instant, system.discrete(at.p), not forward)
    values, bounds = [], []
    for p in (before, at.p.copy()):
        p[system.layout.pin_at] = 0.0
        series = system.series(0.0, at.x, p, np.maximum(at.z, 0), np.zeros(system.n), 0.0)
        assert isinstance(series, Series)  # models with surfaces are made from expressions
        values.append(series.surfaces[:, 0])
        bounds.append(series.surface_bounds[:, 0])
    return bool((np.abs(values[1] - values[0]) > bounds[0] + bounds[1]).any())
