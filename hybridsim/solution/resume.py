"""This module resumes a run from its last checkpoint."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from hybridsim import arguments
from hybridsim.arguments import cannot_be
from hybridsim.errors import UsageError
from hybridsim.solution.running import carried_out
from hybridsim.solution.solution import Solution

_EARLY = ("limit", "interrupted")


def _discrete_states(solution: Solution) -> str:
    """Return the discrete states at the end of a run, which ``sol.y`` does not contain, as a part of a remedy."""
    names = [each.name for each in solution.model.discrete]
    if not names or not solution._segments:
        return ""
    values = solution._system.discrete(solution._segments[-1].p).tolist()
    listed = ", ".join(f"{name!r}: {value!r}" for name, value in zip(names, values, strict=True))
    return f" and the discrete states {{{listed}}}, all in x0"


def resumed(
    solution: Solution,
    t_end: float | None,
    limits: Mapping[str, float] | None,
    progress: Callable[[float], None] | bool | None,
) -> Solution:
    """Return the solution of the whole run after continuing it to a later time."""
    run, trajectory = solution._run, solution._of_model.record
    task, checkpoint = run.task, trajectory.checkpoint
    if solution.status not in ("finished", *_EARLY) or checkpoint is None:
        raise UsageError(
            f"the run of {run.model.name} cannot be resumed: {solution.status}, {solution.message}",
            remedy=f"start a new run with other settings from sol.y[:, -1]{_discrete_states(solution)}",
        )
    end = task.t1 if t_end is None else arguments.number(t_end, "t_end")
    if not math.isfinite(end):
        raise cannot_be("t_end", t_end, "use a finite time; add a monitor if the run should end earlier")
    sign = 1.0 if task.t1 >= task.t0 else -1.0
    if t_end is None and solution.status == "finished":
        raise UsageError(
            f"the run of {run.model.name} already reached its end, t = {task.t1!r}",
            remedy="pass a later `t_end`",
        )
    if not sign * (end - solution.t_end) >= 0.0:
        raise UsageError(
            f"`t_end` is {t_end!r}, but the run is already at {solution.t_end!r}", remedy="use a later time"
        )
    record = trajectory.up_to_checkpoint(run.system)
    task = replace(task, t1=end, limits=arguments.run_limits(limits), record=record)
    run, stats = replace(run, task=task), solution.stats
    return carried_out(run, arguments.callback(progress), stats["compile_time"], stats["wall_time"])
