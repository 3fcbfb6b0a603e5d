"""This module stores segments and events of a run in blocks: lists of objects, or arrays.

A compiled loop passes hundreds of events in the time in which Python makes a few objects. It commits one block of
segments and one of events for each of its calls, with the arrays that it wrote. Objects are made on demand.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np

from hybridsim.engine.record.segments import Dense, Occurrence, Segment, end_point
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

Item = TypeVar("Item", covariant=True)


class Block(Protocol[Item]):
    """Consecutive segments or events of a run, with indices from 0."""

    def __len__(self) -> int: ...
    def __getitem__(self, i: int, /) -> Item: ...
    def __iter__(self) -> Iterator[Item]: ...

    @property
    def until(self) -> Instant:
        """Return the end of the last segment, or the time of the last event."""

    def since(self, first: int) -> Block[Item]:
        """Return a block of the segments or events, starting with a given number."""


class SegmentBlock(Sequence[Segment]):
    """Consecutive segments of a run in arrays, with one row for each segment.

    1. ``block[i]`` is the i-th segment as a `Segment`, with held states at its knots on their constraints.
    2. Times and states are those that the run used. The states at both ends of a segment are bit for bit the x+ and x-
       of the events there.
    """

    origins: np.ndarray  # (N, 2) instants (high, low) from which the local time of each segment is counted
    modes: np.ndarray  # (N, C) modes of the components
    vectors: np.ndarray  # (N, P) run-time vectors
    spans: Any  # (N, 2) first and last local times, ascending if time runs forward; a property

    @abstractmethod
    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,) in the segments with the given numbers (k,).

        Held states are on their constraints. One compiled call computes all states, because there may be thousands.
        """

    @abstractmethod
    def steps_of(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the step times, the states at steps, the run-time vector and the modes of a segment."""

    @abstractmethod
    def motion(self, i: int) -> tuple[np.ndarray, np.ndarray, Dense]:
        """Return the step times (m + 1,), the states (m + 1, n) and the dense output of a segment."""

    @abstractmethod
    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return all steps with the ends of segments: segment numbers (m,), local times (m,) and states (m, n)."""

    @abstractmethod
    def since(self, first: int) -> SegmentBlock:
        """Return a block of the segments, starting with the segment of a given number."""

    @property
    @abstractmethod
    def last(self) -> np.ndarray:
        """Return the states (n,) just before the end of the last segment."""

    def __len__(self) -> int:
        return len(self.origins)

    @property
    def until(self) -> Instant:
        """Return the instant at which the last segment ends."""
        return Instant(*self.origins[-1].tolist()).plus(float(self.spans[-1, 1]))

    def at_end(self) -> Segment:
        """Return the end of the last segment as a segment of zero length with its own arrays."""
        return end_point(self.until, self.modes[-1], self.vectors[-1], self.last)

    def __getitem__(self, i: Any, /) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        i = range(len(self))[i]
        return Segment(Instant(*self.origins[i].tolist()), self.modes[i], self.vectors[i], *self.motion(i))


class SegmentList(list[Segment]):
    """Segments of a run as a list of objects."""

    def __init__(self, system: System, segments: Iterable[Segment] = ()) -> None:
        super().__init__(segments)
        self._system = system

    @property
    def until(self) -> Instant:
        """Return the instant at which the last segment ends."""
        return self[-1].end

    @property
    def origins(self) -> np.ndarray:
        """Return the origin of local time of each segment (N, 2)."""
        return np.array([segment.origin for segment in self]).reshape(-1, 2)

    @property
    def spans(self) -> np.ndarray:
        """Return the first and last local time of each segment (N, 2)."""
        return np.array([(segment.s[0], segment.s[-1]) for segment in self]).reshape(-1, 2)

    @property
    def modes(self) -> np.ndarray:
        """Return the modes of each segment (N, C)."""
        return np.array([segment.z for segment in self], dtype=np.int64).reshape(len(self), -1)

    @property
    def vectors(self) -> np.ndarray:
        """Return the run-time vector of each segment (N, P)."""
        return np.array([segment.p for segment in self]).reshape(len(self), -1)

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) of some segments at local times (k,), exact at the knots of the run."""
        system = self._system
        out = np.empty((len(s), system.n))
        for i in np.unique(index):
            chosen, segment = np.flatnonzero(index == i), self[i]
            at = s[chosen]
            x = np.ascontiguousarray(segment.dense(at), dtype=float)
            if segment.s[-1] >= segment.s[0]:
                nearest = np.searchsorted(segment.s, at)
                same = segment.s[np.minimum(nearest, len(segment.s) - 1)] == at
                x[same] = segment.x[nearest[same]]
            out[chosen] = (
                system.rows("project", system.n, at, x, segment.p, segment.z) if system.can_hold else x
            )
        return out

    def at_end(self) -> Segment:
        """Return a segment of zero length at the end of the last segment."""
        last = self[-1]
        return end_point(last.end, last.z, last.p, last.x[-1])

    def steps_of(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the step times, the states, the run-time vector and the modes of one segment."""
        segment = self[i]
        return segment.s, segment.x, segment.p, segment.z

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the segment numbers, the local times and the states of all steps."""
        index = np.repeat(np.arange(len(self)), [len(segment.s) for segment in self])
        s, x = [segment.s for segment in self], [segment.x for segment in self]
        return index, np.concatenate(s), np.concatenate(x)

    def since(self, first: int) -> SegmentList:
        """Return a block of the segments, starting with the segment of a given number."""
        return SegmentList(self._system, self[first:])


class OccurrenceList(list[Occurrence]):
    """Events of a run as a list of objects."""

    @property
    def until(self) -> Instant:
        """Return the instant of the last event."""
        return self[-1].instant

    @property
    def times(self) -> np.ndarray:
        """Return the times of the events, rounded to doubles."""
        return np.array([float(o.instant) for o in self])

    def times_of(self, component: str, kind: str | None) -> np.ndarray:
        """Return the times of the events of one component and one kind."""
        return np.array([float(o.instant) for o in self._of(component, kind)])

    def states_of(self, component: str, kind: str | None, side: int) -> np.ndarray:
        """Return the states (k, n) at events, before (side 0) or after (side 1) each event."""
        found = [(o.x_minus, o.x_plus)[side] for o in self._of(component, kind)]
        return np.array(found) if found else np.empty((0, 0))

    def _of(self, component: str, kind: str | None) -> list[Occurrence]:
        return [o for o in self if o.component == component and kind in (None, o.kind)]

    def kinds(self) -> Counter[str]:
        """Return the number of events of each kind."""
        return Counter(o.kind for o in self)

    def transitions(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Return instants (k, 2) and states (k, 2, n) of the transitions, starting with a given event."""
        chosen = [o for o in self[first:] if o.kind == "transition"]
        if not chosen:
            return np.empty((0, 2)), np.empty((0, 2, 0))
        return np.array([o.instant for o in chosen]), np.array([(o.x_minus, o.x_plus) for o in chosen])

    def since(self, first: int) -> OccurrenceList:
        """Return a block of the events, starting with the event of a given number."""
        return OccurrenceList(self[first:])
