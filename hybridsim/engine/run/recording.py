"""Record events: all events of one instant, and events inside a segment that do not end the segment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybridsim.engine.events.monitor_sides import MonitorSides
from hybridsim.engine.events.outcome import Change, Outcome
from hybridsim.engine.events.zeno.accumulation import Accumulation
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.run.segment_run import PassedMonitor, SegmentRun
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


class Recorder:
    """Appends the events of one instant to a record, with the states before (x-) and after (x+)."""

    def __init__(
        self, record: Trajectory, system: System, instant: Instant, x_minus: np.ndarray, x_plus: np.ndarray
    ) -> None:
        self.record, self.system, self.instant = record, system, instant
        self.states = x_minus, x_plus

    def changes(self, changes: Sequence[Change]) -> None:
        """Record the changes of mode at an instant, and count them as events."""
        for change in changes:
            automaton = self.system.automata[change.component]
            modes = automaton.modes[change.source], automaton.modes[change.target]
            self._append(automaton.kind, automaton.name, -1, change.guard, *modes)
        self.record.counters.events += len(changes)

    def schedules(self, schedules: Sequence[int]) -> list[str]:
        """Record the schedules that are due, and return the names of the schedules that end the run."""
        declared = [self.system.model.schedules[k] for k in schedules]
        for schedule in declared:
            self._append("scheduled", schedule.name, 0)
        return [schedule.name for schedule in declared if schedule.terminate]

    def fired(self, outcome: Outcome, monitors: MonitorSides, is_last: bool) -> list[str]:
        """Record the monitors that fire at an instant, and return the monitors that end the run.

        is_last: nothing else follows at this instant. Otherwise only monitors whose resets were applied are recorded.
        """
        is_last = is_last or bool(outcome.status)
        if is_last:
            monitors.fire(outcome)
            monitors.restore_hidden_sides(outcome)
        ended = []
        for k, direction in sorted(monitors.fired.items()):
            monitor = monitors.monitors[k]
            if k in monitors.recorded or not (is_last or monitor.action == "reset"):
                continue
            monitors.recorded.add(k)
            self.monitors([(monitor.name, direction)])
            ended += [monitor.name] if monitor.action == "terminate" else []
        return ended

    def monitors(self, seen: Sequence[tuple[str, int]]) -> None:
        """Record the monitors that fired, with the direction in which each one crossed zero."""
        for name, direction in seen:
            self._append("monitor", name, direction)

    def _append(
        self, kind: str, name: str, direction: int, guard: str = "", source: str = "", target: str = ""
    ) -> None:
        self.record.occurrences.append(
            Occurrence(self.instant, kind, name, guard, source, target, direction, *self.states)
        )


def passed_events(
    system: System, origin: Instant, run: SegmentRun, record: Trajectory, accumulation: Accumulation
) -> list[Occurrence]:
    """Return recorded monitors and near-grazings in order of time, and warn of near-grazings.

    Between accumulating events a guard stays near zero all the time, so its near-grazings there are left out.
    """
    passed = [(seen.s, _passed_monitor(system, origin, seen)) for seen in run.passed_monitors]
    declared = [g for g in run.grazings if not system.is_corner[system.owner[g[0]]]]
    if declared:
        accumulating = accumulation.under_way
        declared = [g for g in declared if int(system.owner[g[0]]) not in accumulating]
    if declared:
        times = np.array([s for _, s, _ in declared])
        states = run.flow.project(times, run.segment().dense(times))
        passed += [
            (s, _grazing(system, origin, run, guard, s, x, record))
            for (guard, s, _), x in zip(declared, states, strict=True)
        ]
    return [occurrence for _, occurrence in sorted(passed, key=lambda o: abs(o[0]))]


def _passed_monitor(system: System, origin: Instant, seen: PassedMonitor) -> Occurrence:
    name = system.monitor_names[seen.number]
    return Occurrence(origin.plus(seen.s), "monitor", name, "", "", "", seen.direction, seen.x, seen.x)


def _grazing(
    system: System, origin: Instant, run: SegmentRun, guard: int, s: float, x: np.ndarray, record: Trajectory
) -> Occurrence:
    c = int(system.owner[guard])
    automaton, number = system.automata[c], int(run.flow.z[c])
    mode = automaton.modes[number]
    name = automaton.guard_names[number][automaton.guards[number].index(guard)]
    record.warn(
        f"near-grazing: guard {name} of {automaton.name} in mode {mode} comes so close to zero that rounding hides "
        "its sign"
    )
    return Occurrence(origin.plus(s), "near-grazing", automaton.name, name, mode, mode, 0, x, x)
