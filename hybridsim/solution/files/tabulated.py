"""This module puts a solution into columns: times, states, outputs and modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.arguments import whole_number
from hybridsim.model.checks.units import time_unit, units_of
from hybridsim.presentation.tables import Table

if TYPE_CHECKING:
    from hybridsim.solution.solution import Solution

MOST_POINTS = 1 << 27  # rows per column: one gigabyte


def equal_steps(t0: float, t1: float, points: int) -> np.ndarray:
    """Return equally spaced times (points,), both ends included."""
    return np.linspace(t0, t1, whole_number(points, "points", 2, MOST_POINTS))


def tabulated(solution: Solution, points: int | None) -> Table:
    """Return the table of a solution; see `Solution.table`."""
    model, own_steps = solution.model, points is None and solution._grid is None
    if own_steps:
        t, ends = solution.t, np.cumsum([len(g.s) for g in solution._segments], dtype=int)
        x = solution.y.T
        parts = [
            (g, np.arange(end - len(g.s), end), g.s) for g, end in zip(solution._segments, ends, strict=True)
        ]
    else:
        t = solution.t if points is None else equal_steps(solution.t_start, solution.t_end, points)
        x, parts = solution._by_segment(t, "+") if len(t) else (np.zeros((0, len(solution.names))), [])
    names = [d.name for d in model.discrete]
    names += [q for q in solution._system.quantities if " in " not in q]
    columns = {name: np.empty(len(t)) for name in (*solution.names, *names)}
    declared = solution._system.declared
    numbers = np.empty((len(declared), len(t)), dtype=np.int64)
    for segment, chosen, s in parts:
        found = solution._quantities(names, segment, s, x[chosen])
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
            "integrator": solution.integrator,
            "status": solution.status,
        },
    )
