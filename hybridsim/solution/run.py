"""This module defines a prepared run: the model, the integrator, the task and the form of the solution."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hybridsim.engine.native.kernels import seconds_compiling
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.run.single_call import LazyTrajectory
from hybridsim.engine.system.system import System
from hybridsim.engine.system.user_functions.code import PythonCode
from hybridsim.errors import RunInterrupted
from hybridsim.integrators.contract import Integrator
from hybridsim.model import Model
from hybridsim.model.checks.denominators import denominators
from hybridsim.model.checks.doubtful import jumps_of
from hybridsim.solution.model_trajectory import ModelTrajectory
from hybridsim.solution.poles import end_at_pole, passed_unseen
from hybridsim.solution.solution import Solution


@dataclass(frozen=True)
class Run:
    """A prepared run, which `hybridsim.simulate` makes from its arguments.

    Parameters
    ----------
    grid : the times at which the solution is given; None for the integrator's own steps.
    save : the requested retention, as in `simulate`.
    reason : why "auto" chose this method.
    """

    model: Model
    system: System
    method: Integrator
    task: Task
    grid: np.ndarray | None = None
    save: str | float = "all"
    reason: str = ""

    def on_grid(self, grid: np.ndarray | None) -> Run:
        """Return the same run with its solution at other times."""
        if grid is self.grid:
            return self
        return Run(self.model, self.system, self.method, self.task, grid, self.save, self.reason)

    def carried_out(
        self, progress: Callable[[float], None] | None, compile_time: float = 0.0, before: float = 0.0
    ) -> Solution:
        """Carry out the run and return its solution; `compile_time` and `before` are seconds spent earlier."""
        began, compiled = time.perf_counter(), seconds_compiling()
        trajectory = self.method.run(self.system, self.task, progress)
        within = seconds_compiling() - compiled  # compile time of kernels that were first needed in this run
        wall_time = time.perf_counter() - began - within
        if isinstance(trajectory, LazyTrajectory):
            trajectory.then(self._close)
            if denominators(self.model):
                trajectory.whole()
        else:
            self._close(trajectory)
        run = self
        # The solution keeps only what the run left, not its start.
        if self.task.record is not None:
            run = replace(self, task=replace(self.task, record=None))
        solution = Solution(ModelTrajectory(run, trajectory, before + wall_time, compile_time + within))
        # A compiled loop that took the run from start to end was not interrupted.
        if not isinstance(trajectory, LazyTrajectory) and trajectory.status == "interrupted":
            raise RunInterrupted(solution)
        return solution

    def _close(self, trajectory: Trajectory) -> None:
        """Add the warnings of the run, and drop data that `save` excludes."""
        if isinstance(self.system.code, PythonCode):
            self.system.code.report(trajectory)
        for caution in jumps_of(self.model):
            trajectory.warnings[caution.sentence] = 1
        end_at_pole(self.system, trajectory)
        for sentence in passed_unseen(self.system, trajectory, self.task.x0, self.task.t0):
            trajectory.warn(sentence)
        if self.task.t0 == self.task.t1:
            trajectory.warn(f"`t_span` begins and ends at {self.task.t0!r}, so nothing was integrated")
        trajectory.close(self.task.retention)
