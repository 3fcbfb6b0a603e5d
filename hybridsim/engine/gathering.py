"""Where crossings of several switching surfaces accumulate: from there on the motion slides along all of them."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.outcome import Change, Outcome, Situation
from hybridsim.engine.settle import Settling
from hybridsim.engine.system import System

_REACH = (
    2.0  # a surface this many times as far away as its rate leads in the time that is left is not the limit's
)


def gathered(system: System, outcome: Outcome, p: np.ndarray, left: float) -> Outcome | None:
    """What holds where the surfaces come together, which the motion reaches within `left`; None if it does not slide.

    The surfaces are those that their rates may bring to zero in that time. The state is put onto them, by less than the
    motion moves meanwhile; the decision is that of any event (`hybridsim.engine.settle`).
    """
    near = _within_reach(system, outcome, p, left)
    if len(near) < 2:
        return None
    z = outcome.z.copy()
    z[near] = [system.automata[c].hold for c in near]
    x = system.project(0.0, outcome.x, p, z)
    z[near] = -1  # no mode yet: the decision takes them as they are at a start
    at = Situation(0.0, x, p, z, outcome.x_error.copy(), 0.0)
    found = Settling(system, at, outcome.z.copy(), forward=True).run((), [])
    if found.status or any(found.z[c] != system.automata[c].hold for c in near):
        return None
    found.changes = [
        Change(c, "side", int(outcome.z[c]), int(found.z[c]), outcome.x, found.x) for c in near
    ] + found.changes
    found.continuous = False
    return found


def _within_reach(system: System, outcome: Outcome, p: np.ndarray, left: float) -> list[int]:
    series = system.series(0.0, outcome.x, p, outcome.z, outcome.x_error, 0.0)
    found = []
    for k, c in enumerate(system.surface_of):
        automaton = system.automata[c]
        if not automaton.is_unique or outcome.z[c] == automaton.hold:
            continue
        value, rate = series.surfaces[k, :2]
        if abs(value) <= _REACH * abs(rate) * left + series.surface_bounds[k, 0]:
            found.append(c)
    return found
