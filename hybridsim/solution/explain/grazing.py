"""This module describes a near-grazing: a guard that came close to zero without reaching it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.series.bounded import UNIT
from hybridsim.solution.explain.candidate import views

if TYPE_CHECKING:
    from hybridsim.engine.record.segments import Occurrence
    from hybridsim.solution.explain.candidate import GuardView
    from hybridsim.solution.solution import Solution


def grazed(solution: Solution, occurrence: Occurrence) -> tuple[GuardView, ...]:
    """Return the near-grazing guard with its derivatives at the nearest point, if states were saved."""
    if solution._save != "all":
        return ()
    system, x = solution._system, occurrence.x_minus
    c = next(k for k, a in enumerate(system.automata) if a.name == occurrence.component)
    automaton = system.automata[c]
    last = int(np.searchsorted(solution._of_model.frame.starts, float(occurrence.instant), side="right"))
    for k in range(last - 1, max(last - 4, -1), -1):
        segment = solution._segments[k]
        mode = int(segment.z[c])
        if automaton.modes[mode] != occurrence.source:
            continue
        s = occurrence.instant.minus(segment.origin)
        error = 4.0 * UNIT * np.maximum(np.abs(segment.x).max(axis=0), np.abs(x))
        at = Situation(s, x.copy(), segment.p, segment.z, error, abs(s) * UNIT)
        guard = automaton.guards[mode][automaton.guard_names[mode].index(occurrence.guard)]
        return tuple(views(system, at, segment.z, [guard], np.zeros(system.guard_count, int)))
    return ()
