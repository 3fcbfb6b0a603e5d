"""This module defines the position of a simulator: a checkpoint of its run."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.record.checkpoint import Checkpoint
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.retention import ALL, EVENTS
from hybridsim.engine.record.segments import end_point
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.run.mode_loop import ModeLoop
from hybridsim.engine.run.resume_point import ResumePoint
from hybridsim.engine.run.setup import setup_of
from hybridsim.engine.system.instant import Instant
from hybridsim.errors import SimulationError, UsageError, nearest
from hybridsim.integrators.contract import Integrator
from hybridsim.model.checks.denominators import denominators
from hybridsim.model.parts.inputs import HeldInput
from hybridsim.simulator.held_inputs import InputChange
from hybridsim.solution.event import Event
from hybridsim.solution.model_trajectory import ModelTrajectory
from hybridsim.solution.poles import end_at_pole
from hybridsim.solution.run import Run


class Position(NamedTuple):
    """The state of a simulator between two calls. It never changes; a call makes a new state.

    Parameters
    ----------
    run : the model, the system, the method and the settings.
    point : the state just after the last committed event.
    events : events that happened but were not returned yet, because an exception ended the call.
    ended : why the run has ended, or nothing.
    """

    run: Run
    point: ResumePoint
    warnings: dict[str, int]
    events: tuple[Event, ...] = ()
    ended: str = ""

    @classmethod
    def at(cls, run: Run, checkpoint: Checkpoint, counters: Counters, *rest: Any) -> Position:
        """Return the position at a checkpoint of the run."""
        point = ResumePoint(setup_of(run.system, run.method, run.task), run.task, checkpoint, counters)
        return cls(run, point, *rest)

    @property
    def checkpoint(self) -> Checkpoint:
        """Return the checkpoint at this position."""
        return self.point.checkpoint

    @property
    def t(self) -> float:
        """Return the time."""
        return float(self.point.instant)

    @property
    def x(self) -> np.ndarray:
        """Return the states (n,)."""
        return self.point.x

    @property
    def z(self) -> np.ndarray:
        """Return the modes (C,)."""
        return self.point.z

    @property
    def discrete(self) -> np.ndarray:
        """Return the discrete states and held inputs."""
        return self.point.discrete

    @property
    def held_indices(self) -> dict[str, int]:
        """Return the index of each held input in `discrete`."""
        model = self.run.model
        found: dict[str, int] = model.once(
            "held inputs",
            lambda: {d.name: k for k, d in enumerate(model.discrete) if isinstance(d, HeldInput)},
        )
        return found

    def value(self, name: str) -> float:
        """Return a state, an output or another quantity."""
        system, instant = self.run.system, self.point.instant
        p = system.vector(instant, self.discrete)
        trajectory = ModelTrajectory(self.run, Trajectory(system), 0.0, 0.0)
        known = (*trajectory.names, *trajectory.quantities)
        if not isinstance(name, str) or name not in known:
            raise UsageError(
                f"model {self.run.model.name} has no quantity {name!r}",
                remedy=nearest(str(name), known, kind="quantities"),
            )
        segment = end_point(instant, self.z, p, self.x)
        return float(trajectory.values_at([name], segment, segment.s, segment.x)[0][0])


def begun(run: Run, commit: Callable[[Position], None]) -> None:
    """Pass the position just after the start of a run to the function `commit`."""
    run = stepped(run)
    empty = Position.at(run, Checkpoint(Instant(run.task.t0), {}, None, {}), Counters(), {})
    _follow(empty, run.task, lambda task: run.method.run(run.system, task), commit)


def stepped(run: Run) -> Run:
    """Return a prepared run for single steps; the run stores events, and states only if poles are possible."""
    retention = ALL if denominators(run.model) else EVENTS
    return replace(run, task=replace(run.task, is_stepped=True, retention=retention))


def advanced(position: Position, to: float, commit: Callable[[Position], None]) -> None:
    """Advance to a later time, and pass `commit` the position there, or at the last event if a step fails."""
    run, step = position.run, position.point.step(Instant(to))
    if isinstance(step, ResumePoint):
        commit(Position(run, step, position.warnings, position.events))
        return

    def go(task: Task) -> Trajectory:
        if step is None:
            return run.method.run(run.system, task)
        return ModeLoop(run.system, run.method, task, None, step).run()

    _follow(position, _task(position, to), go, commit)


def changed(position: Position, discrete: np.ndarray, commit: Callable[[Position], None]) -> None:
    """Pass a position with other values of discrete states and held inputs to the function `commit`."""
    run, point = position.run, position.point.changed(discrete)
    if point is not None:
        commit(Position(run, point, position.warnings, position.events))
        return
    if type(run.method).run is Integrator.run:
        task = _task(position, position.t)
        _follow(
            position, task, lambda task: InputChange(run.system, run.method, task, discrete).run(), commit
        )
        return
    # a method with fixed steps judges modes at the beginning of its next step
    checkpoint = position.checkpoint
    arrays = checkpoint.arrays | {"discrete": discrete, "turned": np.array(True)}
    rest = position.point.counters, position.warnings, position.events, position.ended
    commit(Position.at(run, replace(checkpoint, arrays=arrays), *rest))


def _task(position: Position, to: float) -> Task:
    """Return the task from a position to a time."""
    run, record = position.run, Trajectory(position.run.system, position.run.task.retention)
    record.checkpoint = position.checkpoint
    record.counters, record.warnings = position.point.counters.copy(), dict(position.warnings)
    task = replace(run.task, t0=position.t, t1=to, record=record)
    setup = copy(setup_of(run.system, run.method, run.task))  # its compiled loop serves all spans
    setup.origin, setup.end = Instant(task.t0), Instant(task.t1)
    task.setups["last"] = setup
    return task


def _follow(
    position: Position, task: Task, go: Callable[[Task], Trajectory], commit: Callable[[Position], None]
) -> None:
    """Carry out a task, and pass `commit` the position at its end, or at the last event before an error."""
    record = task.record
    try:
        record = go(task)
    except BaseException:
        if record is not None:
            record.seal()
            _commit(position, record, commit)
        raise
    end_at_pole(position.run.system, record)
    _commit(position, record, commit)
    if record.status == "interrupted":
        raise KeyboardInterrupt(record.message)
    if record.status not in ("finished", "terminated"):
        raise SimulationError(
            f"{position.run.model.name}: {record.status}, {record.message}",
            remedy="call sim.restore() or sim.start(); the simulator is now just after the last completed event",
        )


def _commit(position: Position, record: Trajectory, commit: Callable[[Position], None]) -> None:
    checkpoint = record.checkpoint
    if checkpoint is None:
        return
    happened: list[Any] = list(record.occurrences)
    happened = happened[: len(happened) - checkpoint.occurrences]
    events = [Event(float(o.instant), *o[1:]) for o in happened if o.kind != "corner"]
    checkpoint = replace(checkpoint, segments=0, occurrences=0)
    ended = record.message if record.status == "terminated" else ""
    rest = record.counters, record.warnings, (*position.events, *events), ended
    commit(Position.at(position.run, checkpoint, *rest))


def require_running(position: Position | None, call: str) -> Position:
    """Return the position of a simulator that has started and has not ended."""
    if position is None:
        raise UsageError(f"{call}() needs a simulator that has started", remedy="call sim.start(t0) first")
    if position.ended:
        raise UsageError(
            f"{call}(): the run has {position.ended}", remedy="call sim.start(), sim.reset() or sim.restore()"
        )
    return position
