"""The state of a run just after an event: all that it needs to go on from there, to the last bit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hybridsim.engine.system.instant import Instant
from hybridsim.errors import UsageError


class Pace(NamedTuple):
    """How the events of one component follow each other, as the watch over accumulations knows it.

    last : the last event.
    intervals : before it.
    longest : interval since which they shrink.
    forecast : limit of the series so far, and how far ahead it is.
    steadiest : by how much that limit moved last; the least that one moved, and that one.
    """

    last: Instant | None
    intervals: tuple[float, ...]
    longest: float
    forecast: tuple[float, float] | None = None
    steadiest: tuple[float, float, float] | None = None


BEGINNING = Pace(None, (), 0.0)


@dataclass(frozen=True)
class Checkpoint:
    """A place that a run passed and can go on from.

    Parameters
    ----------
    instant : where it is.
    arrays : what holds there, by names that the loop gives them.
    settled : the last appointment that was kept.
    paces : how the events of each component followed each other.
    segments, occurrences : how many the run has recorded since; they are recorded anew.
    """

    instant: Instant
    arrays: dict[str, np.ndarray]
    settled: Instant | None
    paces: dict[int, Pace]
    segments: int = 0
    occurrences: int = 0


def damaged(what: str) -> UsageError:
    """What is raised where a run cannot go on from a place that came from a file."""
    return UsageError(
        f"the run cannot be resumed: its file is damaged in {what}",
        remedy="start a new run from sol.y[:, -1]",
    )
