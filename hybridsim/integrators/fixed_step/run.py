"""This module runs a fixed-step method: steps, declared events, and changes of mode."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.events.corner_sides import take_corners
from hybridsim.engine.events.diagnosis import power_without_value
from hybridsim.engine.events.first_modes import as_read_by_conditions
from hybridsim.engine.events.input_jumps import surfaces_jump
from hybridsim.engine.events.outcome import Situation
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.events.zeno.accumulation import Accumulation, accumulated
from hybridsim.engine.record.checkpoint import Checkpoint, damaged
from hybridsim.engine.record.fixed_blocks import StepSegments, step_events
from hybridsim.engine.record.limits import LimitMonitor, LimitReached
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.run.recording import Recorder
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.engine.system.timetable import Appointment, Timetable
from hybridsim.integrators.fixed_step.gaps import gaps
from hybridsim.integrators.fixed_step.kernels import (
    BOUND,
    FULL,
    MONITOR,
    NOT_FINITE,
    RESTED,
    RESTITUTION,
    changed_rows,
)
from hybridsim.integrators.fixed_step.march import March
from hybridsim.integrators.fixed_step.step_length import refuse_endless
from hybridsim.integrators.fixed_step.surface_table import surface_table

_STATE = ("x", "z", "discrete", "fresh", "turned")  # attributes from which a run can continue, with the scale
ROWS = 8192  # most steps per kernel call; each call has a new time origin, so that no digits are lost


def _left(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return a mask of the monitors that become zero or change their sign in a step, by `leaves_side`."""
    return ((before > 0.0) & (after <= 0.0)) | ((before < 0.0) & (after >= 0.0))


def _scale(states: np.ndarray) -> np.ndarray:
    """Return the largest absolute value of each state."""
    sizes: np.ndarray = np.abs(states).max(axis=0)
    return sizes


def _checkpoint(
    instant: Instant, arrays: dict[str, np.ndarray], states: np.ndarray, *others: Any
) -> Checkpoint:
    """Return a checkpoint that includes the largest absolute value of each state."""
    return Checkpoint(instant, arrays | {"scale": _scale(states)}, *others)


class FixedStepRun:
    """One run with fixed steps: the kernel handles surfaces, and this class handles everything else."""

    def __init__(
        self, system: System, task: Task, march: March, progress: Callable[[float], None] | None
    ) -> None:
        refuse_endless(march.step, (task.t0, task.t1), "step")
        self.system, self.task, self.march, self.progress = system, task, march, progress
        self.record = task.record or Trajectory(system, task.retention)
        self.limit_monitor = LimitMonitor(task.limits, self.record.counters)
        self.origin, self.end = Instant(task.t0), Instant(task.t1)
        self.timetable = Timetable(system, self.end, task.is_stepped)
        self.x, self.z, self.discrete = task.x0.copy(), np.maximum(task.z0, 0), task.discrete.copy()
        self._holds = np.array([a.hold for a in system.automata], dtype=np.int64)
        self.declared = [c for c, a in enumerate(system.automata) if not a.has_surface]
        self.located = located = march.step * 2.0**-march.halvings  # accuracy of event times
        self.accumulation = Accumulation(located, 4.0 * located)
        self.states = self.x[None, :].copy()  # of the last kernel call, whose sizes bound the rounding
        self.fresh = np.zeros(len(system.monitor_names), dtype=np.bool_)  # monitors that have just fired
        self.turned = False  # whether an input may just have jumped

    def run(self) -> Trajectory:
        """Take steps to the end of the run; the results up to a failure are kept."""
        record = self.record
        try:
            self._run()
            discrete = self.system.layout.discrete_slice
            record.finish(self.origin, self.task.t0, self.z, self._vector(), self.x, discrete)
        except LimitReached as reached:
            record.stop_early("limit", str(reached), self.task.t0)
        except KeyboardInterrupt:
            record.stop_early("interrupted", "", self.task.t0)
        record.seal()
        counts = self.march.counts
        record.counters.rhs_evaluations += int(counts[0])
        record.counters.guard_evaluations += int(counts[1])
        for warning in self.march.warnings():
            record.warn(warning)
        return record

    def _run(self) -> None:
        checkpoint = self.record.checkpoint
        if checkpoint is not None:
            self._go_on_from(checkpoint)
        else:
            due = self.timetable.due_at_start(self.origin)
            self.timetable.mark_done(self.origin)
            if self._overlaps(range(len(self.z))):
                return
            if (self.declared or due) and self._resolve(
                self.origin, (), due, self.task.x0.copy(), starting=True
            ):
                return
        began = self.origin
        while self.origin != self.end:
            self._mark()
            if self.origin != began:  # after the mark, so that a resumed run begins here
                self.limit_monitor.check()
            appointment = self.timetable.next(self.origin, forward=True)
            if self._run_kernel(appointment, appointment.instant if appointment else self.end):
                break
            if self.progress:
                self.progress((float(self.origin) - self.task.t0) / (self.task.t1 - self.task.t0))
        if self.task.is_stepped and self.record.status in ("finished", "terminated"):
            self._mark()

    def _mark(self) -> None:
        """Store a checkpoint from which the run can continue."""
        arrays = {name: np.array(getattr(self, name)) for name in _STATE}
        settled, paces = self.timetable.settled, dict(self.accumulation.paces)
        self.record.mark(partial(_checkpoint, self.origin, arrays, self.states, settled, paces))

    def _go_on_from(self, checkpoint: Checkpoint) -> None:
        if not checkpoint.arrays.keys() >= {*_STATE, "scale"}:
            raise damaged("the checkpoint is incomplete")
        self.origin = checkpoint.instant
        if checkpoint.settled is not None:
            self.timetable.mark_done(checkpoint.settled)
        self.accumulation.go_on(checkpoint.paces)
        state = {name: checkpoint.arrays[name].copy() for name in _STATE}
        self.x, self.z, self.discrete, self.fresh = (state[name] for name in _STATE[:-1])
        self.turned, self.states = bool(state["turned"]), checkpoint.arrays["scale"][None, :]

    def _vector(self) -> np.ndarray:
        p = self.system.vector(self.origin, self.discrete)
        p[self.system.layout.pin_at] = 1.0 if self.march.pinned else 0.0
        return p

    def _run_kernel(self, appointment: Appointment | None, target: Instant) -> bool:
        """Call the kernel once and handle the reason for its end; return True if the run stops."""
        system = self.system
        p, bound = self._vector(), target.minus(self.origin)
        times, states = np.empty(ROWS), np.empty((ROWS, system.n))
        modes = np.empty((ROWS, len(self.z)), dtype=np.int64)
        numbers = (
            system.guards_of(self.z)[self.declared].ravel() if self.declared else np.zeros(0, dtype=np.int64)
        )
        start_z = self.z.copy()
        rows = (times, states, modes)
        if self.turned and self._overlaps(np.flatnonzero(self.z == self._holds).tolist()):
            return True
        z = self._sides_taken() if self.turned else self.z
        self.turned = False
        here = self.x.copy(), z  # the arrays change later; events store copies
        count, why = self.march.run(numbers, bound, p, here, self.fresh, rows)
        rested = np.flatnonzero(self.fresh) if why == RESTED else None
        self.fresh[:] = False
        if count < ROWS:  # do not keep large buffers for few rows
            times, states, modes = times[:count].copy(), states[:count].copy(), modes[:count].copy()
        self.states = states
        self._store(p, times, states, modes, start_z)
        s, x = float(times[count - 1]), states[count - 1]
        self.x, self.z = x.copy(), modes[count - 1].copy()
        instant = target if why == BOUND else self.origin.plus(s)
        if why == NOT_FINITE:
            self.record.status = "step-failure"
            ahead = self.x + self.march.step * system.flow(s, self.x, p, self.z)
            power = power_without_value(system, list(system.names), float(instant) + self.march.step, ahead)
            self.record.message = (
                f"after t = {float(instant)!r}: the state or a guard is not a number after one step{power}"
            )
            return True
        if why == RESTITUTION:
            self.record.status = "inconsistent"
            self.record.message = f"at t = {float(instant)!r}: {self.march.refused()}"
            return True
        if why == FULL:
            self.origin = instant
            return False
        if rested is not None:
            self.origin = instant
            sides = np.sign(self._monitors(float(times[count - 2]), states[count - 2], p))
            return self._monitor_events(instant, rested, -sides.astype(np.int64), self.x)
        if why == BOUND:
            self.origin = instant
            schedules = appointment.schedules if appointment else ()
            self.timetable.mark_done(appointment or instant)
            self.turned = bool(system.signals)
            is_zero = bool(self.declared) and bool(
                (self._guards(s, x, p)[self._declared_guards()] == 0.0).any()
            )
            return (bool(schedules) or is_zero) and self._resolve(instant, (), schedules, x)
        return self._declared_event(s, p, why)

    def _sides_taken(self) -> np.ndarray:
        """Return the modes after a jump of an input; the jump may release held components."""
        z, p = self.z.copy(), self._vector()
        p[self.system.layout.pin_at] = 0.0
        values = self.system.rows(
            "surfaces", len(self.system.surface_of), np.zeros(1), self.x[None, :], p, self.z
        )[0]
        for c, value in zip(self.system.surface_of, values.tolist(), strict=True):
            automaton = self.system.automata[c]
            if z[c] == automaton.hold and value != 0.0 and not automaton.is_unilateral:
                z[c] = automaton.above if value > 0.0 else automaton.below
        for c, (gap, is_moving) in self._gaps().items():
            if gap or is_moving:
                z[c] = self.system.automata[c].above
        return z

    def _gaps(self) -> dict[int, tuple[int, bool]]:
        """Return the signs of all gaps at the present states."""
        if not self.system.is_unilateral.any():
            return {}
        p = self._vector()
        p[self.system.layout.pin_at] = 0.0
        return gaps(self.system, self.x, p, self.z)

    def _overlaps(self, of: Iterable[int]) -> bool:
        """Return whether a gap of some components is negative, which is invalid and ends the run."""
        below = [c for c, (gap, _) in self._gaps().items() if gap < 0 and c in of]
        if below:
            names = ", ".join(self.system.automata[c].name for c in below)
            self.record.status = "inconsistent"
            self.record.message = f"at t = {float(self.origin)!r}: the gap of {names} is below zero"
        return bool(below)

    # -- events of guards and monitors without surfaces -----------------------------------------------------

    def _declared_event(self, s: float, p: np.ndarray, why: int) -> bool:
        """Locate a sign change of a guard or monitor by bisection of the step, then resolve it."""
        x, z = self.x, self.z
        declared_guards = self._declared_guards()
        before = self._monitors(s, x, p)
        low, high, best = 0.0, self.march.step, x
        for _ in range(self.march.halvings):
            tau = 0.5 * (low + high)
            trial = self._trial(s, tau, p)
            if why == MONITOR:
                beyond = bool(_left(before, self._monitors(s + tau, trial, p)).any())
            else:
                guards = self._guards(s + tau, trial, p)
                beyond = bool((guards[declared_guards] < 0.0).any())
            if beyond:
                high = tau
            else:
                low = tau
        tau = high
        best = self._trial(s, tau, p)
        self._store(p, np.array([s, s + tau]), np.array([x, best]), np.array([z, z]), z)
        instant = self.origin.plus(s + tau)
        if why == MONITOR:
            self.x, self.origin = best, instant
            after = self._monitors(s + tau, best, p)
            left = _left(before, after)
            self.fresh[left] = True
            crossed = np.flatnonzero(left & ~self._turning_back(before, after))
            return self._monitor_events(instant, crossed, -np.sign(before).astype(np.int64), best)
        first, last = self._guards(s, x, p), self._guards(s + tau, best, p)
        self.x = best
        shares = {
            g: first[g] / (first[g] - last[g]) if first[g] > 0.0 else 0.0
            for g in declared_guards
            if last[g] < 0.0
        }
        fired = sorted(shares, key=shares.__getitem__)
        return self._resolve(instant, tuple(fired), (), best)

    def _declared_guards(self) -> list[int]:
        """Return the guards of the components without a surface, in their present modes."""
        if not self.declared:
            return []
        return [int(g) for g in self.system.guards_of(self.z)[self.declared].ravel() if g >= 0]

    def _guards(self, s: float, x: np.ndarray, p: np.ndarray) -> np.ndarray:
        return self.system.rows("guards", self.system.guard_count, np.array([s]), x[None, :], p, self.z)[0]

    def _trial(self, s: float, tau: float, p: np.ndarray) -> np.ndarray:
        return self.march.trial(s, tau, self.x, p, self.z)

    def _monitors(self, s: float, x: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Return the values of the monitors at the integrated states; held states are not projected."""
        free = p.copy()
        free[self.system.layout.pin_at] = 0.0
        names = self.system.monitor_names
        return self.system.rows("monitors", len(names), np.array([s]), x[None, :], free, self.z)[0]

    def _turning_back(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return a mask of the monitors that are exactly zero at this instant and return to their previous sign."""
        back = np.zeros(len(after), dtype=np.bool_)
        if (after == 0.0).any():  # use the inputs after this instant
            series = self.system.series(0.0, self.x, self._vector(), self.z, np.zeros(len(self.x)), 0.0)
            for k in np.flatnonzero(after == 0.0):
                back[k] = side_after(series.monitors[k], series.monitor_bounds[k], 1)[0] == np.sign(before[k])
        return back

    def _monitor_events(
        self, instant: Instant, crossed: np.ndarray, directions: np.ndarray, x: np.ndarray
    ) -> bool:
        stop, resetting, seen = False, [], []
        for k in crossed:
            monitor = self.system.model.monitors[k]
            if {"up": 1, "down": -1, "both": directions[k]}[monitor.direction] != directions[k]:
                continue
            seen.append((monitor.name, int(directions[k])))
            if monitor.action == "reset":
                resetting.append(int(k))
            elif monitor.action == "terminate":
                self.record.status = "terminated"
                self.record.message = f"ended by {monitor.name} at t = {float(instant)!r}"
                stop = True
        if resetting:  # all resets of one instant read the same state
            return self._resolve(instant, (), (), x, monitors=tuple(resetting), seen=seen) or stop
        Recorder(self.record, self.system, instant, x, x).monitors(seen)
        return stop

    def _resolve(
        self,
        instant: Instant,
        fired: tuple[int, ...],
        schedules: tuple[int, ...],
        x_minus: np.ndarray,
        monitors: tuple[int, ...] = (),
        seen: Sequence[tuple[str, int]] = (),
        starting: bool = False,
    ) -> bool:
        """Resolve transitions and resets of all components without a surface.

        monitors: indices of those that reset; seen: names and directions of all that crossed, to be recorded
        first.
        """
        system, record = self.system, self.record
        self.origin = instant
        p = self._vector()
        before = np.where(starting, self.task.z0, self.z)
        x = self.x
        # the located event lies within the last halving of a step
        s_error = self.located if fired or monitors else 0.0
        x_error = 4.0 * UNIT * np.maximum(np.abs(self.x), _scale(self.states))
        if s_error:
            x_error += s_error * np.abs(system.flow(0.0, self.x, p, self.z))
        at = Situation(0.0, self.x.copy(), p, self.z.copy(), x_error, s_error, bool(starting))
        if starting:  # resets read contacts on their present sides
            at.z[system.has_surface] = self.task.z0[system.has_surface]
            at.z = as_read_by_conditions(system, at).z
        resets: list[tuple[object, ...]] = [("schedule", k) for k in schedules]
        resets += [("monitor", k) for k in monitors]
        resolution = EventResolution(system, at, before, forward=True, scope=self.declared)
        if starting:  # monitors read the whole numbers of the start
            take_corners(resolution)
            p = at.p
        sides = np.sign(self._monitors(0.0, x, p))
        resolution.jumped = surfaces_jump(system, instant, at, forward=True)
        outcome = resolution.run(fired, resets)
        self.x, self.discrete = outcome.x, system.discrete(outcome.p).copy()
        self.z = np.where(system.has_surface, self.z, outcome.z)
        recorder = Recorder(record, system, instant, x_minus, outcome.x)
        recorder.monitors(seen)
        recorder.changes([c for c in outcome.changes if not (starting and system.is_corner[c.component])])
        for name in recorder.schedules(schedules):
            record.status, record.message = "terminated", f"ended by {name} at t = {float(instant)!r}"
        left = _left(sides, self._monitors(0.0, self.x, self._vector()))
        left[list(monitors)] = False
        if left.any():
            series = system.series(0.0, x, p, before, x_error, s_error)
            # just past its zero a monitor is still on its previous side
            for k in map(int, np.flatnonzero(left)):
                value, bound = series.monitors[k], series.monitor_bounds[k]
                sides[k] = side_before(value, bound, 1)[0] if abs(value[0]) <= bound[0] else sides[k]
            left &= (sides != 0) & (outcome.monitor_sides != sides)
            self._monitor_events(instant, np.flatnonzero(left), -sides.astype(np.int64), self.x)
        if outcome.status:
            record.status, record.message = outcome.status, f"at t = {float(instant)!r}: {outcome.message}"
        changed = {c.component for c in outcome.changes if system.may_accumulate[c.component]}
        limit = self.accumulation.limit(instant, tuple(sorted(changed)))
        if limit is not None:
            record.status = "accumulation"
            record.message = accumulated(limit, system.automata, has_rtol=False)
        return record.status != "finished"

    # -- the record -----------------------------------------------------------------------------------------

    def _store(self, p: np.ndarray, s: np.ndarray, x: np.ndarray, z: np.ndarray, before: np.ndarray) -> None:
        """Store the rows of one kernel call as segments of constant modes, with mode changes between them."""
        record = self.record
        record.counters.steps += len(s) - 1
        if self.march.has_sides_only:
            self._side_of_zeros(z)
        rows = changed_rows(before if record.segments else z[0], z)
        record.segments.add(StepSegments(self.system, self.origin, p, s, x, z, rows[rows > 0]))
        if len(rows):
            sources = z[rows - 1]
            sources[rows == 0] = before
            events = step_events(self.system, self.origin, s[rows], sources, z[rows], x[rows])
            record.counters.events += len(events)
            record.occurrences.add(events)

    def _side_of_zeros(self, z: np.ndarray) -> None:
        """Replace each stick mode in the record by the slip mode that follows it, because sgn(v) has no stick mode."""
        for c, _, _, hold, *_ in surface_table(self.system):
            for k in np.flatnonzero(z[:-1, c] == hold)[::-1]:
                z[k, c] = z[k + 1, c]
            if z[-1, c] == hold and len(z) > 1:
                z[-1, c] = z[-2, c]
