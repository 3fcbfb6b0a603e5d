"""This module stores blocks of fixed steps, which are converted to segments and events on demand."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.record.blocks import SegmentBlock, SegmentList
from hybridsim.engine.record.event_block import EventBlock
from hybridsim.engine.record.segments import Dense
from hybridsim.engine.system.instant import Instant, two_sum
from hybridsim.engine.system.system import System


@dataclass(frozen=True)
class StepDense:
    """Steps in one mode, with local times (m + 1,), states (m + 1, n) and cubic dense output."""

    system: System
    p: np.ndarray
    z: np.ndarray
    s: np.ndarray
    x: np.ndarray

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,)."""
        index = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        used, place = np.unique(index, return_inverse=True)
        left, right = self._slopes(used), self._slopes(used + 1)
        h = (self.s[index + 1] - self.s[index])[:, None]
        theta = (s - self.s[index])[:, None] / h
        x0, x1, d0, d1 = self.x[index], self.x[index + 1], left[place] * h, right[place] * h
        rest = 1.0 - theta
        # relative to x0, so that constant states stay constant bit for bit
        return x0 + (x1 - x0) * theta**2 * (3.0 - 2.0 * theta) + d0 * rest**2 * theta - d1 * theta**2 * rest

    def _slopes(self, rows: np.ndarray) -> np.ndarray:
        states = np.ascontiguousarray(self.x[rows])
        return self.system.rows("flow", self.system.n, self.s[rows], states, self.p, self.z)


class StepSegments(SegmentBlock):
    """The segments of a series of fixed steps, one segment for consecutive steps in the same modes.

    Parameters
    ----------
    origin, p : instant from which local times count, and the run-time vector.
    s, x, z : (m + 1,), (m + 1, n), (m + 1, C): local time, states and modes at the start of each step; the last row is
    the
        end.
    cuts : rows at which the modes change, ascending.
    """

    def __init__(
        self,
        system: System,
        origin: Instant,
        p: np.ndarray,
        s: np.ndarray,
        x: np.ndarray,
        z: np.ndarray,
        cuts: np.ndarray,
    ) -> None:
        self._system, self._origin, self._p = system, origin, p
        self._s, self._x, self._z = s, x, z
        bounds = np.empty(len(cuts) + 2, dtype=np.int64)
        bounds[0], bounds[1:-1], bounds[-1] = 0, cuts, len(s) - 1
        longer = bounds[1:] > bounds[:-1]
        self._first, self._last = bounds[:-1][longer], bounds[1:][longer]
        count = len(self._first)
        self.origins, self.vectors = np.full((count, 2), origin), np.full((count, len(p)), p)
        self.modes = z[self._first]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return all arrays of the block by name, as `of_arrays` reads them."""
        used = slice(int(self._first[0]), int(self._last[-1]) + 1)
        rows = {"s": self._s[used], "x": self._x[used], "z": self._z[used]}
        return rows | {
            "origin": np.array(self._origin),
            "p": self._p,
            "cuts": self._first[1:] - self._first[0],
        }

    @classmethod
    def of_arrays(cls, system: System, arrays: dict[str, np.ndarray]) -> StepSegments:
        """Return a block made of the given arrays."""
        origin = Instant(*arrays["origin"].tolist())
        return cls(system, origin, *(arrays[name] for name in ("p", "s", "x", "z", "cuts")))

    @property
    def spans(self) -> np.ndarray:
        """Return the first and last local time of each segment (N, 2)."""
        return np.stack([self._s[self._first], self._s[self._last]], axis=1)

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,) in the segments with the given numbers."""
        distinct, place = np.unique(index, return_inverse=True)
        return SegmentList(self._system, (self[i] for i in distinct.tolist())).states(place, s)

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return segment numbers, local times and states of all steps; ends of segments occur twice."""
        counts = self._last - self._first + 1
        starts = np.cumsum(counts) - counts
        index = np.repeat(np.arange(len(self)), counts)
        rows = np.arange(len(index)) - np.repeat(starts - self._first, counts)
        return index, self._s[rows], self._x[rows]

    @property
    def last(self) -> np.ndarray:
        """Return the states at the end of the last segment."""
        return self._x[int(self._last[-1])]

    def steps_of(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the step times, the states, the run-time vector and the modes of one segment."""
        rows = slice(int(self._first[i]), int(self._last[i]) + 1)
        return self._s[rows], self._x[rows], self.vectors[i], self.modes[i]

    def since(self, first: int) -> StepSegments:
        """Return a block of the segments, starting with the segment of a given number."""
        later = copy(self)
        for name in ("_first", "_last", "origins", "vectors", "modes"):
            setattr(later, name, getattr(self, name)[first:])
        return later

    def motion(self, i: int) -> tuple[np.ndarray, np.ndarray, Dense]:
        """Return the step times, the states and the dense output of a segment."""
        s, x, p, z = self.steps_of(i)
        s, x = s.copy(), x.copy()
        return s, x, StepDense(self._system, p, z, s, x)


@kernel
def _write_instants(high: float, low: float, s: Any, instants: Any) -> None:
    """Write the instants (E, 2) of local times (E,), with the rounding of `Instant.plus`."""
    for i in range(s.shape[0]):
        total, error = two_sum(high, s[i])
        instants[i, 0], instants[i, 1] = two_sum(total, error + low)


def step_events(
    system: System, origin: Instant, s: np.ndarray, before: np.ndarray, after: np.ndarray, x: np.ndarray
) -> EventBlock:
    """Return the mode changes between fixed steps as events without jumps of the states."""
    instants = np.empty((len(s), 2))
    _write_instants(*origin, s, instants)
    no_guard = np.full(len(s), -1, dtype=np.int64)
    return EventBlock(system, instants, no_guard, before, after, np.stack([x, x], axis=1))
