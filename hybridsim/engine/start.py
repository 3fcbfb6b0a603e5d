"""How a run starts: the modes and states that hold just after its first instant."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.outcome import Outcome, Situation
from hybridsim.engine.settle import Settling
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.trajectory import Task

_MOST = 64  # starts that a system remembers: runs that differ in method, tolerance or span often begin alike


def settled_start(system: System, task: Task, origin: Instant, due: tuple[int, ...]) -> Outcome:
    """What holds just after the start of the run, the schedules due then applied."""
    key = task.beginning
    known = system.starts.get(key)
    if known is None:
        p = system.vector(origin, task.discrete, task.forward)
        at = Situation(0.0, task.x0.copy(), p, task.z0.copy(), np.zeros(system.n), 0.0)
        resets = [("schedule", k) for k in due]
        known = Settling(system, at, task.z0.copy(), task.forward).run((), resets)
        # a corner has no side to change before it has found one
        known.changes = [change for change in known.changes if not system.is_corner[change.component]]
        if len(system.starts) >= _MOST:
            system.starts.clear()
        system.starts[key] = known
    return known
