"""This module chooses the start of an unforced periodic orbit, and the state that is fixed at the start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybridsim.analysis.continuation.branch import BranchPoint
from hybridsim.analysis.steady.motion import point_at_end
from hybridsim.analysis.variations.off_zero import rates_of
from hybridsim.solution import Solution


def begun_elsewhere(point: BranchPoint) -> tuple[BranchPoint, Solution]:
    """Return the same orbit with a start in the middle of its longest smooth part.

    Orbits next to it begin at the same value of one state, so that they have to pass this value, too.
    """
    orbit = point.orbit
    solution = point.motion.run(orbit.start, orbit.period)
    times = np.unique([solution.t_start, *(event.t for event in solution.events), solution.t_end])
    longest = int(np.argmax(np.diff(times)))
    middle = float(times[longest : longest + 2].mean())
    reached = point_at_end(point.motion.run(orbit.start, middle - solution.t_start))
    start = replace(reached, at=orbit.start.at)
    return replace(point, orbit=replace(orbit, start=start)), point.motion.run(start, orbit.period)


def in_shared(tangent: np.ndarray, point: BranchPoint) -> np.ndarray:
    """Return a tangent of which only the entries of the period and the parameter are kept; the others are zero."""
    found = tangent.copy()
    found[: len(point.orbit.start.values)] = 0.0
    return found


def fastest(solution: Solution, unit: np.ndarray) -> int:
    """Return the state that changes fastest at the start of a run, relative to the state's unit."""
    rates = np.abs(rates_at(solution, 0, len(solution.names)))
    return int(np.argmax(rates / unit[: len(rates)])) if len(rates) else 0


def rates_at(solution: Solution, k: int, count: int) -> np.ndarray:
    """Return the rates (count,) of all unknowns at the start (k = 0) or the end (k = -1) of a run."""
    segment, found = solution._segments[k], np.zeros(count)
    states = rates_of(solution._system, float(segment.s[k]), segment.x[k], segment.p, segment.z)
    found[: len(states)] = states
    return found
