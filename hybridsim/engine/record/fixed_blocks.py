"""Blocks of fixed steps: the rows that a kernel wrote, converted to segments and events on demand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np

from hybridsim.engine.record.blocks import SegmentList
from hybridsim.engine.record.fixed_dense import StepDense
from hybridsim.engine.record.segments import Occurrence, Segment, end_point
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


class StepSegments(Sequence[Segment]):
    """The segments of one series of fixed steps, one for each sequence of rows in the same modes.

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
        bounds = np.concatenate([[0], cuts, [len(s) - 1]])
        self._first, self._last = bounds[:-1], bounds[1:]
        longer = self._last > self._first
        self._first, self._last = self._first[longer], self._last[longer]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return all arrays of the block by name; see `of_arrays`."""
        used = slice(int(self._first[0]), int(self._last[-1]) + 1)
        rows = {"s": self._s[used], "x": self._x[used], "z": self._z[used]}
        return rows | {
            "origin": np.array(self._origin),
            "p": self._p,
            "cuts": self._first[1:] - self._first[0],
        }

    @classmethod
    def of_arrays(cls, system: System, arrays: dict[str, np.ndarray]) -> StepSegments:
        """Return a block with the given arrays."""
        origin = Instant(*arrays["origin"].tolist())
        return cls(system, origin, *(arrays[name] for name in ("p", "s", "x", "z", "cuts")))

    def __len__(self) -> int:
        return len(self._first)

    @property
    def until(self) -> Instant:
        """Return the instant at which the last segment ends."""
        return self._origin.plus(float(self._s[self._last[-1]]))

    @property
    def origins(self) -> np.ndarray:
        """Return the origin of local time of each segment (N, 2)."""
        return np.tile(np.array(self._origin), (len(self), 1))

    @property
    def spans(self) -> np.ndarray:
        """Return the first and last local time of each segment (N, 2)."""
        return np.stack([self._s[self._first], self._s[self._last]], axis=1)

    @property
    def modes(self) -> np.ndarray:
        """Return the modes of each segment (N, C)."""
        return self._z[self._first]

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,) in the segments with the given numbers."""
        distinct, place = np.unique(index, return_inverse=True)
        return SegmentList(self._system, (self[i] for i in distinct.tolist())).states(place, s)

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return numbers of segments, local times and states of all steps; a row between two segments occurs twice."""
        counts = self._last - self._first + 1
        starts = np.cumsum(counts) - counts
        index = np.repeat(np.arange(len(self)), counts)
        rows = np.arange(len(index)) - np.repeat(starts - self._first, counts)
        return index, self._s[rows], self._x[rows]

    def at_end(self) -> Segment:
        """Return a segment of zero length at the end of the last segment."""
        last = int(self._last[-1])
        return end_point(self.until, self._z[int(self._first[-1])], self._p, self._x[last])

    def steps_of(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return knots, states, run-time vector and modes of one segment."""
        first, last = int(self._first[i]), int(self._last[i])
        return self._s[first : last + 1], self._x[first : last + 1], self._p, self._z[first]

    def since(self, first: int) -> StepSegments:
        """Return a block of the segments from the given number on."""
        later = copy(self)
        later._first, later._last = self._first[first:], self._last[first:]
        return later

    def __getitem__(self, i: Any, /) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        s, x, p, z = self.steps_of(i)
        dense = StepDense(self._system, p, z.copy(), s.copy(), x.copy())
        s, x = dense.s, dense.x
        return Segment(self._origin, dense.z, self._p, s, x, dense)


class StepOccurrences(Sequence[Occurrence]):
    """The changes of mode in one series of fixed steps.

    Parameters
    ----------
    rows, components : (E,) the row of each change, in order, and the component that changes.
    changes : (E, 2) modes before and after.
    s, x : local times and states of all rows.
    """

    def __init__(
        self,
        system: System,
        origin: Instant,
        rows: np.ndarray,
        components: np.ndarray,
        changes: np.ndarray,
        s: np.ndarray,
        x: np.ndarray,
    ) -> None:
        self._system, self._origin = system, origin
        self._components, self._changes = components, changes
        self._s, self._x = s[rows], x[rows]

    def __len__(self) -> int:
        return len(self._s)

    @property
    def until(self) -> Instant:
        """Return the instant of the last event."""
        return self._origin.plus(float(self._s[-1]))

    @property
    def times(self) -> np.ndarray:
        """Return the times of the events, rounded to doubles."""
        return np.array([float(self._origin.plus(s)) for s in self._s.tolist()])

    def times_of(self, component: str, kind: str | None) -> np.ndarray:
        """Return the times of the events of a component; all are transitions."""
        return self.times[self._are_of(component, kind)]

    def states_of(self, component: str, kind: str | None, side: int) -> np.ndarray:
        """Return the states (k, n) at events; they are equal on both sides of an event."""
        return self._x[self._are_of(component, kind)]

    def _are_of(self, component: str, kind: str | None) -> np.ndarray:
        names = [a.name for a in self._system.automata]
        if component not in names or kind not in (None, "transition"):
            return np.zeros(len(self), dtype=bool)
        return self._components == names.index(component)

    def kinds(self) -> Counter[str]:
        """Return the number of events of each kind; all are transitions."""
        return Counter({"transition": len(self)})

    def transitions(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Return instants and states of the events from the given number on; both sides have equal states."""
        instants = [self._origin.plus(s) for s in self._s[first:].tolist()]
        states = np.stack([self._x[first:]] * 2, axis=1)
        return np.array(instants).reshape(-1, 2), states

    def since(self, first: int) -> StepOccurrences:
        """Return a block of the events from the given number on."""
        later = copy(self)
        later._components, later._changes = self._components[first:], self._changes[first:]
        later._s, later._x = self._s[first:], self._x[first:]
        return later

    def __getitem__(self, i: Any, /) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        automaton, x = self._system.automata[self._components[i]], self._x[i]
        source, target = (automaton.modes[m] for m in self._changes[i].tolist())
        instant = self._origin.plus(float(self._s[i]))
        return Occurrence(instant, "transition", automaton.name, "", source, target, -1, x, x)
