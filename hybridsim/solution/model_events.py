"""This module reads the events of a run of a `Model` from its record."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.solution.event import Event

if TYPE_CHECKING:
    from hybridsim.engine.record.segments import Occurrence
    from hybridsim.engine.record.trajectory import Trajectory
    from hybridsim.engine.system.system import System


class ModelEvents:
    """The events of a run, as a part of `ModelTrajectory`."""

    system: System
    record: Trajectory
    t_start: Any  # first and last time; properties of `ModelTrajectory`
    t_end: Any

    @property
    def event_names(self) -> Sequence[str]:
        """Return the names of components, monitors and schedules."""
        return self.system.event_names

    @cached_property
    def occurrences(self) -> tuple[Occurrence, ...]:
        """Return the records of all events, including changes of side at corners."""
        return tuple(self.record.occurrences)

    @cached_property
    def event_positions(self) -> list[int]:
        """Return the index of each event among all records, which include changes of side at corners."""
        return [k for k, occurrence in enumerate(self.occurrences) if occurrence.kind != "corner"]

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """Return all events except changes of sign in corners such as abs."""
        return tuple(Event(float(o.instant), *o[1:]) for o in self.occurrences if o.kind != "corner")

    @cached_property
    def corners(self) -> tuple[Event, ...]:
        """Return the instants at which the argument of a corner changed its sign, as events."""
        return tuple(Event(float(o.instant), *o[1:]) for o in self.occurrences if o.kind == "corner")

    @cached_property
    def instants(self) -> np.ndarray:
        """Return the distinct times of all events, including corners, and of both ends of the run."""
        times = [block.times for block in self.record.occurrences.blocks]
        return np.unique(np.concatenate([[self.t_start, self.t_end], *times]))

    def event_times(self, component: str, kind: str | None) -> np.ndarray:
        """Return the times (m,) of the events of one component."""
        found = [block.times_of(component, kind) for block in self.record.occurrences.blocks]
        return found[0] if len(found) == 1 else np.concatenate([np.empty(0), *found])

    def event_states(self, component: str, kind: str | None, side: str) -> np.ndarray:
        """Return the states (m, n) at the events of one component."""
        blocks: list[Any] = self.record.occurrences.blocks
        found = [block.states_of(component, kind, "-+".index(side)) for block in blocks]
        if len(found) == 1 and len(found[0]):
            return found[0]
        return np.concatenate([np.empty((0, self.system.n)), *(states for states in found if len(states))])

    def kinds(self) -> Counter[str]:
        """Return how many events of each kind happened, including corners."""
        found: Counter[str] = Counter()
        for block in self.record.occurrences.blocks:
            found += block.kinds()
        return found
