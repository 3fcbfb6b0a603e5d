"""Segments in closed form, stored in the arrays that the compiled loop of linear modes writes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.engine.linear.motion import functions_of_time, moved, states_near_start, states_of
from hybridsim.engine.linear.tables import LinearTables
from hybridsim.engine.native.kernels import call, kernel
from hybridsim.engine.record.blocks import SegmentBlock
from hybridsim.engine.record.segments import Dense
from hybridsim.engine.system.system import System


@kernel
def closed_form_states(
    project: Any, pinned: bool, lin: Any, index: Any, s: Any, record: Any, scratch: Any, out: Any
) -> None:
    """Compute states (m, n) at local times s (m,) in the segments with the given numbers.

    scratch: scratch arrays for modal coordinates, states, values of atoms, functions of time, and terms near a
    start.
    """
    ends, rows, coordinates, modes, vectors, jumps = record
    c, x, factors, w, terms = scratch
    for m in range(s.shape[0]):
        i = index[m]
        if s[m] == 0.0 or s[m] >= ends[i]:
            side = 0 if s[m] == 0.0 else 1
            for j in range(x.shape[0]):
                out[m, j] = jumps[i, side, j]
            continue
        moved(lin, rows[i], coordinates[i], s[m], c)
        states_of(lin, rows[i], c, x)
        if s[m] < lin.near[rows[i]]:
            functions_of_time(lin, 0.0, vectors[i], factors, w)
            states_near_start(lin, rows[i], jumps[i, 0], w, s[m], terms, x)
        if pinned:
            call(project, s[m], x, vectors[i], modes[i], out[m])
        else:
            for j in range(x.shape[0]):
                out[m, j] = x[j]


@dataclass(frozen=True)
class ClosedFormBlock(SegmentBlock):
    """Consecutive segments in closed form; each of them starts at local time 0.

    Parameters
    ----------
    tables, rows : the linear modes, and the row of each segment in them (N,).
    ends : (N,) local times of the ends.
    coordinates : (N, J) modal coordinates at the starts.
    origins, modes, vectors : (N, 2), (N, C), (N, P) time origin, modes and run-time vector of each segment.
    jumps : (N, 3, n), states at the start, x- and x+ at the end of each segment.
    """

    system: System
    tables: LinearTables
    rows: np.ndarray
    ends: np.ndarray
    coordinates: np.ndarray
    origins: np.ndarray
    modes: np.ndarray
    vectors: np.ndarray
    jumps: np.ndarray

    @cached_property
    def spans(self) -> np.ndarray:
        """Return the local times (N, 2) at which the segments start and end."""
        return np.stack([np.zeros(len(self)), self.ends], axis=1)

    @property
    def last(self) -> np.ndarray:
        """Return the states just before the end of the last segment."""
        return self.jumps[-1, 1]

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,) in the segments with the given numbers."""
        n, pinned = self.system.n, self.system.can_hold
        out = np.empty((len(s), n))
        closed_form_states(
            self.system.address("project" if pinned else "flow"),
            pinned,
            self.tables,
            index,
            s,
            (self.ends, self.rows, self.coordinates, self.modes, self.vectors, self.jumps),
            self._scratch(),
            out,
        )
        return out

    def _scratch(self) -> tuple[np.ndarray, ...]:
        lin, n = self.tables, self.system.n
        factors = np.ones((2 * len(lin.kinds) + 1, 2))
        return (
            np.empty(self.coordinates.shape[1], dtype=complex),
            np.empty(n),
            factors,
            np.empty(len(lin.factors)),
            np.empty((2, lin.flows.shape[1])),
        )

    def steps_of(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the times and states at both ends of a segment, its run-time vector and its modes."""
        return np.array([0.0, self.ends[i]]), self.jumps[i, :2], self.vectors[i], self.modes[i]

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return segment numbers, local times and states at the start and the end of each segment."""
        index = np.repeat(np.arange(len(self)), 2)
        return index, self.spans.ravel(), self.jumps[:, :2].reshape(len(index), -1)

    def since(self, first: int) -> ClosedFormBlock:
        """Return a block of the segments, starting with the segment of a given number."""
        rows = (self.rows, self.ends, self.coordinates, self.origins, self.modes, self.vectors, self.jumps)
        return ClosedFormBlock(self.system, self.tables, *(r[first:] for r in rows))

    def motion(self, i: int) -> tuple[np.ndarray, np.ndarray, Dense]:
        """Return the times and states at both ends of a segment, and its dense output."""

        def dense(s: np.ndarray) -> np.ndarray:
            return self.states(np.full(len(s), i), np.asarray(s, dtype=float))

        return *self.steps_of(i)[:2], dense
