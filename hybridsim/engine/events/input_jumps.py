"""Detect whether the value of a surface jumps at an event, so that its component is released.

Inputs, discrete states and corners such as `sign` can jump. For a closed gap the rate counts as well: a floor that
jumps in speed strikes the body on it, or leaves it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

_JOINED = 3.0  # ulps within which times count as equal, as in `hybridsim.engine.system.timetable`


def surfaces_jump(system: System, instant: Instant, at: Situation, forward: bool) -> bool:
    """Return whether values of surfaces, or rates of closed gaps, jump because inputs jump at an instant.

    Times that are equal within rounding count as one, at the last of them. The pieces before are those before all of
    them.
    """
    if not (system.signals and system.surface_of):
        return False
    joined = _JOINED * math.ulp(max(abs(float(instant)), math.ulp(1.0)))
    earlier = instant.plus(-joined if forward else joined)
    before = system.vector(earlier, system.discrete(at.p), not forward)
    return vectors_jump(system, at, before, joined)


def vectors_jump(system: System, at: Situation, before: np.ndarray, s_error: float = 0.0) -> bool:
    """Return whether values of surfaces, or rates of closed gaps, jump because inputs or discrete states jump."""
    z = np.maximum(at.z, 0)
    return bool(system.surface_of) and _differ(system, at, ((before, z), (at.p.copy(), z)), s_error)


def gaps_jump(system: System, at: Situation, before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether the rates of closed gaps jump because corners such as sign change their active branch."""
    closed = any(
        system.automata[c].is_unilateral and at.z[c] == system.automata[c].hold for c in system.surface_of
    )
    return closed and _differ(system, at, ((at.p.copy(), before), (at.p.copy(), after)))


def _differ(
    system: System, at: Situation, sides: Sequence[tuple[np.ndarray, np.ndarray]], s_error: float = 0.0
) -> bool:
    """Return whether surfaces or gap rates differ at one state for different run-time values and modes."""
    values, bounds = [], []
    for p, z in sides:
        p[system.layout.pin_at] = 0.0
        series = system.series(at.s, at.x, p, z, np.zeros(system.n), s_error)
        values.append(series.surfaces[:, :2])
        bounds.append(series.surface_bounds[:, :2])
    apart = np.abs(values[1] - values[0]) > bounds[0] + bounds[1]
    automata = [system.automata[c] for c in system.surface_of]
    held = [a.is_unilateral and at.z[c] == a.hold for c, a in zip(system.surface_of, automata, strict=True)]
    return bool(apart[:, 0].any() or apart[held, 1].any())
