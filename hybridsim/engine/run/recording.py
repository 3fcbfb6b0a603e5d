"""Record what happens at one instant of a run: changes of mode, schedules and monitors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybridsim.engine.events.outcome import Change
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


class Recorder:
    """Appends the events of one instant to a record, with the states x- and x+ (n,) there."""

    def __init__(
        self, record: Trajectory, system: System, instant: Instant, x_minus: np.ndarray, x_plus: np.ndarray
    ) -> None:
        self.record, self.system, self.instant = record, system, instant
        self.states = x_minus, x_plus

    def changes(self, changes: Sequence[Change]) -> None:
        """Record changes of mode, and count them as events."""
        for change in changes:
            automaton = self.system.automata[change.component]
            modes = automaton.modes[change.source], automaton.modes[change.target]
            self._append(automaton.kind, automaton.name, -1, change.guard, *modes)
        self.record.counters.events += len(changes)

    def schedules(self, schedules: Sequence[int]) -> list[str]:
        """Record schedules; return the names of those that end the run."""
        declared = [self.system.model.schedules[k] for k in schedules]
        for schedule in declared:
            self._append("scheduled", schedule.name, 0)
        return [schedule.name for schedule in declared if schedule.terminate]

    def monitors(self, seen: Sequence[tuple[str, int]]) -> None:
        """Record monitors, with the direction in which each crossed zero."""
        for name, direction in seen:
            self._append("monitor", name, direction)

    def _append(
        self, kind: str, name: str, direction: int, guard: str = "", source: str = "", target: str = ""
    ) -> None:
        self.record.occurrences.append(
            Occurrence(self.instant, kind, name, guard, source, target, direction, *self.states)
        )
