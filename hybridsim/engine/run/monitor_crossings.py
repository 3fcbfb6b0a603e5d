"""Collect events that did not end a segment: recorded monitors and near-grazings of guards."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.record.trajectory import Trajectory
from hybridsim.engine.run.segment_run import PassedMonitor, SegmentRun
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


def passed_events(system: System, origin: Instant, run: SegmentRun, record: Trajectory) -> list[Occurrence]:
    """Return recorded monitors and near-grazings in order of time; warn of near-grazings in the record."""
    passed = [(seen.s, _passed_monitor(system, origin, seen)) for seen in run.passed_monitors]
    declared = [g for g in run.grazings if not system.is_corner[system.owner[g[0]]]]
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
        f"near-grazing: guard {name} of {automaton.name} in mode {mode} comes within rounding of zero"
    )
    return Occurrence(origin.plus(s), "near-grazing", automaton.name, name, mode, mode, 0, x, x)
