"""This module changes held inputs at the instant of a checkpoint, and chooses the modes again."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.events.due_changes import apply_crossed
from hybridsim.engine.events.input_jumps import vectors_jump
from hybridsim.engine.events.monitor_sides import MonitorSides
from hybridsim.engine.events.outcome import Outcome, Situation
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.record.trajectory import Task
from hybridsim.engine.run.mode_loop import ModeLoop
from hybridsim.engine.run.stepping import Method
from hybridsim.engine.system.system import System


class InputChange(ModeLoop):
    """A run of zero duration, in which discrete values change at the instant of a checkpoint.

    Parameters
    ----------
    task : a task whose record has a checkpoint.
    discrete : the new values of all discrete states and held inputs.
    """

    def __init__(self, system: System, method: Method, task: Task, discrete: np.ndarray) -> None:
        super().__init__(system, method, task)
        self._discrete = discrete

    def _run(self) -> None:
        assert self.record.checkpoint is not None
        self._go_on_from(self.record.checkpoint)
        before, system = self.outcome, self.system
        monitors = MonitorSides.of(system.model.monitors, before.monitor_sides)
        outcome = apply_crossed(system, self.forward, self._changed(before), 0.0, monitors)
        if (
            not self._adopt(self.origin, outcome, before.x, (), monitors)
            or self.record.status == "terminated"
        ):
            self._mark(None)

    def _changed(self, before: Outcome) -> Outcome:
        """Return the state just after the change."""
        system, instant = self.system, self.origin
        p = system.vector(instant, self._discrete, self.forward)
        # zeros of an event at this instant are known to the roundoff of the time
        s_error = math.ulp(float(instant)) if before.orders.any() else math.ulp(0.0)
        at = Situation(0.0, before.x.copy(), p, before.z.copy(), before.x_error.copy(), s_error)
        resolution = EventResolution(system, at, at.z.copy(), self.forward)
        former = system.vector(instant, system.discrete(before.p), self.forward)
        resolution.jumped = vectors_jump(system, at, former)
        return resolution.run((), ())
