"""What a run works out before its first instant: the same each time that its task is carried out, so kept with it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.start import settled_start
from hybridsim.engine.run.desk import Laid, laid_out
from hybridsim.engine.run.standing import Standing
from hybridsim.engine.system.instant import Instant

if TYPE_CHECKING:
    from hybridsim.engine.events.outcome import Outcome
    from hybridsim.engine.record.trajectory import Task
    from hybridsim.engine.run.stepping import Leaps, Method
    from hybridsim.engine.system.system import System

# Local time rounds angles that grow in time, by 1e-13 after this many turns: a stretch without events begins anew then.
_TURNS = 100


class Plan:
    """Of a task for a system by a method; it is kept with the task, and so does not hold it."""

    def __init__(self, system: System, method: Method, task: Task) -> None:
        self.system, self.method = system, method
        self.origin, self.end = Instant(task.t0), Instant(task.t1)
        self.renewal = _TURNS * 2.0 * math.pi / system.fastest if system.fastest else math.inf
        self._pattern = self._leaper(task)
        self.begins_silently = False  # known after `start`: nothing is to be recorded there
        self._start: tuple[Outcome, np.ndarray] | None = None
        self._laid: Laid | None = None  # the same

    def _leaper(self, task: Task) -> Leaps | None:
        """The compiled loop, where method and model allow it."""
        system, model = self.system, self.system.model
        if not self.method.leaps or not task.forward or system.n == 0 or model.monitors or model.inputs:
            return None
        return self.method.leaper(system, task.tolerances, self.renewal)

    def leaper(self) -> Leaps | None:
        """A compiled loop for one run; None where there is none."""
        return None if self._pattern is None else self._pattern.anew()

    @property
    def silent_start(self) -> Laid | None:
        """What holds at the start, which nobody may change; known from the second run on.

        None where something is to be recorded there, or at times known beforehand, or where there is no compiled loop.
        """
        system = self.system
        is_free = self._pattern is not None and not system.model.schedules and not system.signals
        if self._laid is None and is_free and self.begins_silently and self._start is not None:
            self._laid = laid_out(*self._start)
        return self._laid

    def start(self, task: Task, due: tuple[int, ...]) -> Standing:
        """What holds just after the start of its task, the schedules due then applied."""
        system, forward = self.system, task.forward
        if self._start is None:
            outcome = settled_start(system, task, self.origin, due)
            self._start = outcome, system.vector(self.origin, system.discrete(outcome.p), forward)
            told = due or outcome.changes or outcome.warnings or outcome.status or system.monitor_names
            self.begins_silently = forward and not told
        return Standing(system, self.origin, forward, self._start[0].copy, self._start)


def plan_of(system: System, method: Method, task: Task) -> Plan:
    """The plan that is kept with a task, made where there is none."""
    plan = task.plans.get("last")
    if plan is None or plan.system is not system or plan.method is not method:
        plan = task.plans["last"] = Plan(system, method, task)
    return plan
