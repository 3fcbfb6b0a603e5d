"""This module converts a solution to columns: times, states, outputs and modes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hybridsim.arguments import whole_number
from hybridsim.engine.record.blocks import SegmentBlock, SegmentList
from hybridsim.engine.record.segments import Segment
from hybridsim.model.checks.units import time_unit, units_of
from hybridsim.presentation.tables import Table
from hybridsim.solution.run import Run


class SegmentConstants(NamedTuple):
    """The modes (C,) and the run-time vector of a segment, which are constant during the segment."""

    z: np.ndarray
    p: np.ndarray


Part = tuple[Segment | SegmentConstants, np.ndarray, np.ndarray]  # segment, indices of its times, local times
MOST_POINTS = 1 << 27  # rows per column: one gigabyte


def constants_of(block: SegmentBlock | SegmentList, i: int) -> SegmentConstants:
    """Return the constants of segment i of a block without computing the motion."""
    if isinstance(block, SegmentList):
        return SegmentConstants(block[i].z, block[i].p)
    return SegmentConstants(block.modes[i], block.vectors[i])


def equal_steps(t0: float, t1: float, points: int) -> np.ndarray:
    """Return equally spaced times (points,), including both ends."""
    return np.linspace(t0, t1, whole_number(points, "points", 2, MOST_POINTS))


def at_steps(segments: Sequence[Segment]) -> list[Part]:
    """Return the segments with the indices and the local times of their steps, for `tabulated`."""
    ends = np.cumsum([len(g.s) for g in segments], dtype=int)
    return [(g, np.arange(end - len(g.s), end), g.s) for g, end in zip(segments, ends, strict=True)]


def tabulated(
    run: Run,
    status: str,
    t: np.ndarray,
    x: np.ndarray,
    parts: Sequence[Part],
    values_in: Callable[..., Sequence[np.ndarray]],
) -> Table:
    """Return the table of a run of a `Model` at times t (k,) with states x (k, n); see `Solution.table`.

    parts : segments with the indices of their times, and the local times.
    values_in : a function that returns the values of named quantities at points of a segment.
    """
    model, system = run.model, run.system
    names = [d.name for d in model.discrete]
    names += [q for q in system.quantities if " in " not in q]
    columns = {name: np.empty(len(t)) for name in (*system.names, *names)}
    declared = system.declared
    numbers = np.empty((len(declared), len(t)), dtype=np.int64)
    for segment, chosen, s in parts:
        found = values_in(names, segment, s, x[chosen])
        for name, values in zip(columns, (*x[chosen].T, *found), strict=True):
            columns[name][chosen] = values
        numbers[:, chosen] = segment.z[: len(declared), None]
    return Table(
        t,
        columns,
        {a.name: (a.modes, row) for a, row in zip(declared, numbers, strict=True)},
        {name: unit for name, unit in ({"t": time_unit(model)} | units_of(model)).items() if unit},
        {"model": model.name, "title": model.title, "integrator": run.method.name, "status": status},
    )
