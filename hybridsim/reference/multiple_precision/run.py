"""This module runs a model step by step; a step ends at an event or at a scheduled time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from hybridsim.errors import UsageError
from hybridsim.expr import Expression
from hybridsim.model import Model
from hybridsim.model.parts.schedule import Schedule
from hybridsim.reference.multiple_precision.appointments import Appointments
from hybridsim.reference.multiple_precision.expansion import Expansion, QuantitySeries, rate_at, value_at
from hybridsim.reference.multiple_precision.motion import Motion, Segment
from hybridsim.reference.multiple_precision.precision import Number, Precision
from hybridsim.reference.multiple_precision.program import Point
from hybridsim.reference.multiple_precision.programs import Programs
from hybridsim.reference.multiple_precision.settling import Rules, Settled
from hybridsim.reference.multiple_precision.sign_changes import sign_changes
from hybridsim.reference.multiple_precision.signals import Signal
from hybridsim.reference.trajectory import ExactEvent

_SIDES_BY_DIRECTION = {"up": (1,), "down": (-1,), "both": (1, -1)}
# The defect at the end of a step may exceed the terms that determined the step by this factor.
_DEFECT = 2.0**12
# This many events within this fraction of the span count as an accumulation, which cannot be passed event by
# event.
_CROWD, _CROWDED = 10, 1e-10


class Run:
    """One run of a model in multiple precision."""

    def __init__(
        self,
        model: Model,
        t_span: tuple[float, float],
        precision: Precision,
        progress: Callable[[float], None] | None,
    ) -> None:
        number = precision.number
        self.model, self.precision, self.progress = model, precision, progress
        self.t0, self.t1 = (number(t) for t in t_span)
        self.signals = [Signal(model, declared, precision) for declared in model.inputs]
        self.programs = Programs(model, precision, self.signals, self.t1 - self.t0)
        self.rules = Rules(self.programs)
        self.appointments = Appointments(model, self.signals, precision, self.t0, self.t1)
        self.motion = Motion(precision)
        self.events: list[ExactEvent] = []
        self.initial_modes: dict[str, str] = {}
        self.finished = False  # set by a monitor or a schedule
        start = Point(
            self.t0,
            tuple(number(value) for value in model.start_values().values()),
            tuple(number(value) for value in model.discrete_values().values()),
            self._input_coefficients(self.t0),
        )
        self._event_times: list[Number] = []
        due = [model.schedules[k] for k in self.appointments.due_at_start]
        resets = [schedule.reset for schedule in due]
        self.now = self.rules.resolve_event(start, self.programs.first_modes, (), resets)
        self.sides = self._sides(self.now.expansion)
        self.sizes = [abs(state.c[0]) for state in self.now.expansion.states]
        self._adopt(self.now)
        self._record_schedules(due)
        names = (component.name for component in self.rules.components)
        self.initial_modes = dict(zip(names, self.now.modes, strict=True))

    def follow(self) -> None:
        """Follow the motion to the end of the run."""
        while self.now.point.t < self.t1 and not self.finished:
            self._step()
            if self.progress is not None:
                self.progress(float((self.now.point.t - self.t0) / (self.t1 - self.t0)))
        self.motion.last = self.now.point.x

    # -- steps ----------------------------------------------------------------------------------------------

    def _step(self) -> None:
        """Make one step, which ends at the first event within the step, if there is an event."""
        point, expansion = self.now.point, self.now.expansion
        appointment = self.appointments.next(point.t)
        bound = appointment.t - point.t
        fired, s = self._first_departure(expansion, self._length(expansion, bound))
        acting, s = self._pass_monitors(expansion, point.t, s, arriving=bool(fired) or s == bound)
        self.motion.segments.append(Segment(point.t, s, tuple(state.c for state in expansion.states)))
        x = tuple(value_at(state.c, s) for state in expansion.states)
        self.sizes = [max(size, abs(value)) for size, value in zip(self.sizes, x, strict=True)]
        arrived = s == bound and not acting
        point = replace(point, t=appointment.t if arrived else point.t + s, x=x)
        if acting:
            self._crowd(point.t)
            self._act(acting, point)
        elif fired and (self.rules.sides.others(fired) or not arrived):
            self._crowd(point.t)
            self._adopt(self.rules.resolve_event(point, self.now.modes, fired), is_last=not arrived)
        else:
            self._go_on(point, arrived)
        if arrived:
            self.appointments.mark_done(appointment)
            self._process_schedules(appointment.schedules)

    def _go_on(self, point: Point, arrived: bool) -> None:
        """Begin the next step if no event was located and no guard is zero at this instant.

        Corners alone cause no event: if something is due, they take their sides with it.
        """
        expansion = self.programs.program(self.now.modes).expand(point)
        leaving = self.programs.leaving(expansion)
        if self.rules.sides.others(leaving) or (leaving and not arrived):
            self._crowd(point.t)
            settled = self.rules.resolve_event(point, self.now.modes, leaving)
        else:
            settled = Settled(point, self.now.modes, expansion)
        self._adopt(settled, is_last=not arrived)

    def _length(self, expansion: Expansion, bound: Number) -> Number:
        """Return a step at whose end the equations, guards and monitors are accurate."""
        h = min(expansion.reach_above(self.sizes), bound)
        for _ in range(60):
            if self._resolved(expansion, h):
                return h
            h = h * self.precision.number("0.7")
        raise UsageError(
            f"no step after t = {float(self.now.point.t)!r} satisfies the equations: the motion is not smooth there",
            remedy="use reference='runs'",
        )

    def _resolved(self, expansion: Expansion, h: Number) -> bool:
        """Return whether the end of a step satisfies the equations, with accurate guards and monitors."""
        program = self.programs.program(self.now.modes)
        x = tuple(value_at(state.c, h) for state in expansion.states)
        program.begin(replace(self.now.point, t=self.now.point.t + h, x=x))
        small = self.precision.number(10) ** -self.precision.digits * _DEFECT
        reading = program.reading
        for state, rate, size, value in zip(expansion.states, reading.rates, self.sizes, x, strict=True):
            defect = abs(h * (rate_at(state.c, h) - rate.coefficient(0)))
            if defect > small * max(size, abs(value), expansion.scale(state)):
                return False
        nodes = [*(node for row in reading.guards for node in row), *reading.monitors]
        for quantity, node in zip(expansion.quantities, nodes, strict=True):
            defect = abs(value_at(quantity.c, h) - node.coefficient(0))
            if defect > small * expansion.scale(quantity):
                return False
        return True

    def _changes(self, expansion: Expansion, quantity: QuantitySeries, h: Number) -> tuple[int, list[Number]]:
        """Return the sign of a quantity just after the start of a step, and the times in (0, h] of its sign changes."""
        side, order = expansion.side_after(quantity)
        return side, sign_changes(quantity.c[order:], h, self.precision) if side else []

    def _first_departure(self, expansion: Expansion, h: Number) -> tuple[list[tuple[int, int]], Number]:
        """Return the guard that becomes negative first and its time, or no guard and the step length."""
        first: list[tuple[int, int]] = []
        for c, row in enumerate(expansion.guards):
            for j, guard in enumerate(row):
                _, changes = self._changes(expansion, guard, h)
                if changes and changes[0] <= h:
                    first, h = [(c, j)], changes[0]
        return first, h

    # -- events ---------------------------------------------------------------------------------------------

    def _adopt(self, settled: Settled, is_last: bool = True) -> None:
        """Continue after an event, and process monitors that changed sides at the instant of the event."""
        self.now = settled
        for move in settled.moves:
            name = self.rules.components[move.component].name
            self.events.append(ExactEvent(float(settled.point.t), name, move.source, move.target, move.guard))
        if not is_last:
            return
        before, self.sides = self.sides, self._sides(settled.expansion)
        crossed = [
            k
            for k, (side, after) in enumerate(zip(before, self.sides, strict=True))
            if side not in (0, after) and -side in _SIDES_BY_DIRECTION[self.model.monitors[k].direction]
        ]
        resets = self._record_monitors(crossed, settled.point.t)
        if resets:
            self._adopt(self.rules.resolve_event(settled.point, settled.modes, (), resets))

    def _act(self, monitors: Sequence[int], point: Point) -> None:
        """Process the given monitors at a point: apply their resets, or end the run."""
        settled = self.rules.resolve_event(
            point, self.now.modes, (), self._record_monitors(monitors, point.t)
        )
        after = self._sides(settled.expansion)
        self.sides = [after[k] if k in monitors else side for k, side in enumerate(self.sides)]
        self._adopt(settled)

    def _record_monitors(self, monitors: Sequence[int], t: Number) -> list[Mapping[str, Expression]]:
        """Record the monitors that fire, and return the resets of these monitors."""
        fired = [self.model.monitors[k] for k in monitors]
        self.events += [ExactEvent(float(t), monitor.name, "", "", kind="monitor") for monitor in fired]
        self.finished = self.finished or any(monitor.action == "terminate" for monitor in fired)
        return [monitor.reset for monitor in fired if monitor.action == "reset"]

    def _pass_monitors(
        self, expansion: Expansion, t: Number, s: Number, arriving: bool
    ) -> tuple[list[int], Number]:
        """Record monitors that change sides before a time; return the first monitor that affects the run."""
        seen: list[tuple[Number, int, int]] = []
        tolerance = self.precision.zero * s
        for k, quantity in enumerate(expansion.monitors):
            side, changes = self._changes(expansion, quantity, s)
            for change in changes:
                side = -side
                if change < s - tolerance or not arriving:  # at an event the two sides are compared instead
                    seen.append((change, k, side))
        seen.sort()
        acting: list[int] = []
        for change, k, side in seen:
            if acting and change > s + tolerance:
                break
            monitor = self.model.monitors[k]
            fires = side in _SIDES_BY_DIRECTION[monitor.direction]
            if fires and monitor.action != "record":
                acting, s = [*acting, k], min(s, change)
            else:
                self.sides[k] = side
                if fires:
                    self._record_monitors([k], t + change)
        return acting, s

    def _sides(self, expansion: Expansion) -> list[int]:
        return [expansion.side_after(quantity)[0] for quantity in expansion.monitors]

    def _process_schedules(self, due: tuple[int, ...]) -> None:
        """Process the schedules that are due at an instant."""
        point = replace(self.now.point, input_coefficients=self._input_coefficients(self.now.point.t))
        schedules = [self.model.schedules[k] for k in due]
        self._record_schedules(schedules)
        self._adopt(self.rules.resolve_event(point, self.now.modes, (), [one.reset for one in schedules]))

    def _record_schedules(self, schedules: Sequence[Schedule]) -> None:
        t = float(self.now.point.t)
        self.events += [ExactEvent(t, schedule.name, "", "", kind="scheduled") for schedule in schedules]
        self.finished = self.finished or any(schedule.terminate for schedule in schedules)

    def _input_coefficients(self, t: Number) -> tuple[tuple[Number, ...], ...]:
        return tuple(signal.piece(t) for signal in self.signals)

    def _crowd(self, t: Number) -> None:
        """Raise an error for events that accumulate."""
        self._event_times.append(t)
        last_times = self._event_times[-_CROWD:]
        if len(last_times) == _CROWD and t - last_times[0] <= _CROWDED * (self.t1 - self.t0):
            raise UsageError(
                f"events accumulate at t = {float(t)!r}: the multiple-precision run cannot pass this time",
                remedy="declare the mode that begins after this time, by `limit`",
            )
