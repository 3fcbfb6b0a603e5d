"""The mode loop of all methods: integrate to the first event, resolve the event, and continue."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hybridsim.engine.events.backward import has_no_past, held, message_on_direction
from hybridsim.engine.events.compiled.known_time import has_known_times
from hybridsim.engine.events.diagnosis import advice_on_sizes, in_the_way, name_vanished_load
from hybridsim.engine.events.due_changes import apply_crossed, resolve_schedules
from hybridsim.engine.events.fatal_guards import is_only_fatal
from hybridsim.engine.events.monitor_sides import MonitorSides
from hybridsim.engine.events.outcome import Outcome
from hybridsim.engine.events.zeno.accumulation import NOBODY, Accumulation, Limit, accumulated
from hybridsim.engine.events.zeno.hidden_bounces import bounces_of, last_bounces, limit_of_hidden
from hybridsim.engine.events.zeno.limits import behind, counted_components, holds_several
from hybridsim.engine.record.checkpoint import Checkpoint, damaged
from hybridsim.engine.record.limits import UNLIMITED, LimitMonitor, LimitReached
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.run.appointment_events import events_before_appointment
from hybridsim.engine.run.compiled_loop import CompiledLoop
from hybridsim.engine.run.headway import Headway, NoHeadway, TakenOver
from hybridsim.engine.run.kernel_run import ARRIVED, PAUSED
from hybridsim.engine.run.located import Located, errors_when_due, located, located_backward, without_fatal
from hybridsim.engine.run.notices import Notices
from hybridsim.engine.run.recording import Recorder, passed_events
from hybridsim.engine.run.segment_run import Arrival, SegmentRun
from hybridsim.engine.run.setup import LazyState, setup_of
from hybridsim.engine.run.stepping import Method, Watch
from hybridsim.engine.system.failures import Collapsed, StepFailure
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.engine.system.timetable import Appointment, Timetable

_NEAR = 1e-6  # relative to a time


class ModeLoop:
    """One run of a system with one stepping method; `compiled_loop` may already have made the first call."""

    def __init__(
        self,
        system: System,
        method: Method,
        task: Task,
        progress: Callable[[float], None] | None = None,
        compiled_loop: CompiledLoop | None = None,
    ) -> None:
        self.system, self.method, self.task = system, method, task
        self.forward = task.forward
        self.record = task.record or Trajectory(system, task.retention)
        is_limited = task.limits is not UNLIMITED
        self.limit_monitor = LimitMonitor(task.limits, self.record.counters) if is_limited else None
        self.setup = setup = setup_of(system, method, task)
        self.origin, self.end, self.renewal = setup.origin, setup.end, setup.renewal
        self.timetable = Timetable(system, self.end, task.is_stepped)
        self.adopted: Instant | None = None  # instant of the last resolved event
        self.lazy_state: LazyState  # state at the origin
        self.accumulation = Accumulation(forward=self.forward)
        self.last_limits: dict[int, float] = {}  # component -> time
        self.headway = Headway(system, self.record.counters, self.origin, self.end)
        self.compiled_loop = compiled_loop or setup.compiled_loop()
        if self.compiled_loop is not None and has_known_times(system):
            self.compiled_loop.look_ahead(self.timetable, self.end)
        is_replaceable = task.successor is not None and method is not task.successor
        stiffness_monitor = self.headway if is_replaceable else None
        self.notices = Notices(
            system, method, task, self.record, stiffness_monitor, self.compiled_loop is not None
        )
        self._on_progress = progress

    @property
    def outcome(self) -> Outcome:
        """Return the state after the last event, at the origin of the segment."""
        return self.lazy_state.outcome

    @property
    def p(self) -> np.ndarray:
        """Return the run-time vector at the origin of the segment."""
        return self.lazy_state.p

    def _set_state(self, instant: Instant, make: Callable[[], Outcome]) -> None:
        """Set the instant at which the next segment begins; the state at this instant is computed on demand."""
        self.lazy_state = LazyState(self.system, instant, self.forward, make)

    def _progress(self, instant: Instant) -> None:
        """Report the progress and check the limits of the run; raises LimitReached."""
        self._tell(instant)
        if self.limit_monitor is not None:
            self.limit_monitor.check()

    def _stepped(self, instant: Instant, run: SegmentRun) -> None:
        """Report progress after a step in Python, and check the limits; raises NoHeadway or TakenOver."""
        self._progress(instant)
        self.headway.step(instant, run)
        if self.notices.look_on_the_way(run):
            raise TakenOver

    def _take_over(self) -> None:
        """Continue the run with the stiff method."""
        assert self.task.successor is not None
        self.method = self.notices.method = self.task.successor
        self.compiled_loop, self.notices.takes_over = None, False
        if self.record.taken_over is None:
            self.record.taken_over = (self.task.successor.name, float(self.origin))

    def _tell(self, instant: Instant) -> None:
        if self._on_progress is not None:
            self._on_progress((float(instant) - self.task.t0) / (self.task.t1 - self.task.t0))

    def run(self) -> Trajectory:
        """Integrate to the end, or until the run stops; the results so far are kept in every case."""
        try:
            self._run()
        except StepFailure as failure:
            self.record.status = "step-failure"
            why = in_the_way(self.system, self.record, self.outcome, self.origin, self.p)
            if not why and isinstance(failure, Collapsed):
                why = advice_on_sizes(self.system)
            reasons = (str(failure), failure.advice if isinstance(failure, NoHeadway) else "", why)
            reached = self.record.segments[-1].end if self.record.segments else self.origin
            self.record.message = f"after t = {float(reached):.9g}: {'; '.join(filter(None, reasons))}"
        except LimitReached as reached:
            self.record.stop_early("limit", str(reached), self.task.t0)
        except KeyboardInterrupt:
            self.record.stop_early("interrupted", "", self.task.t0)
        name_vanished_load(self.system, self.record)
        if not self.forward and self.record.status in ("backward-nonunique", "step-failure"):
            self.record.message += message_on_direction(self.task.t0, self.task.t1)
        if self.adopted == self.origin:
            outcome, discrete = self.outcome, self.system.layout.discrete_slice
            self.record.finish(self.origin, self.task.t0, outcome.z, self.p, outcome.x, discrete)
        self.record.seal()
        return self.record

    def _run(self) -> None:
        task = self.task
        checkpoint = self.record.checkpoint
        if checkpoint is not None:
            stop, step_size = False, self._go_on_from(checkpoint)
        else:
            due = self.timetable.due_at_start(self.origin) if self.forward else ()
            self.timetable.mark_done(self.origin)
            self.lazy_state, self.adopted, stop = self.setup.start(task, due), self.origin, False
            if not self.setup.begins_silently:
                stop = self._adopt(self.origin, self.outcome, task.x0.copy(), due)
            step_size = task.tolerances.first_step
        while not stop and self.origin != self.end:
            self._mark(step_size)
            target, appointment = self._next_target()
            if self.compiled_loop is not None and not self.accumulation.is_closing_in(float(self.origin)):
                before = self.origin
                arrived, stop = self._run_compiled(self.compiled_loop, target, appointment)
                if not (arrived or stop or self.notices.takes_over) and self._reach() == self.renewal:
                    # the limit on segment length may be the only reason why compiled code stopped
                    target, appointment = self._next_target()
                    nearer, renewal = self._no_farther(target, appointment)
                    if nearer != target:
                        arrived, stop = self._run_compiled(self.compiled_loop, nearer, renewal)
                if stop:
                    continue
                if self.origin != before:
                    step_size = None
                    self._mark(None)
                self._progress(self.origin)
                self.headway.check_compiled(self.origin)
                if self.notices.takes_over:
                    self._take_over()
                if arrived:
                    continue
                target, appointment = self._next_target()
            target, appointment = self._no_farther(target, appointment)
            segment = self._segment_run()
            bound = target.minus(self.origin)
            found: Located | None = None
            try:
                arrival = self._arrival(segment, bound, step_size)
                if arrival.is_bare and arrival.s != bound:  # another method continues from there
                    bound, target = arrival.s, self.origin.plus(arrival.s)
                    appointment = Appointment(target, (), is_renewal=True)
                at_target = arrival.s == bound
                # the end is a known time as well; events far from it cannot coincide with it
                is_over = appointment is None and bound - arrival.s <= _NEAR * max(bound, abs(float(target)))
                is_due = is_over or (appointment is not None and not appointment.is_renewal)
                if self.forward and not (
                    arrival.is_bare and is_over and segment.is_clear_at_end(float(target))
                ):
                    found = located(self.system, self.origin, arrival, segment, bound, is_due)
                    at_target = at_target or found.is_met
                    if at_target and appointment is None:
                        found = without_fatal(self.system, found)
                        found = found if found.is_event(self.system) else None
            finally:
                self._store(segment)
                self.notices.look()
            instant = target if at_target else self.origin.plus(arrival.s)
            stop = self._resolve(instant, arrival, appointment if at_target else None, segment, found)
            step_size = segment.last_step if self.outcome.continuous else None
            if self.notices.takes_over:
                self._take_over()
        if task.is_stepped and self.record.status in ("finished", "terminated"):
            self._mark(None)  # t1 may have cut the last step short

    def _next_target(self) -> tuple[Instant, Appointment | None]:
        """Return the next known time, or the end of the run."""
        appointment = self.timetable.next(self.origin, self.forward)
        return appointment.instant if appointment else self.end, appointment

    def _reach(self) -> float:
        """Return the length of the longest segment allowed from the present instant."""
        return min(self.renewal, self.accumulation.reach(float(self.origin)))

    def _no_farther(
        self, target: Instant, appointment: Appointment | None
    ) -> tuple[Instant, Appointment | None]:
        """Return the target and its scheduled event, or the end of the longest allowed segment."""
        reach = self._reach()
        if abs(target.minus(self.origin)) <= reach:
            return target, appointment
        target = self.origin.plus(reach if self.forward else -reach)
        return target, Appointment(target, (), is_renewal=True)

    def _arrival(self, segment: SegmentRun, bound: float, step_size: float | None) -> Arrival:
        """Integrate a segment and return its end, or the point at which another method continues."""
        try:
            return segment.run(bound, step_size)
        except TakenOver:
            return segment.cut()

    def _mark(self, step_size: float | None) -> None:
        """Store a checkpoint from which the run can continue, just after an event."""
        if self.adopted != self.origin:
            return
        lazy_state, origin = self.lazy_state, self.origin
        settled, paces = self.timetable.settled, dict(self.accumulation.paces)
        headway, taken_over = self.headway.place, self.record.taken_over
        place = None if self.compiled_loop is None else self.compiled_loop.place

        def checkpoint(segments: int, occurrences: int) -> Checkpoint:
            size = math.nan if step_size is None else step_size
            arrays = lazy_state.outcome.arrays() | {"step_size": np.array(size), "headway": np.array(headway)}
            if taken_over is not None:
                arrays["taken_over"] = np.array(taken_over[1])
            if place is not None:
                arrays["place"] = np.concatenate(place)
            return Checkpoint(origin, arrays, settled, paces, segments, occurrences)

        self.record.mark(checkpoint)

    def _go_on_from(self, checkpoint: Checkpoint) -> float | None:
        """Restore a checkpoint, and return the first step size."""
        arrays = checkpoint.arrays
        if "step_size" not in arrays:  # from a method with fixed steps
            raise damaged("the checkpoint has no step size")
        self.origin = self.adopted = checkpoint.instant
        if checkpoint.settled is not None:
            self.timetable.mark_done(checkpoint.settled)
        self.accumulation.go_on(checkpoint.paces)
        self._set_state(self.origin, lambda: Outcome.of_arrays(arrays))
        if self.compiled_loop is not None and "place" in arrays:
            self.compiled_loop.place = arrays["place"]
        if "headway" in arrays:
            self.headway.go_on(arrays["headway"])
        if "taken_over" in arrays and self.task.successor is not None:
            self.record.taken_over = (self.task.successor.name, float(arrays["taken_over"]))
            self._take_over()
        step_size = float(arrays["step_size"])
        return None if math.isnan(step_size) else step_size

    def _run_compiled(
        self, compiled_loop: CompiledLoop, target: Instant, appointment: Appointment | None
    ) -> tuple[bool, bool]:
        """Run in compiled code up to the target, or up to an event that is not ordinary.

        Without a renewal the target is the first known time that the loop cannot pass.
        """
        steps, x_before = self.record.counters.steps, self.lazy_state.read()[0].x.copy()
        if compiled_loop.times_ahead is not None and not (appointment and appointment.is_renewal):
            known = compiled_loop.times_ahead.after(self.origin)
            target, appointment = known.target, known.appointment
        while True:
            result = compiled_loop.advance(self.origin, *self.lazy_state.read(), target, self.record)
            self.origin = result.origin
            self._set_state(self.origin, result.outcome)
            self.notices.look()
            arrived = result.end == ARRIVED
            self.adopted = result.adopted or self.adopted
            if result.passed is not None and result.passed.last is not None:
                self.timetable.mark_done(result.passed.last)
                steps, x_before = self.record.counters.steps - result.passed.steps, result.passed.x
            counted = self.system.may_accumulate[result.owners]
            limit = self.accumulation.limit_of_all(result.instants[counted], result.owners[counted])
            if limit is None and len(result.owners) and not self.system.has_surface[result.owners[-1]]:
                blocks = self.record.occurrences.blocks
                last = last_bounces(self.system, blocks[-1] if blocks else ())
                limit = limit_of_hidden(self.system, self.outcome, last, self.record)
            if self._ends_at(limit):
                return arrived, True
            if result.end != PAUSED or self.notices.takes_over:
                break
            self._mark(None)
            self._progress(self.origin)
            self.headway.check_compiled(self.origin)
        if not arrived:
            return False, False
        if result.passed is not None and len(result.passed.ahead.kinds):  # one that was not ordinary
            target, due = result.passed.ahead.first, result.passed.ahead
            appointment = Appointment(target, due.due[due.kinds[0]])
        if appointment is None:
            self._tell(self.origin)
            return True, True
        if appointment is self.timetable.step_end:
            self._divide(target)
            return True, True
        x, error = self.outcome.x, self.outcome.x_error
        if not appointment.is_renewal:
            self.timetable.mark_done(appointment)
            steps = self.record.counters.steps - steps
            errors = errors_when_due(self.system, target, self.outcome, steps, self.method.rounding, x_before)
            error = np.maximum(error, errors)
        monitors = MonitorSides.of(self.system.model.monitors, self.outcome.monitor_sides)
        settled = self._resolve_appointment(target, self.outcome, x, appointment.schedules, error, monitors)
        return True, self._adopt(target, settled, x, appointment.schedules, monitors)

    def _divide(self, target: Instant) -> None:
        """Start a new segment at a step end that a compiled loop reached with all guards away from zero."""
        self.timetable.mark_done(target)
        if self.adopted != target:  # otherwise an event happened there
            self.adopted = target
            self.outcome.leave_zeros()

    def _segment_run(self) -> SegmentRun:
        system, outcome = self.system, self.outcome
        numbers = np.flatnonzero(system.active(outcome.z))
        watch = Watch(
            numbers, outcome.sides, outcome.orders, outcome.monitor_sides, outcome.monitor_orders, outcome.x_error,
            outcome.guard_floors, outcome.monitor_floors,
        )  # fmt: skip
        run = SegmentRun(
            system, self.method, self.origin, self.p, outcome.z, outcome.x, watch, self.task.tolerances,
            self.record.counters, self.forward, self._stepped,
        )  # fmt: skip
        origin, progress = run.origin, self._progress  # not the run, which would refer to itself
        run.flow.look = lambda s: progress(origin.plus(s))
        return run

    def _store(self, run: SegmentRun) -> None:
        """Append a segment with its steps, and with the events before its end."""
        record = self.record
        if len(run.knots) > 1:
            record.segments.append(run.segment())
        record.occurrences.extend(passed_events(self.system, self.origin, run, record, self.accumulation))
        for k in sorted(run.undefined):
            name = self.system.monitor_names[k]
            record.warn(
                f"monitor {name} is not a number during a part of the run; its zeros there are not detected"
            )

    # -- events ---------------------------------------------------------------------------------------------

    def _resolve(
        self,
        instant: Instant,
        arrival: Arrival,
        appointment: Appointment | None,
        segment: SegmentRun,
        found: Located | None,
    ) -> bool:
        """Resolve the event at the end of a segment; return True if the run stops."""
        schedules = appointment.schedules if appointment else ()
        if arrival.entered:
            self.origin = instant
            self.record.status = "backward-nonunique"
            self.record.message = (
                f"at t = {float(instant):.9g}: {arrival.entered} is zero, so the mode may have begun here"
            )
            return True
        if found is None and appointment is None and (self.forward or arrival.is_bare):
            self.origin = instant
            return True
        if found is None:
            refused = has_no_past(self.system, self.outcome.z, arrival.fired, arrival.stopping, schedules)
            if refused:
                self.origin = instant
                self.record.status, self.record.message = "backward-nonunique", refused
                return True
            found = located_backward(self.system, self.origin, arrival, segment)
        monitors, x_minus, error, s_error = found.monitors, found.at.x.copy(), segment.rounding(), 0.0
        if appointment and not appointment.is_renewal and (found.fired or monitors.leads.any()):
            found = events_before_appointment(self.system, instant, found, schedules, self.forward)
            monitors, s_error = found.monitors, math.ulp(float(instant))
        # corners need no decision: at a scheduled instant they take their sides together with it
        has_only_corners = appointment is not None and set(self.system.owner[list(found.fired)]) <= set(
            self.system.led
        )
        if has_only_corners:  # or no guard, if the located ones only touch zero
            error = np.maximum(error, found.at.x_error)
        fired = {} if has_only_corners else found.fired
        resets = self._resets_of_monitors(instant, found, fired, appointment, error, s_error)
        if fired or resets or appointment is None:
            outcome = found.resolved(self.system, instant, self.forward, fired, resets)
            # surfaces held together within rounding, just before their crossings accumulate
            is_early = appointment is None and holds_several(self.system, outcome)
            limit = self.accumulation.expected(instant) if is_early else None
            stop = None if limit is None else self._gathered(limit)
            if stop is not None:
                return stop
            if appointment is None:
                outcome = apply_crossed(self.system, self.forward, outcome, found.at.s, monitors)
            if self._adopt(instant, outcome, x_minus, (), monitors, appointment is None):
                return True
            x_minus, error = outcome.x, outcome.x_error
        if appointment:
            if not appointment.is_renewal:
                self.timetable.mark_done(appointment)
            # located events come first, because they belong to the signals before the instant
            at = instant, self.outcome, x_minus, schedules, error
            outcome = self._resolve_appointment(*at, monitors, s_error)
            return self._adopt(instant, outcome, x_minus, schedules, monitors)
        return self._accumulated(instant, found.at.x, arrival.fired)

    def _resets_of_monitors(
        self,
        instant: Instant,
        found: Located,
        fired: dict[int, int],
        appointment: Appointment | None,
        error: np.ndarray,
        s_error: float,
    ) -> list[tuple[object, ...]]:
        """Return the resets of monitors that fire at an instant; the resets read the state before all changes.

        Guards, schedules and inputs of the instant decide which monitors fire; the resets of monitors do not.
        """
        monitors, outcome = found.monitors, None
        acting = [k for k, m in enumerate(monitors.monitors) if m.action == "reset" and monitors.leads[k]]
        if self.forward and (fired or appointment):
            if not acting:
                return []
            outcome = found.resolved(self.system, instant, self.forward, fired, []) if fired else self.outcome
            if appointment and not outcome.status:
                x, error = (outcome.x, outcome.x_error) if fired else (found.at.x, error)
                schedules = appointment.schedules
                outcome = self._resolve_appointment(instant, outcome, x, schedules, error, None, s_error)
        firing = monitors.fire(outcome)
        return [("monitor", k) for k in firing if k in acting]

    def _resolve_appointment(
        self,
        instant: Instant,
        before: Outcome,
        x_minus: np.ndarray,
        schedules: tuple[int, ...],
        error: np.ndarray,
        monitors: MonitorSides | None,
        s_error: float = 0.0,
    ) -> Outcome:
        """Resolve a scheduled event.

        monitors: those whose resets apply if the event carries them over zero.
        """
        at = instant, before, x_minus, schedules, error, s_error
        found = resolve_schedules(self.system, self.forward, *at, self.adopted)
        return apply_crossed(self.system, self.forward, found, 0.0, monitors) if monitors else found

    def _accumulated(self, instant: Instant, x_minus: np.ndarray, fired: tuple[int, ...]) -> bool:
        """Detect an accumulation of events; return whether the run ends at the accumulation."""
        closed, counted = counted_components(self.system, self.outcome, fired)
        self.accumulation.forget(closed)  # a closed contact does not bounce any more
        if not counted:
            return False
        limit = self.accumulation.limit(instant, counted)
        bounces = bounces_of(self.outcome, instant, x_minus)
        hidden = limit_of_hidden(self.system, self.outcome, bounces, self.record)
        if hidden and limit is None and self.system.is_unilateral[list(hidden.components)].all():
            return bool(self._gathered(hidden))  # a contact that cannot close yet continues to bounce
        return self._ends_at(hidden or limit)

    def _ends_at(self, limit: Limit | None) -> bool:
        """Continue the run from a limit of events, if there is one; return whether the run ends at the limit."""
        stop = False if limit is None else self._gathered(limit)
        if limit is None or stop is not None:
            return bool(stop)
        self.record.status = "accumulation"
        self.record.message = accumulated(limit, self.system.automata, "adaptive" not in self.method.lacks)
        return True

    def _gathered(self, limit: Limit) -> bool | None:
        """Continue the run from a limit of events, if a motion exists; return whether the run stops.

        The result is None if no motion continues.
        """
        is_again = any(self.last_limits.get(c) == limit.time for c in limit.components)
        if not self.forward or is_again:  # a limit leads back into its own series
            return None
        target, appointment = self._next_target()
        available = target.minus(self.origin)
        ahead = min(
            max(Instant(limit.time).minus(self.origin), 0.0), available
        )  # not beyond the next appointment
        before = self.outcome
        if (after := behind(limit, self.system, before, self.p, ahead)) is None:
            return None
        ahead, found = after
        series = [c for c in limit.components if c != NOBODY] or [c.component for c in found.changes]
        self.notices.accumulated([self.system.automata[c].name for c in series])
        ended = {*limit.components, *(c.component for c in found.changes)}
        self.accumulation.forget(tuple(ended))
        self.last_limits.update(dict.fromkeys(ended, limit.time))
        monitors = MonitorSides.of(self.system.model.monitors, before.monitor_sides)
        found = apply_crossed(self.system, self.forward, found, ahead, monitors)
        instant = target if ahead == available else self.origin.plus(ahead)
        stop = self._adopt(instant, found, before.x, (), monitors)
        if stop or appointment is None or ahead < available:
            return stop
        self.timetable.mark_done(target)
        x, schedules = self.outcome.x, appointment.schedules
        monitors = replace(monitors, before=self.outcome.monitor_sides)
        at = target, self.outcome, x, schedules, self.outcome.x_error
        return self._adopt(target, self._resolve_appointment(*at, monitors), x, schedules, monitors)

    def _adopt(
        self,
        instant: Instant,
        outcome: Outcome,
        x_minus: np.ndarray,
        schedules: tuple[int, ...],
        monitors: MonitorSides | None = None,
        is_last: bool = True,
    ) -> bool:
        """Start the next segment from the state after an event, and record the event; return True to stop.

        is_last: nothing else follows at this instant. Otherwise only monitors whose resets were applied are recorded
        yet.
        """
        system, record = self.system, self.record
        self.origin = self.adopted = instant
        self._set_state(instant, lambda: outcome)
        for warning in outcome.warnings:
            record.warn(warning)
        recorder = Recorder(record, system, instant, x_minus, outcome.x)
        recorder.changes(outcome.changes)
        terminated = recorder.schedules(schedules)
        ended = recorder.fired(outcome, monitors, is_last) if monitors else []
        # a run that ends here needs no admissible modes after it
        is_end = self.forward and instant == self.end and not self.task.is_stepped
        is_over = is_end and is_only_fatal(system, outcome)
        if outcome.status and not (ended or terminated or is_over):
            record.status, record.message = outcome.status, f"at t = {float(instant):.9g}: {outcome.message}"
            return True
        if terminated or ended:
            record.status, record.message = (
                "terminated",
                f"ended by {(terminated + ended)[0]} at t = {float(instant):.9g}",
            )
            return True
        if not self.forward and held(system, outcome.z):
            record.status = "backward-nonunique"
            record.message = f"at t = {float(instant):.9g}: {held(system, outcome.z)}"
            return True
        return False
