"""The set-up of a run before its first instant. It is stored with the task, because it is the same for each run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.events.start import settled_start
from hybridsim.engine.run.call_arrays import Laid, laid_out
from hybridsim.engine.run.lazy_state import Standing
from hybridsim.engine.system.instant import Instant

if TYPE_CHECKING:
    from hybridsim.engine.events.outcome import Outcome
    from hybridsim.engine.record.trajectory import Task
    from hybridsim.engine.run.stepping import Leaps, Method
    from hybridsim.engine.system.system import System

# Turns of the fastest angle after which a segment without events is restarted, because rounding then reaches 1e-13.
_TURNS = 100


class Plan:
    """The set-up shared by all runs of one task with one method. It is stored in the task and does not refer to it."""

    def __init__(self, system: System, method: Method, task: Task) -> None:
        self.system, self.method = system, method
        self.origin, self.end = Instant(task.t0), Instant(task.t1)
        self.renewal = _TURNS * 2.0 * math.pi / system.fastest if system.fastest else math.inf
        self._pattern = self._leaper(task)
        self.begins_silently = False  # set by `start`: whether nothing is recorded at the start
        self._start: tuple[Outcome, np.ndarray] | None = None
        self._laid: Laid | None = None  # the same in the layout of compiled loops

    def _leaper(self, task: Task) -> Leaps | None:
        """Return the compiled loop if method and model allow it, else None."""
        system, model = self.system, self.system.model
        if not self.method.leaps or not task.forward or system.n == 0 or model.monitors or model.inputs:
            return None
        return self.method.leaper(system, task.tolerances, self.renewal)

    def leaper(self) -> Leaps | None:
        """Return a compiled loop for one run, or None."""
        return None if self._pattern is None else self._pattern.anew()

    @property
    def silent_start(self) -> Laid | None:
        """Return the read-only state at the start if it causes no record, known from the second run on.

        The result is None if an event is recorded at the start, if there are schedules or input signals, or if there is
        no compiled loop.
        """
        system = self.system
        is_free = self._pattern is not None and not system.model.schedules and not system.signals
        if self._laid is None and is_free and self.begins_silently and self._start is not None:
            self._laid = laid_out(*self._start)
        return self._laid

    def start(self, task: Task, due: tuple[int, ...]) -> Standing:
        """Return the state just after the start of the task, with the schedules due then applied."""
        system, forward = self.system, task.forward
        if self._start is None:
            outcome = settled_start(system, task, self.origin, due)
            self._start = outcome, system.vector(self.origin, system.discrete(outcome.p), forward)
            told = due or outcome.changes or outcome.warnings or outcome.status or system.monitor_names
            self.begins_silently = forward and not told
        return Standing(system, self.origin, forward, self._start[0].copy, self._start)


def plan_of(system: System, method: Method, task: Task) -> Plan:
    """Return the set-up stored with a task, and create it if needed."""
    plan = task.plans.get("last")
    if plan is None or plan.system is not system or plan.method is not method:
        plan = task.plans["last"] = Plan(system, method, task)
    return plan
