"""This module finds periodic orbits along which a guard is zero, and contacts that slip by less than the tolerance.

An example is slip with the velocity zero at all times. Newton's method follows the equations of one mode, and the
multipliers are those of this mode. A small change of such an orbit leads to another mode, so they decide nothing.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from hybridsim.engine.record.segments import Segment
from hybridsim.solution import Solution

_ZERO = 1e-6  # of the change of a guard by the size of the motion


def lies_on_a_guard(solution: Solution, scale: np.ndarray) -> bool:
    """Return whether some guard is zero over the whole orbit, relative to the size of the motion.

    A guard that no state changes does not count: its mode cannot change.

    Parameters
    ----------
    solution : one period of the orbit.
    scale : (n + d,) size of each state and discrete state of the motion from which the orbit was found.
    """
    system = solution._system
    chosen = np.flatnonzero(scale[: system.n] > 0.0)
    is_zero = np.ones(system.guard_count, dtype=np.bool_)
    for segment in solution._segments:
        is_zero &= system.active(segment.z)
        if not is_zero.any():
            return False
        for s, x in ((segment.s[0], segment.x[0]), (segment.s[-1], segment.x[-1])):
            values, size = _values_and_sizes(solution, segment, float(s), x, chosen, scale)
            is_zero &= (size > 0.0) & (np.abs(values) <= _ZERO * size)
    return bool(is_zero.any())


def slight_slip(solution: Solution, scale: np.ndarray, most: float) -> str:
    """Return a contact that has a slight slip over one period of a motion, or ""; see `has_slight_slip`.

    scale (n + d,): size of each state and discrete state of the motion.
    """
    system = solution._system
    chosen = np.flatnonzero(scale[: system.n] > 0.0)
    segments = [segment for segment in solution._segments if segment.s[-1] != segment.s[0]]
    for c in system.surface_of:
        sticks = np.array([segment.z[c] == system.automata[c].hold for segment in segments])
        largest = np.zeros(len(segments))
        for k in np.flatnonzero(~sticks):
            segment = segments[k]
            own = system.active(segment.z) & (system.owner == c)
            middles = 0.5 * (segment.s[:-1] + segment.s[1:])  # a slip begins and ends with the velocity zero
            for s, x in zip(middles, segment.dense(middles), strict=True):
                values, size = _values_and_sizes(solution, segment, float(s), x, chosen, scale)
                ratio = np.abs(values[own]) / np.where(size[own] > 0.0, size[own], np.nan)
                largest[k] = max(largest[k], np.nan_to_num(ratio, nan=np.inf).min(initial=np.inf))
                if largest[k] > most:
                    break
        if has_slight_slip(sticks, largest, most):
            return str(system.automata[c].name)
    return ""


def has_slight_slip(sticks: np.ndarray, largest: np.ndarray, most: float) -> bool:
    """Return whether a contact slips between two phases of stick by at most a given part of its size.

    Parameters
    ----------
    sticks : (K,) whether the contact sticks, in consecutive intervals of a motion that repeats after them.
    largest : (K,) its largest slip velocity in each interval, in units of the velocity's size.
    """
    if not sticks.any():
        return False
    first = -int(np.argmax(sticks))
    sticks, largest = np.append(np.roll(sticks, first), True), np.roll(largest, first)
    ends = np.flatnonzero(sticks)
    return any(b > a + 1 and largest[a + 1 : b].max() <= most for a, b in pairwise(ends))


def _values_and_sizes(
    solution: Solution, segment: Segment, s: float, x: np.ndarray, chosen: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the value of each guard at x, and its largest change if one of the chosen states changes by its scale."""
    system, count = solution._system, solution._system.guard_count
    points = np.repeat(x[None], 1 + len(chosen), axis=0)
    points[1 + np.arange(len(chosen)), chosen] += scale[chosen]
    values = system.rows("guards", count, np.full(len(points), s), points, segment.p, segment.z)
    return values[0], np.abs(values[1:] - values[0]).max(axis=0, initial=0.0)
