"""This module converts a solution to columns: times, states, outputs and modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.arguments import whole_number
from hybridsim.model.checks.units import time_unit, units_of
from hybridsim.presentation.tables import Table

if TYPE_CHECKING:
    from hybridsim.solution.model_trajectory import ModelTrajectory

MOST_POINTS = 1 << 27  # rows per column: one gigabyte


def equal_steps(t0: float, t1: float, points: int) -> np.ndarray:
    """Return equally spaced times (points,), both ends included."""
    return np.linspace(t0, t1, whole_number(points, "points", 2, MOST_POINTS))


def tabulated(trajectory: ModelTrajectory, times: np.ndarray | None) -> Table:
    """Return the table of a run of a `Model`, at its own steps or at other times; see `Solution.table`."""
    model = trajectory.model
    if times is None:
        t, ends = trajectory.own_times, np.cumsum([len(g.s) for g in trajectory.segments], dtype=int)
        x = trajectory.own_states.T
        parts = [
            (g, np.arange(end - len(g.s), end), g.s) for g, end in zip(trajectory.segments, ends, strict=True)
        ]
    else:
        t = times
        x, parts = trajectory.by_segment(t, "+") if len(t) else (np.zeros((0, len(trajectory.names))), [])
    names = [d.name for d in model.discrete]
    names += [q for q in trajectory.system.quantities if " in " not in q]
    columns = {name: np.empty(len(t)) for name in (*trajectory.names, *names)}
    declared = trajectory.system.declared
    numbers = np.empty((len(declared), len(t)), dtype=np.int64)
    for segment, chosen, s in parts:
        found = trajectory.values_in(names, segment, s, x[chosen])
        for name, values in zip(columns, (*x[chosen].T, *found), strict=True):
            columns[name][chosen] = values
        numbers[:, chosen] = segment.z[: len(declared), None]
    return Table(
        t,
        columns,
        {a.name: (a.modes, row) for a, row in zip(declared, numbers, strict=True)},
        {name: unit for name, unit in ({"t": time_unit(model)} | units_of(model)).items() if unit},
        {
            "model": model.name,
            "title": model.title,
            "integrator": trajectory.integrator,
            "status": trajectory.status,
        },
    )
