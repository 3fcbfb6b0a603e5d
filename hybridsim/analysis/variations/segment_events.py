"""This module lists the segments of a run together with the events between the segments."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hybridsim.engine.record.segments import Occurrence, Segment
from hybridsim.engine.series.bounded import UNIT
from hybridsim.solution import Solution


@dataclass(frozen=True)
class SegmentEvents:
    """A segment, the monitor events recorded inside it, and the events at its end."""

    segment: Segment
    recorded: tuple[Occurrence, ...]
    happened: tuple[Occurrence, ...]


class Last(NamedTuple):
    """Events exactly at the end of a run, with the last segment and the derivatives before and after them."""

    segment: Segment
    Y: np.ndarray
    Yd: np.ndarray
    shift: np.ndarray
    happened: tuple[Occurrence, ...]


def segment_events_of(solution: Solution) -> Iterator[SegmentEvents]:
    """Yield the segments of a run, each with the events at its end that changed modes or states."""
    waiting = [o for o in solution._of_model.record.occurrences if o.kind != "near-grazing"]
    at, segments = 0, list(solution._segments)
    for segment, following in zip(segments, [*segments[1:], None], strict=True):
        # an event and the end of its segment are one instant if they differ by no more than this
        rounding = 4.0 * math.ulp(float(segment.end))
        # at an accumulation of events, the next segment begins at their limit
        until = segment.end if following is None else following.start
        recorded = []
        while at < len(waiting) and waiting[at].instant.minus(segment.end) < -rounding:
            if waiting[at].kind == "monitor" and waiting[at].instant.minus(segment.start) > 0.0:
                recorded.append(waiting[at])
            at += 1
        first = at
        while at < len(waiting) and waiting[at].instant.minus(until) <= rounding:
            at += 1
        yield SegmentEvents(segment, tuple(recorded), tuple(waiting[first:at]))


def time_rounding(solution: Solution) -> float:
    """Return a bound of the rounding errors of event times, which are sums of steps."""
    steps, length = solution.stats["steps"], abs(solution.t_end - solution.t_start)
    rounding = UNIT * (16.0 * steps + solution._run.method.rounding) * length
    return rounding + 4.0 * math.ulp(max(abs(solution.t_end), abs(solution.t_start)))


def at_start(solution: Solution) -> list[Occurrence]:
    """Return the events at the start of a run."""
    first = solution._segments[0].start
    found = []
    for one in solution._of_model.record.occurrences:
        if one.instant.minus(first) > 0.0:
            break
        found.append(one)
    return found
