"""This module carries out a prepared run, and returns its solution."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from hybridsim.engine.native.compiler import seconds_compiling
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.run.single_call import LazyTrajectory
from hybridsim.engine.system.user_functions.code import PythonCode
from hybridsim.errors import RunInterrupted
from hybridsim.model.checks.denominators import denominators
from hybridsim.model.checks.doubtful import jumps_of, touches_of
from hybridsim.solution.model_trajectory import ModelTrajectory
from hybridsim.solution.poles import end_at_pole, passed_unseen
from hybridsim.solution.run import Run
from hybridsim.solution.solution import Solution


def carried_out(
    run: Run, progress: Callable[[float], None] | None, compile_time: float = 0.0, before: float = 0.0
) -> Solution:
    """Carry out the run and return its solution; `compile_time` and `before` are seconds spent earlier."""
    began, compiled = time.perf_counter(), seconds_compiling()
    trajectory = run.method.run(run.system, run.task, progress)
    within = seconds_compiling() - compiled  # compile time of kernels that were first needed in this run
    wall_time = time.perf_counter() - began - within
    if isinstance(trajectory, LazyTrajectory):
        trajectory.then(partial(_close, run))
        if denominators(run.model):
            trajectory.whole()
    else:
        _close(run, trajectory)
    # The solution keeps only what the run left, not its start.
    if run.task.record is not None:
        run = replace(run, task=replace(run.task, record=None))
    solution = Solution(ModelTrajectory(run, trajectory, before + wall_time, compile_time + within))
    # A compiled loop that took the run from start to end was not interrupted.
    if not isinstance(trajectory, LazyTrajectory) and trajectory.status == "interrupted":
        raise RunInterrupted(solution)
    return solution


def _close(run: Run, trajectory: Trajectory) -> None:
    """Add the warnings of the run, and drop data that `keep` excludes."""
    if isinstance(run.system.code, PythonCode):
        run.system.code.report(trajectory)
    for caution in (*jumps_of(run.model), *touches_of(run.model)):
        trajectory.warnings[caution.sentence] = 1
    end_at_pole(run.system, trajectory)
    for sentence in passed_unseen(run.system, trajectory, run.task.x0, run.task.t0):
        trajectory.warn(sentence)
    if run.task.t0 == run.task.t1:
        trajectory.warn(f"`t_span` begins and ends at {run.task.t0!r}, so nothing was integrated")
    trajectory.close(run.task.retention)
