"""What a run leaves behind, in blocks: items that came one by one, and whole stretches that stand in arrays.

A compiled loop goes over hundreds of events in the time in which Python makes a few objects. It commits one block of
segments and one of occurrences for each of its calls, holding the arrays that it wrote; the objects are made when
somebody asks for them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Protocol, TypeVar

import numpy as np

from hybridsim.engine.record.segments import Occurrence, Segment, end_point
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System

Item = TypeVar("Item", covariant=True)


class Block(Protocol[Item]):
    """Consecutive items of a run; an index is from 0 to below the length."""

    def __len__(self) -> int: ...
    def __getitem__(self, i: int, /) -> Item: ...
    def __iter__(self) -> Iterator[Item]: ...

    @property
    def until(self) -> Instant:
        """The instant of the last item: the end of a segment, the time of an event."""

    def since(self, first: int) -> Block[Item]:
        """The same without the items before the first one."""


class SegmentBlock(Block[Segment], Protocol):
    """N consecutive segments. `hybridsim.engine.record.series_block` is an example.

    1. origins (N, 2): the instant (high, low) from which the local time of each is counted.
    2. spans (N, 2): the local times at which it begins and ends; forward in time the first is below the second.
    3. modes (N, C): the mode of each component.
    4. ``block[i]`` is the i-th one as a `Segment`, its knots' states with held ones on their constraints.
    5. Times and states are those that the run went by: the states at both ends of a segment are to the last bit the
       x+ and x- of the events there.
    """

    @property
    def origins(self) -> np.ndarray: ...
    @property
    def spans(self) -> np.ndarray: ...
    @property
    def modes(self) -> np.ndarray: ...

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """States (k, n) in the segments of these numbers (k,), at local times (k,) within their spans.

        Held states are on their constraints. All in one compiled call: there may be thousands.
        """

    def at_end(self) -> Segment:
        """The end of the last one, as a segment of no length, in arrays of its own."""

    def steps_of(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Knots (m + 1,), states where the steps begin (m or more, n), run-time vector and modes of one of them."""

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The run's own steps: numbers of segments (m,) ascending, local times (m,), states (m, n); ends included."""

    def since(self, first: int) -> SegmentBlock:
        """The same without the segments before the first one."""


class OccurrenceBlock(Block[Occurrence], Protocol):
    """Consecutive occurrences. `hybridsim.engine.record.event_block` serves every compiled loop."""

    @property
    def times(self) -> np.ndarray:
        """Their times, rounded to doubles."""

    def times_of(self, component: str, kind: str | None) -> np.ndarray:
        """Times of those of a component, and of one kind if that is given."""

    def states_of(self, component: str, kind: str | None, side: int) -> np.ndarray:
        """States (k, n) at the same, before (side 0) or after (1) them, in an array of their own."""

    def kinds(self) -> Counter[str]:
        """How many there are of each kind."""

    def transitions(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Instants (k, 2) and states x-, x+ (k, 2, n) of those that are transitions, from that number on."""

    def since(self, first: int) -> OccurrenceBlock:
        """The same without the items before the first one."""


class SegmentList(list[Segment]):
    """Segments as objects; see `SegmentBlock`."""

    def __init__(self, system: System, segments: Iterable[Segment] = ()) -> None:
        super().__init__(segments)
        self._system = system

    @property
    def until(self) -> Instant:
        """End of the last one."""
        return self[-1].end

    @property
    def origins(self) -> np.ndarray:
        """Origins of local time (N, 2)."""
        return np.array([segment.origin for segment in self]).reshape(-1, 2)

    @property
    def spans(self) -> np.ndarray:
        """First and last local time (N, 2)."""
        return np.array([(segment.s[0], segment.s[-1]) for segment in self]).reshape(-1, 2)

    @property
    def modes(self) -> np.ndarray:
        """Modes (N, C)."""
        return np.array([segment.z for segment in self], dtype=np.int64).reshape(len(self), -1)

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """States (k, n) at local times (k,) of some of them; at knots those that the run went by."""
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
        """The end of the last one."""
        last = self[-1]
        return end_point(last.end, last.z, last.p, last.x[-1])

    def steps_of(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Knots, states, run-time vector and modes of one of them."""
        segment = self[i]
        return segment.s, segment.x, segment.p, segment.z

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers of segments, local times, states of all steps."""
        index = np.repeat(np.arange(len(self)), [len(segment.s) for segment in self])
        s, x = [segment.s for segment in self], [segment.x for segment in self]
        return index, np.concatenate(s), np.concatenate(x)

    def since(self, first: int) -> SegmentList:
        """Those from the first on."""
        return SegmentList(self._system, self[first:])


class OccurrenceList(list[Occurrence]):
    """Occurrences as objects; see `OccurrenceBlock`."""

    @property
    def until(self) -> Instant:
        """Time of the last one."""
        return self[-1].instant

    @property
    def times(self) -> np.ndarray:
        """Times rounded to doubles."""
        return np.array([float(o.instant) for o in self])

    def times_of(self, component: str, kind: str | None) -> np.ndarray:
        """Times of those of a component and kind."""
        return np.array([float(o.instant) for o in self._of(component, kind)])

    def states_of(self, component: str, kind: str | None, side: int) -> np.ndarray:
        """States (k, n) at the same, before (side 0) or after (1) them."""
        found = [(o.x_minus, o.x_plus)[side] for o in self._of(component, kind)]
        return np.array(found) if found else np.empty((0, 0))

    def _of(self, component: str, kind: str | None) -> list[Occurrence]:
        return [o for o in self if o.component == component and kind in (None, o.kind)]

    def kinds(self) -> Counter[str]:
        """How many there are of each kind."""
        return Counter(o.kind for o in self)

    def transitions(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Instants and states of those that are transitions, from that number on."""
        chosen = [o for o in self[first:] if o.kind == "transition"]
        if not chosen:
            return np.empty((0, 2)), np.empty((0, 2, 0))
        return np.array([o.instant for o in chosen]), np.array([(o.x_minus, o.x_plus) for o in chosen])

    def since(self, first: int) -> OccurrenceList:
        """Those from the first on."""
        return OccurrenceList(self[first:])
