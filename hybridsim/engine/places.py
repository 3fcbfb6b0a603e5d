"""In which segment each of many times lies, and the local time there."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.jit import inlined, kernel


@inlined
def _has_begun(start: float, t: float, sign: float, is_later: bool) -> bool:
    return sign * start <= sign * t if is_later else sign * start < sign * t


@inlined
def _holds(t: float, i: int, starts: Any, sign: float, is_later: bool) -> bool:
    """Whether it is segment i that holds t."""
    has_begun = i == 0 or _has_begun(starts[i], t, sign, is_later)
    return has_begun and (i + 1 == starts.shape[0] or not _has_begun(starts[i + 1], t, sign, is_later))


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

    starts, ends (N,): where segments start and end, in the order in which the run went. origins, spans (N, 2): of their
    local times. sign: -1 backward in time. is_later: where one ends and the next one starts, it is the next one. A time
    that is that of an event, rounded, means the event. Times in a row are found soonest.
    """
    i, last = 0, starts.shape[0] - 1
    for k in range(times.shape[0]):
        t = times[k]
        if not _holds(t, i, starts, sign, is_later):
            i = min(i + 1, last)
        if not _holds(t, i, starts, sign, is_later):
            low, high = 0, last
            while low < high:
                middle = (low + high + 1) // 2
                if _has_begun(starts[middle], t, sign, is_later):
                    low = middle
                else:
                    high = middle - 1
            i = low
        at = (t - origins[i, 0]) - origins[i, 1]
        begin, end = spans[i, 0], spans[i, 1]
        if t == starts[i] or sign * at < sign * begin:
            at = begin
        if t == ends[i] or sign * at > sign * end:
            at = end
        index[k], s[k] = i, at
