"""What a run leaves behind: segments with dense output, events, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hybridsim.engine.stepping import Counters, Dense
from hybridsim.engine.timepair import Instant


@dataclass(frozen=True)
class Segment:
    """One piece of trajectory in one z: knots at local times s (m+1,), states x (m+1, n), dense output between."""

    origin: Instant
    z: np.ndarray
    p: np.ndarray
    s: np.ndarray
    x: np.ndarray
    dense: Dense

    @property
    def start(self) -> Instant:
        """Where it begins."""
        return self.origin.plus(float(self.s[0]))

    @property
    def end(self) -> Instant:
        """Where it ends."""
        return self.origin.plus(float(self.s[-1]))


@dataclass(frozen=True)
class Pieces:
    """Dense output made of one interpolant for each step."""

    knots: np.ndarray
    interpolants: tuple[Dense, ...]

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """States (k, n) at local times (k,)."""
        ascending = self.knots[-1] >= self.knots[0]
        inner = self.knots[1:-1] if ascending else -self.knots[1:-1]
        index = np.searchsorted(inner, s if ascending else -s, side="right")
        parts = [(i, np.flatnonzero(index == i)) for i in np.unique(index)]
        first = self.interpolants[parts[0][0]](s[parts[0][1]])
        out = np.empty((len(s), first.shape[1]))
        out[parts[0][1]] = first
        for i, chosen in parts[1:]:
            out[chosen] = self.interpolants[i](s[chosen])
        return out


@dataclass(frozen=True)
class Occurrence:
    """An event as the engine records it; names are resolved by the solution."""

    instant: Instant
    kind: str  # transition, monitor, scheduled, near-grazing
    component: str
    guard: str
    source: str
    target: str
    direction: int
    x_minus: np.ndarray
    x_plus: np.ndarray


def end_point(origin: Instant, z: np.ndarray, p: np.ndarray, x: np.ndarray) -> Segment:
    """A segment of no length: the state after an event with which a run ends."""
    return Segment(origin, z, p, np.zeros(1), x[None, :].copy(), lambda s: np.tile(x, (len(s), 1)))


@dataclass
class Trajectory:
    """The record of a run."""

    segments: list[Segment] = field(default_factory=list)
    occurrences: list[Occurrence] = field(default_factory=list)
    counters: Counters = field(default_factory=Counters)
    status: str = "finished"
    message: str = ""
    warnings: dict[str, int] = field(default_factory=dict)  # message -> how often

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
