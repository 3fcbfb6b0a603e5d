"""This module finds the segment and the local time of each of many times."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel


class Frame(NamedTuple):
    """The start and end times of all segments of a run, in order.

    starts, ends (N,): times at which each segment starts and ends; an end equals the next start bit for bit. origins,
    spans (N, 2): the instants from which local times are counted, and the first and last local times.
    """

    starts: np.ndarray
    ends: np.ndarray
    origins: np.ndarray
    spans: np.ndarray

    @classmethod
    def of(cls, origins: np.ndarray, spans: np.ndarray, t_end: float) -> Frame:
        """Return the times of some segments, the last of which ends at `t_end`."""
        starts, ends = np.empty(len(spans)), np.empty(len(spans))
        _lay_out(origins, spans, t_end, starts, ends)
        return cls(starts, ends, origins, spans)


@kernel
def _lay_out(origins: Any, spans: Any, t_end: float, starts: Any, ends: Any) -> None:
    """Write the start and end times of segments, each rounded once."""
    last = starts.shape[0] - 1
    for i in range(last + 1):
        high, low, s = origins[i, 0], origins[i, 1], spans[i, 0]
        total = high + s
        moved = total - high
        starts[i] = total + (((high - (total - moved)) + (s - moved)) + low)
        if i > 0:
            ends[i - 1] = starts[i]
    if last >= 0:
        ends[last] = t_end


@inlined
def _has_begun(start: float, t: float, sign: float, is_later: bool) -> bool:
    return sign * start <= sign * t if is_later else sign * start < sign * t


@inlined
def _search(t: float, starts: Any, sign: float, is_later: bool) -> int:
    """Return the number of the segment that contains a time."""
    low, high = 0, starts.shape[0] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if _has_begun(starts[middle], t, sign, is_later):
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def locate_times(
    times: Any,
    starts: Any,
    ends: Any,
    origins: Any,
    spans: Any,
    sign: float,
    is_later: bool,
    index: Any,
    s: Any,
) -> None:
    """Write the segment number and the local time (m,) of each of many times.

    starts, ends, origins, spans: see `Frame`. sign: -1 backward in time. is_later: whether a time at which one segment
    ends and the next one starts belongs to the next one. A time equal to the rounded time of an event means the event.
    Sorted times are fastest.
    """
    i, last, k = 0, starts.shape[0] - 1, 0
    while k < times.shape[0]:
        i = min(i + 1, last) if k > 0 else 0
        is_held = i == 0 or _has_begun(starts[i], times[k], sign, is_later)
        if not is_held or (i < last and _has_begun(starts[i + 1], times[k], sign, is_later)):
            i = _search(times[k], starts, sign, is_later)
        start, end, high, low = starts[i], ends[i], origins[i, 0], origins[i, 1]
        first, final = spans[i, 0], spans[i, 1]
        since = sign * start if i > 0 else -math.inf
        until = sign * starts[i + 1] if i < last else math.inf
        while True:  # consecutive times in the same segment
            t = times[k]
            at = (t - high) - low
            if t == start or sign * at < sign * first:
                at = first
            if t == end or sign * at > sign * final:
                at = final
            index[k], s[k] = i, at
            k += 1
            if k == times.shape[0]:
                break
            now = sign * times[k]
            if now < since or now > until or (now == until if is_later else now == since):
                break
