"""The state of a run just after an event: all that it needs to go on from there, to the last bit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hybridsim.engine.timepair import Instant


class Pace(NamedTuple):
    """What the watch over accumulations knows: the last event, the intervals before it, its forecast."""

    last: Instant | None
    intervals: tuple[float, ...]
    longest: float
    forecast: tuple[float, float] | None


@dataclass(frozen=True)
class Checkpoint:
    """A place that a run passed and can go on from.

    Parameters
    ----------
    instant : where it is.
    arrays : what holds there, by names that the loop gives them.
    settled : the last appointment that was kept.
    pace : how events followed each other.
    segments, occurrences : how many the run has recorded since; they are recorded anew.
    """

    instant: Instant
    arrays: dict[str, np.ndarray]
    settled: Instant | None
    pace: Pace
    segments: int = 0
    occurrences: int = 0
