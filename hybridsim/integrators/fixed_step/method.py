"""This module defines the base class of fixed-step methods, with options for the step length."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.system.system import System
from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.fixed_step.march import March
from hybridsim.integrators.fixed_step.run import FixedStepRun
from hybridsim.integrators.fixed_step.step_length import fixed_step_length, refuse_longer


@dataclass(frozen=True)
class FixedStepMethod(Integrator):
    """A method whose step is an option, or the period of the forcing divided by an option."""

    steps_per_period: float = 1200.0
    period: float | None = None
    step: float | None = None

    @abstractmethod
    def march(self, system: System, task: Task, step: float) -> March:
        """Return the kernels of the method for one run."""

    def run(self, system: System, task: Task, progress: Callable[[float], None] | None = None) -> Trajectory:
        """Run a task with steps of fixed length."""
        step = fixed_step_length(system, self.step, self.period, self.steps_per_period, self.name)
        refuse_longer(step, task.tolerances.max_step, self.name)
        return FixedStepRun(system, task, self.march(system, task, step), progress).run()
