"""This module converts runs, closed forms and user references to trajectories for a comparison."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.errors import UsageError
from hybridsim.reference.trajectory import Trajectory
from hybridsim.solution import Solution


def trajectory_of(solution: Solution) -> Trajectory:
    """Return the trajectory of a run."""
    return Trajectory(
        states=solution,
        t_span=(solution.t_start, solution.t_end),
        events=tuple(solution.events),
        initial_modes={name: intervals[0].mode for name, intervals in solution.modes.items() if intervals},
    )


def as_trajectory(value: Any, t_span: tuple[float, float]) -> Trajectory:
    """Convert a Trajectory, an object like a Solution, or a function t -> states to a trajectory."""
    if isinstance(value, Trajectory):
        return value
    if all(hasattr(value, name) for name in ("t_end", "events", "modes")):
        return trajectory_of(value)
    if callable(value):
        return Trajectory(lambda t, side: np.asarray(value(t), dtype=float), t_span)
    raise UsageError(
        f"`reference` cannot be a {type(value).__name__}",
        remedy="use a Solution, a Trajectory, a function t -> states, 'closed form' or 'runs'",
    )
