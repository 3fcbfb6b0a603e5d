"""This module defines the parts of a trajectory: segments with dense output, and events."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hybridsim.engine.system.instant import Instant

Dense = Callable[[np.ndarray], np.ndarray]  # local times (k,) -> states (k, n)


@dataclass(frozen=True)
class Segment:
    """One segment of a trajectory, in which the modes are constant."""

    origin: Instant  # instant at local time zero
    z: np.ndarray  # modes (C,)
    p: np.ndarray  # run-time vector
    s: np.ndarray  # local times (m + 1,) of the knots
    x: np.ndarray  # states (m + 1, n) at the knots
    dense: Dense

    @property
    def start(self) -> Instant:
        """Return the instant at which the segment begins."""
        return self.origin.plus(float(self.s[0]))

    @property
    def end(self) -> Instant:
        """Return the instant at which the segment ends."""
        return self.origin.plus(float(self.s[-1]))


@dataclass(frozen=True)
class PiecewiseDense:
    """Dense output with one interpolant (a function of local time) for each step."""

    knots: np.ndarray
    interpolants: Sequence[Dense]

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,)."""
        ascending = self.knots[-1] >= self.knots[0]
        inner = self.knots[1:-1] if ascending else -self.knots[1:-1]
        index = np.searchsorted(inner, s if ascending else -s, side="right")
        parts = [(i, np.flatnonzero(index == i)) for i in np.unique(index)]
        if not parts:
            return self.interpolants[0](s)
        first = self.interpolants[parts[0][0]](s[parts[0][1]])
        out = np.empty((len(s), first.shape[1]))
        out[parts[0][1]] = first
        for i, chosen in parts[1:]:
            out[chosen] = self.interpolants[i](s[chosen])
        return out


class Occurrence(NamedTuple):
    """An event as the engine records it, with numbers that the solution converts to names."""

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
    """Return a segment of zero length for the state after an event at which a run ends."""
    states = x[None].copy()
    return Segment(
        origin, z.copy(), p.copy(), np.zeros(1), states, lambda s: np.repeat(states, len(s), axis=0)
    )
