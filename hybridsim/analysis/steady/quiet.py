"""This module finds a start of the period at which no event happens, so that no event is counted twice."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.system.automaton import CORNER
from hybridsim.solution import Solution

_NEAR = 1e-6  # of a period: an event this close to its end may move onto it while the motion settles
_WITHOUT_EFFECT = ("near-grazing", CORNER)
_LOOKED_AT = 4  # last periods whose events are used


def event_times(solution: Solution) -> np.ndarray:
    """Return the times (K,), ascending, of all events of a forward run."""
    return np.concatenate(
        [np.empty(0), *(block.times for block in solution._of_model.record.occurrences.blocks)]
    )


def is_event_near(solution: Solution, times: np.ndarray, t: float, period: float) -> bool:
    """Return whether an event is close to time t; near-grazings and corners do not count."""
    first, end = np.searchsorted(times, [t - _NEAR * period, t + _NEAR * period])
    occurrences = solution._of_model.record.occurrences
    return any(occurrences[k].kind not in _WITHOUT_EFFECT for k in range(int(first), int(end)))


def quiet_offset(solution: Solution, period: float) -> float:
    """Return the time from the end of a run to an instant without events, modulo the period.

    It is 0 if no event is at the section, else it leads to the middle of the longest event-free interval.
    """
    times, end = event_times(solution), solution.t_end
    if not any(is_event_near(solution, times, t, period) for t in (end, end - period)):
        return 0.0
    late = times[times > end - (_LOOKED_AT + _NEAR) * period]
    return middle_of_longest(np.sort((late - end) % period), period)


def middle_of_longest(times: np.ndarray, period: float) -> float:
    """Return the middle of the longest gap between times (K,) that repeat with the period; K > 0."""
    gaps = np.diff(np.append(times, times[0] + period))
    k = int(np.argmax(gaps))
    return float((times[k] + 0.5 * gaps[k]) % period)


def between_events(times: np.ndarray, t: float, low: float, high: float) -> float:
    """Return a time in (low, high) midway between the events before and after t, or t if there are no events."""
    if not len(times):
        return t
    k = int(np.searchsorted(times, t))
    before = times[k - 1] if k > 0 else low
    after = times[k] if k < len(times) else high
    if k < len(times) and times[k] == t:  # an event at t itself
        later = times[times > t]
        before, after = t, later[0] if len(later) else high
    return float(np.clip(0.5 * (before + after), low, high))
