"""This module defines a checkpoint: the state just after an event, from which a run can continue."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hybridsim.engine.system.instant import Instant
from hybridsim.errors import UsageError


class Pace(NamedTuple):
    """The stored form of the intervals between events of one component, for a checkpoint."""

    last: Instant | None  # the last event
    intervals: tuple[float, ...]  # intervals before it
    longest: float  # the interval since which they shrink
    forecast: tuple[float, float] | None = None  # limit of the series so far, and its distance
    steadiest: tuple[float, float, float] | None = (
        None  # last change of the forecast, least change, its forecast
    )


BEGINNING = Pace(None, (), 0.0)


@dataclass(frozen=True)
class Checkpoint:
    """A point of a run from which the run can continue."""

    instant: Instant
    arrays: dict[str, np.ndarray]  # the state there, by names that the loop chooses
    settled: Instant | None  # the last completed appointment
    paces: dict[int, Pace]  # intervals between the events of each component
    segments: int = 0  # segments recorded since, which are recorded again
    occurrences: int = 0  # events recorded since, which are recorded again


def damaged(fault: str) -> UsageError:
    """Return the error for a run that cannot continue because its file is damaged."""
    return UsageError(
        f"the run cannot be resumed, because its file is damaged: {fault}",
        remedy="start a new run from sol.y[:, -1]",
    )
