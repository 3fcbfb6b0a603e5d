"""This module measures the largest values of the states along a run."""

from __future__ import annotations

import numpy as np

from hybridsim.solution import Solution

_POINTS = 513  # equally spaced, in addition to the ends of all steps


def sizes(solution: Solution) -> np.ndarray:
    """Return the largest absolute value (n,) of each state along a run."""
    low, high = ranges(solution)
    return np.maximum(np.abs(low), np.abs(high))


def ranges(solution: Solution, since: float = -np.inf) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and greatest value (n,) of each state over a run, or over the part after a given time."""
    begin = max(since, solution.t_start)
    sampled = solution(np.linspace(begin, solution.t_end, _POINTS)).T
    index, s, x = solution._segments.knots()
    origins = solution._segments.origins()[index]
    every = np.concatenate([sampled, x[origins[:, 0] + (s + origins[:, 1]) >= begin]])
    return every.min(axis=0), every.max(axis=0)
