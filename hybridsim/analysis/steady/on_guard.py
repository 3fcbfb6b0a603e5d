"""This module finds periodic orbits for which the velocity of a contact, or another guard, is always zero.

An example is slip with the velocity zero at all times. Newton's method follows the equations of one mode, and the
multipliers are those of this mode. A small change of such an orbit leads to another mode, so they decide nothing.
"""

from __future__ import annotations

import numpy as np

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
    system, count = solution._system, solution._system.guard_count
    chosen = np.flatnonzero(scale[: system.n] > 0.0)
    is_zero = np.ones(count, dtype=np.bool_)
    for segment in solution._segments:
        is_zero &= system.active(segment.z)
        if not is_zero.any():
            return False
        for s, x in ((segment.s[0], segment.x[0]), (segment.s[-1], segment.x[-1])):
            points = np.repeat(x[None], 1 + len(chosen), axis=0)
            points[1 + np.arange(len(chosen)), chosen] += scale[chosen]
            values = system.rows("guards", count, np.full(len(points), s), points, segment.p, segment.z)
            size = np.abs(values[1:] - values[0]).max(axis=0, initial=0.0)
            is_zero &= (size > 0.0) & (np.abs(values[0]) <= _ZERO * size)
    return bool(is_zero.any())
