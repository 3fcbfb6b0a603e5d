"""This module repeats the decisions of one instant in order: guards, monitor resets, due events."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.engine.events.due_changes import situation_when_due
from hybridsim.engine.events.input_jumps import surfaces_jump
from hybridsim.engine.events.monitor_sides import MonitorSides
from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.native.model_functions import evaluate_rows
from hybridsim.engine.run.appointment_events import events_before_appointment
from hybridsim.engine.run.located import Located
from hybridsim.engine.series.bounded import UNIT
from hybridsim.integrators.contract import Integrator
from hybridsim.solution.explain.one_instant import LOCATED
from hybridsim.solution.explain.recorded_resolution import RecordedResolution
from hybridsim.solution.run import Run

if TYPE_CHECKING:
    from hybridsim.engine.events.outcome import Change, Outcome
    from hybridsim.engine.record.segments import Occurrence, Segment
    from hybridsim.engine.system.instant import Instant
    from hybridsim.engine.system.system import System


@dataclass(frozen=True)
class Stage:
    """One choice of modes at an instant, with the changes that followed from it.

    Parameters
    ----------
    before : the situation at its start.
    fired : numbers of the guards that were located at zero.
    due : its other causes in words; empty without any.
    """

    before: Situation
    resolution: RecordedResolution
    outcome: Outcome
    fired: tuple[int, ...] = ()
    due: str = ""

    @property
    def changes(self) -> list[Change]:
        """Return the changes of mode that the run records as transitions."""
        return [c for c in self.resolution.changes if not self.resolution.system.is_corner[c.component]]


@dataclass(frozen=True)
class Place:
    """A change of mode, with the choice of modes (stage) that made it."""

    stage: Stage
    change: Change | None


def place_of(
    run: Run, segment: Segment, together: Sequence[Occurrence], fired: list[int], occurrence: Occurrence
) -> Place | None:
    """Return the choice of modes that made a transition, found among the records of the same instant."""
    instant = _Instant(run, segment, together)
    stages = list(instant.located(fired))
    found, left = _matched(run.system, instant.transitions, stages)
    if left and type(run.method).run is Integrator.run:
        crossed = instant.crossed(stages[-1]) if stages else None
        stages += [] if crossed is None else [crossed]
        found, left = _matched(run.system, instant.transitions, stages)
        stages += instant.due(stages[-1] if stages else None, left[0] if left else None)
        found, left = _matched(run.system, instant.transitions, stages)
    number = next(k for k, o in enumerate(instant.transitions) if o is occurrence)
    if number in found:
        return found[number]
    return Place(stages[0], None) if fired and stages else None


def _matched(
    system: System, transitions: Sequence[Occurrence], stages: Sequence[Stage]
) -> tuple[dict[int, Place], list[Occurrence]]:
    """Find the stage that made each transition; return places by transition number, and transitions without a stage."""
    made = [Place(stage, change) for stage in stages for change in stage.changes]
    found, left, start = {}, [], 0
    for number, occurrence in enumerate(transitions):
        for k in range(start, len(made)):
            if _is_of(system, made[k].change, occurrence):
                found[number], start = made[k], k + 1
                break
        else:
            left.append(occurrence)
    return found, left


def _is_of(system: System, change: Change | None, occurrence: Occurrence) -> bool:
    assert change is not None
    automaton = system.automata[change.component]
    modes = automaton.modes[change.source], automaton.modes[change.target]
    return automaton.name == occurrence.component and modes == (occurrence.source, occurrence.target)


class _Instant:
    """An instant of a run, with the segment that ended at the instant and the records of the instant."""

    def __init__(self, run: Run, segment: Segment, together: Sequence[Occurrence]) -> None:
        self.system, self.task, self.segment, self.together = run.system, run.task, segment, together
        self.transitions = [o for o in together if o.kind == "transition"]
        self.instant, self.is_general = together[0].instant, type(run.method).run is Integrator.run
        model = self.system.model
        declared = [schedule.name for schedule in model.schedules]
        self.schedules = tuple(declared.index(o.component) for o in together if o.kind == "scheduled")
        self.knots = _knots(self.system, segment, self.instant, self.task.forward)
        names = {o.component: o.direction for o in together if o.kind == "monitor"}
        resetting = [
            k
            for k, m in enumerate(model.monitors)
            if m.name in names and ("monitor", k) in self.system.resets
        ]
        at = situation(self.system, segment, [])
        self.monitors = {k: names[model.monitors[k].name] for k in resetting}
        series = self.system.series(at.s, at.x, at.p, at.z, at.x_error, at.s_error) if resetting else None
        self.stopping = [
            k
            for k in resetting
            if series is not None
            and not abs(series.monitors[k, 0]) > LOCATED * max(series.monitor_bounds[k, 0], math.ulp(0.0))
        ]

    def located(self, fired: list[int]) -> list[Stage]:
        """Return the choices of modes that followed from guards and monitors located at zero."""
        at = situation(self.system, self.segment, fired)
        found = self._nothing(at, {g: k for k, g in enumerate(fired)})
        if self.is_general and (self.schedules or self.knots) and (fired or self.stopping):
            found = events_before_appointment(
                self.system, self.instant, found, self.schedules, self.task.forward
            )
        if not (found.fired or self.stopping):
            return []
        return [self._settled(found, self.stopping, (), begins=found.inputs is not None)]

    def _nothing(self, at: Situation, fired: dict[int, int] | None = None) -> Located:
        """Return a `Located` with the given guards at zero and no monitors at zero."""
        monitors = self.system.model.monitors
        none = MonitorSides.of(monitors, np.zeros(len(monitors), dtype=np.int64))
        return Located(at, fired or {}, none, True)

    def crossed(self, stage: Stage) -> Stage | None:
        """Return the choice of modes after monitor resets that an earlier choice caused, or None."""
        sides = stage.outcome.monitor_sides
        crossed = [k for k, way in self.monitors.items() if k not in self.stopping and sides[k] != -way]
        if not crossed:
            return None
        s, of = stage.before.s, stage.outcome
        at = Situation(s, of.x.copy(), of.p, of.z.copy(), of.x_error, math.ulp(s))
        return self._settled(self._nothing(at), crossed, ())

    def due(self, stage: Stage | None, first: Occurrence | None) -> list[Stage]:
        """Return the choices of modes that followed from due events, and from monitors that these events fired."""
        system, segment = self.system, self.segment
        if first is None or not (self.schedules or self.knots):
            return []
        x = next((o for o in self.together if o.kind == "scheduled"), first).x_minus
        z = segment.z if stage is None else stage.outcome.z
        before = segment.p if stage is None else stage.outcome.p
        error = situation(system, segment, []).x_error
        at = situation_when_due(system, self.task.forward, self.instant, before, x, z, error)
        found = self._settled(self._nothing(at), (), self.schedules, begins=True)
        crossed = self.crossed(found)
        return [found] if crossed is None else [found, crossed]

    def _settled(
        self, found: Located, monitors: Sequence[int], schedules: Sequence[int], begins: bool = False
    ) -> Stage:
        """Choose the modes once; `begins` is true if an input begins a new piece at this instant."""
        system, model, at = self.system, self.system.model, found.at
        keys = [("monitor", k) for k in monitors] + [("schedule", k) for k in schedules]
        before = Situation(at.s, at.x.copy(), at.p.copy(), at.z.copy(), at.x_error.copy(), at.s_error)
        causes = [
            f"{model.monitors[k].name} crossed zero{_set_by(system, ('monitor', k), at)}" for k in monitors
        ]
        causes += [
            f"{model.schedules[k].name} was due at this instant{_set_by(system, ('schedule', k), at)}"
            for k in schedules
        ]
        resolution = RecordedResolution(
            system, at, at.z.copy(), self.task.forward, found.scope(system), found.inputs
        )
        if begins:
            resolution.jumped = surfaces_jump(system, self.instant, at, self.task.forward)
            causes += _knots_text(system, self.knots, self.instant, at, self.task.forward)
        outcome = resolution.run(found.fired, list(keys))
        return Stage(before, resolution, outcome, tuple(found.fired), " and ".join(causes))


def situation(system: System, segment: Segment, fired: list[int]) -> Situation:
    """Return the state before an event, with the rounding bounds that the run used."""
    s, x = float(segment.s[-1]), segment.x[-1].copy()
    s_error = 2.0 * math.ulp(s)
    series = system.series(s, x, segment.p, segment.z, np.zeros(system.n), 0.0)
    for value, slope, *_ in (series.guards[g] for g in fired):
        if slope != 0.0 and math.isfinite(value / slope):
            s_error = max(s_error, abs(value / slope))
    slopes = np.abs(system.flow(s, x, segment.p, segment.z)) if system.n else np.zeros(0)
    x_error = 4.0 * UNIT * np.abs(segment.x).max(axis=0) + s_error * slopes
    held = system.evaluated(segment.z)
    x_error[held] = UNIT * np.abs(x[held])
    return Situation(s, x, segment.p.copy(), segment.z.copy(), x_error, s_error)


def _set_by(system: System, key: tuple[Any, ...], at: Situation) -> str:
    """Describe the old and new values of the states that one reset sets."""
    if key not in system.resets:
        return ""
    x, p = at.x.copy(), at.p.copy()
    system.apply_reset(key, at.s, at.x, at.p, at.z, x, p)
    names = [*system.names, *(d.name for d in system.model.discrete)]
    before, after = (np.concatenate([a, b[system.layout.discrete_slice]]) for a, b in ((at.x, at.p), (x, p)))
    set_ = [names.index(name) for name in system.resets[key][1]]
    return " and set " + ", ".join(f"{names[k]} from {before[k]:.6g} to {after[k]:.6g}" for k in set_)


def _knots(system: System, segment: Segment, instant: Instant, forward: bool) -> list[str]:
    """Return the names of the inputs that have a knot at this instant."""
    found = []
    for declared, signal in zip(system.model.inputs, system.signals, strict=True):
        knot = signal.next_knot(segment.start, forward)
        if knot is not None and abs(knot.minus(instant)) <= 2.0 * math.ulp(float(instant)):
            found.append(declared.name)
    return found


def _knots_text(
    system: System, names: list[str], instant: Instant, at: Situation, forward: bool
) -> list[str]:
    """Describe the inputs with a knot at this instant, and the jumps of their values."""
    if not names:
        return []
    vectors = (system.vector(instant, system.discrete(at.p), not forward), at.p)
    known, values = system.quantities, []
    for p in vectors:
        out = np.empty((1, len(known)))
        evaluate_rows(
            system.address("quantities"), np.zeros(1), np.ascontiguousarray(at.x[None]), p, at.z, out
        )
        values.append(out[0])
    shown = {i.name: i.subject.removeprefix("input ") for i in system.model.inputs}
    jumps = [
        f"{shown[name]} jumps from {values[0][k]:.6g} to {values[1][k]:.6g}"
        for name in names
        if name in known and values[0][k := known.index(name)] != values[1][k]
    ]
    text = f"an input has a knot here ({', '.join(shown[name] for name in names)})"
    return [text + (f", where {' and '.join(jumps)}" if jumps else "")]
