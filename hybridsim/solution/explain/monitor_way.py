"""This module describes how a monitor left zero, or crossed zero."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after
from hybridsim.engine.series.bounded import UNIT

if TYPE_CHECKING:
    from hybridsim.engine.record.segments import Occurrence
    from hybridsim.solution.event import Event
    from hybridsim.solution.solution import Solution


def way_of_monitor(solution: Solution, event: Event, occurrence: Occurrence) -> str:
    """Describe how a monitor passed or reached zero when it fired."""
    way, side = ("rose", "below") if event.direction > 0 else ("fell", "above")
    after = _side_after(solution, occurrence) if solution._save == "all" else None
    if after is None:
        return f"left its side {side} zero"
    if after == event.direction:
        return f"{way} through zero"
    if after == 0:
        return f"came to zero from {side} and stays there"
    return f"came to zero from {side}, and a reset carries it back"


def _side_after(solution: Solution, occurrence: Occurrence) -> int | None:
    """Return the side of a monitor just after an instant, or None if the motion after the instant is unknown."""
    last = int(np.searchsorted(solution._of_model.frame.starts, float(occurrence.instant), side="right")) - 1
    if last < 0:
        return None
    system, segment = solution._system, solution._segments[last]
    s, x = occurrence.instant.minus(segment.origin), occurrence.x_plus
    error = 4.0 * UNIT * np.maximum(np.abs(segment.x).max(axis=0), np.abs(x))
    held = system.evaluated(segment.z)
    error[held] = UNIT * np.abs(x[held])
    s_error = 2.0 * math.ulp(s)
    if system.n:
        error += s_error * np.abs(system.flow(s, x, segment.p, segment.z))
    series = system.series(s, x, segment.p, segment.z, error, s_error)
    k = system.monitor_names.index(occurrence.component)
    value, bound = series.monitors[k], series.monitor_bounds[k]
    return side_after(value, bound, 1 if abs(value[0]) <= 4.0 * bound[0] else 0)[0]
