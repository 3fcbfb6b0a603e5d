"""What a run leaves behind: segments with dense output, events, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hybridsim.engine.blocks import OccurrenceList
from hybridsim.engine.chain import Chain, SegmentChain
from hybridsim.engine.pieces import Occurrence, Pieces, Segment, end_point
from hybridsim.engine.stepping import Counters
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant

__all__ = ["Occurrence", "Pieces", "Segment", "Task", "Trajectory"]


class Trajectory:
    """The record of a run.

    segments and occurrences are sequences of `Segment` and `Occurrence`: append objects to them, or add the blocks
    (`hybridsim.engine.blocks`) that a compiled loop leaves behind.
    """

    def __init__(self, system: System) -> None:
        self.segments = SegmentChain(system)
        self.occurrences: Chain[Occurrence] = Chain(OccurrenceList)
        self.counters = Counters()
        self.status, self.message = "finished", ""
        self.warnings: dict[str, int] = {}  # message -> how often

    def finish(self, instant: Instant, z: np.ndarray, p: np.ndarray, x: np.ndarray, discrete: slice) -> None:
        """Keep the state after an event at the very end of the run, which no segment begins with."""
        if self.segments:
            last = self.segments[-1]
            same = (last.z == z).all() and (last.x[-1] == x).all() and (last.p[discrete] == p[discrete]).all()
            if same or float(last.end) != float(instant):
                return
        self.segments.append(end_point(instant, z.copy(), p, x))

    def warn(self, message: str) -> None:
        """Count a warning; each message is kept once."""
        self.warnings[message] = self.warnings.get(message, 0) + 1


@dataclass(frozen=True)
class Task:
    """What to run: from t0 to t1 out of x0 and z0, how accurately, with the method's own options."""

    t0: float
    t1: float
    x0: np.ndarray
    z0: np.ndarray
    tolerances: Any
    discrete: np.ndarray
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def forward(self) -> bool:
        """Whether time runs forward."""
        return self.t1 >= self.t0
