"""In which segment each of many times lies, and the local time there."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel


class Frame(NamedTuple):
    """Where the segments of a run lie, in the order in which it went.

    starts, ends (N,): times at which each starts and ends, to the last bit that at which the next one starts. origins,
    spans (N, 2): the instants from which their local times are counted, and their first and last ones.
    """

    starts: np.ndarray
    ends: np.ndarray
    origins: np.ndarray
    spans: np.ndarray

    @classmethod
    def of(cls, origins: np.ndarray, spans: np.ndarray, t_end: float) -> Frame:
        """Of segments, the last of which ends at that time."""
        starts, ends = np.empty(len(spans)), np.empty(len(spans))
        _lay_out(origins, spans, t_end, starts, ends)
        return cls(starts, ends, origins, spans)


@kernel
def _lay_out(origins: Any, spans: Any, t_end: float, starts: Any, ends: Any) -> None:
    """Sums of three numbers, rounded once."""
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
    """Number of the segment that holds a time."""
    low, high = 0, starts.shape[0] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if _has_begun(starts[middle], t, sign, is_later):
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def find_places(
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
    """Of times (m,) numbers of segments and local times, to index and s (m,).

    The next four: see `Frame`. sign: -1 backward in time. is_later: where one ends and the next one starts, it is the
    next one. A time that is that of an event, rounded, means the event. Times in a row are found soonest.
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
        while True:  # those in a row that it holds
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
