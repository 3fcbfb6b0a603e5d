"""Stretches of fixed steps as blocks: the rows that a kernel wrote, made into segments and events when asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.engine.blocks import OccurrenceList, SegmentList
from hybridsim.engine.fixed_dense import StepDense
from hybridsim.engine.pieces import Occurrence, Segment
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant


class StepSegments(Sequence[Segment]):
    """The segments of one stretch: a segment for each run of rows in the same modes.

    Parameters
    ----------
    origin, p : instant from which local times count, run-time vector of the stretch.
    s, x, z : (m + 1,), (m + 1, n), (m + 1, C): where each step begins and its modes; the last row is the end.
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

    def __len__(self) -> int:
        return len(self._first)

    @property
    def until(self) -> Instant:
        """End of the last one."""
        return self._origin.plus(float(self._s[self._last[-1]]))

    @cached_property
    def _made(self) -> SegmentList:
        segments = SegmentList(self._system)
        for first, last in zip(self._first.tolist(), self._last.tolist(), strict=True):
            rows = slice(first, last + 1)
            dense = StepDense(
                self._system, self._p, self._z[first].copy(), self._s[rows].copy(), self._x[rows].copy()
            )
            segments.append(Segment(self._origin, dense.z, self._p, dense.s, dense.x, dense))
        return segments

    @property
    def origins(self) -> np.ndarray:
        """Origins of local time (N, 2)."""
        return np.tile(np.array(self._origin), (len(self), 1))

    @property
    def spans(self) -> np.ndarray:
        """First and last local time (N, 2)."""
        return np.stack([self._s[self._first], self._s[self._last]], axis=1)

    @property
    def modes(self) -> np.ndarray:
        """Modes (N, C)."""
        return self._z[self._first]

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """States (k, n) in the segments of these numbers, at local times (k,)."""
        return self._made.states(index, s)

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers of segments, local times, states of all steps."""
        return self._made.knots()

    def since(self, first: int) -> SegmentList:
        """Those from the first on."""
        return self._made.since(first)

    def __getitem__(self, i: Any, /) -> Any:
        return self._made[i]

    def __iter__(self) -> Iterator[Segment]:
        return iter(self._made)


class StepOccurrences(Sequence[Occurrence]):
    """The changes of mode in one stretch.

    Parameters
    ----------
    rows, components : (E,) the row at which each happens, in order, and the component that changes.
    sources, targets : (E,) its modes.
    s, x : local times and states of all rows of the stretch.
    """

    def __init__(
        self,
        system: System,
        origin: Instant,
        rows: np.ndarray,
        components: np.ndarray,
        sources: np.ndarray,
        targets: np.ndarray,
        s: np.ndarray,
        x: np.ndarray,
    ) -> None:
        self._system, self._origin, self._components = system, origin, components
        self._sources, self._targets = sources, targets
        self._s, self._x = s[rows], x[rows]

    def __len__(self) -> int:
        return len(self._s)

    @property
    def until(self) -> Instant:
        """Time of the last one."""
        return self._origin.plus(float(self._s[-1]))

    @cached_property
    def _made(self) -> OccurrenceList:
        found = OccurrenceList()
        rows = zip(
            self._components.tolist(), self._sources.tolist(), self._targets.tolist(), self._s.tolist(), self._x,
            strict=True,
        )  # fmt: skip
        for c, source, target, s, x in rows:
            automaton = self._system.automata[c]
            modes = (automaton.modes[source], automaton.modes[target])
            found.append(Occurrence(self._origin.plus(s), "transition", automaton.name, "", *modes, -1, x, x))
        return found

    @property
    def times(self) -> np.ndarray:
        """Times rounded to doubles."""
        return self._made.times

    def chosen(self, component: str, kind: str | None) -> np.ndarray:
        """Mask of those of a component and kind."""
        return self._made.chosen(component, kind)

    def since(self, first: int) -> OccurrenceList:
        """Those from the first on."""
        return self._made.since(first)

    def __getitem__(self, i: Any, /) -> Any:
        return self._made[i]

    def __iter__(self) -> Iterator[Occurrence]:
        return iter(self._made)
