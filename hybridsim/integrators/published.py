"""The published fixed-step methods: RK4 with a dichotomy to the zero-velocity interval, and RK4 with a bare sign."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from hybridsim.engine.accumulation import Accumulation
from hybridsim.engine.fixed_dense import StepDense
from hybridsim.engine.jets import UNIT
from hybridsim.engine.period import system_period
from hybridsim.engine.settle import Settling, Situation
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant
from hybridsim.engine.timetable import Appointment, Timetable
from hybridsim.engine.trajectory import Occurrence, Segment, Task, Trajectory
from hybridsim.errors import UsageError
from hybridsim.integrators.base import Integrator
from hybridsim.integrators.rk4_kernels import (
    BOUND,
    FULL,
    MONITOR,
    NOT_FINITE,
    SIGN,
    ZONE,
    rk4_step,
    run_steps,
    workspace,
)

_ROWS = 8192  # steps of one call of the kernel; each call starts a new time origin, so no digits are lost
_PAPER = "He et al. 2026, doi:10.3390/sym18010057"
_FIXED = {
    "adaptive": "its step is fixed: rtol and atol do not enter",
    "multiple-roots": "only the signs at the ends of a step are compared",
    "stiff": "explicit, with a fixed step",
    "backward": "the zone rule of the force has no past",
}


@dataclass(frozen=True)
class _Settings:
    """What both methods hand to the kernel."""

    step: float
    rule: int
    every_stage: bool
    dichotomy: bool
    zeroed: bool
    located: bool
    rest_of_step: bool
    eps: float
    halvings: int


class FixedStepRun:
    """One run with fixed steps: surface components by the zone rule in the kernel, everything else settled here."""

    def __init__(
        self, system: System, task: Task, settings: _Settings, progress: Callable[[float], None] | None
    ) -> None:
        self.system, self.task, self.settings, self.progress = system, task, settings, progress
        self.record = Trajectory()
        self.origin, self.end = Instant(task.t0), Instant(task.t1)
        self.timetable = Timetable(system, self.end)
        self.x, self.z, self.discrete = task.x0.copy(), np.maximum(task.z0, 0), task.discrete
        self.declared = [c for c, a in enumerate(system.automata) if not a.has_surface]
        self.table = np.array(
            [
                (c, a.above, a.below, a.hold, *(a.guards[a.hold][:2]))
                for c, a in enumerate(system.automata)
                if a.has_surface
            ],
            dtype=np.int64,
        ).reshape(-1, 6)
        names = ("flow", "surfaces", "guards", "monitors", "project")
        self.addresses = tuple(system.address(n) for n in names)
        self.counts = np.zeros(3, dtype=np.int64)
        located = settings.step * 2.0**-settings.halvings  # how well an event is located
        self.accumulation = Accumulation(located, 4.0 * located)
        self.scale = np.abs(self.x)  # largest size of each state lately: what rounding is relative to
        self.fresh = np.zeros(len(system.monitor_names), dtype=np.bool_)  # monitors that have just fired
        self.law = (settings.rule, settings.every_stage, settings.eps)
        self.work = workspace(system.n, len(self.z), len(self.table), system.guard_count)

    def run(self) -> Trajectory:
        """Step to the end; what was computed is kept in any case."""
        record = self.record
        try:
            self._run()
            record.finish(self.origin, self.z, self._vector(), self.x, self.system.layout.discrete_slice)
        except KeyboardInterrupt:
            record.status = "interrupted"
            record.message = f"interrupted after t = {float(self.origin)!r}; what was computed is kept"
        record.counters.rhs_evaluations, record.counters.guard_evaluations = (
            int(self.counts[0]),
            int(self.counts[1]),
        )
        return record

    def _run(self) -> None:
        due = self.timetable.due_at_start(self.origin)
        self.timetable.kept(self.origin)
        if (self.declared or due) and self._settle(self.origin, (), due, self.task.x0, starting=True):
            return
        while self.origin != self.end:
            appointment = self.timetable.next(self.origin, forward=True)
            if self._stretch(appointment, appointment.instant if appointment else self.end):
                return
            if self.progress:
                self.progress((float(self.origin) - self.task.t0) / (self.task.t1 - self.task.t0))

    def _vector(self) -> np.ndarray:
        p = self.system.vector(self.origin, self.discrete)
        p[self.system.layout.pin_at] = 1.0 if self.settings.zeroed else 0.0
        return p

    def _stretch(self, appointment: Appointment | None, target: Instant) -> bool:
        """One call of the kernel and what ends it; True where the run stops."""
        system, set_ = self.system, self.settings
        p, bound = self._vector(), target.minus(self.origin)
        times, states = np.empty(_ROWS), np.empty((_ROWS, system.n))
        modes = np.empty((_ROWS, len(self.z)), dtype=np.int64)
        numbers = (
            system.guards_of(self.z)[self.declared].ravel() if self.declared else np.zeros(0, dtype=np.int64)
        )
        flags = (set_.dichotomy, set_.zeroed, set_.located, set_.rest_of_step)
        start_z = self.z.copy()
        count, why = run_steps(
            self.addresses,
            (set_.step, set_.halvings),
            self.law,
            flags,
            self.table,
            numbers,
            bound,
            p,
            self.x,
            self.z,
            self.fresh,
            times,
            states,
            modes,
            self.work,
            self.counts,
        )
        self.fresh[:] = False
        self.scale = np.abs(states[:count]).max(axis=0)
        self._keep(p, times[:count], states[:count], modes[:count], start_z)
        s, x = float(times[count - 1]), states[count - 1]
        self.x, self.z = x.copy(), modes[count - 1].copy()
        instant = target if why == BOUND else self.origin.plus(s)
        if why == NOT_FINITE:
            self.record.status = "step-failure"
            self.record.message = (
                f"after t = {float(instant)!r}: the state or a guard is not a number after one step"
            )
            return True
        if why == FULL:
            self.origin = instant
            return False
        if why == BOUND:
            self.origin = instant
            schedules = appointment.schedules if appointment else ()
            self.timetable.kept(instant)
            at_zero = bool(self.declared) and bool((self._guards(s, x, p)[self._watched()] == 0.0).any())
            return (bool(schedules) or at_zero) and self._settle(instant, (), schedules, x)
        return self._declared_event(s, p, why)

    # -- events of guards and monitors beside the surfaces --------------------------------------------------

    def _declared_event(self, s: float, p: np.ndarray, why: int) -> bool:
        """Halve the step in which a guard or monitor changed its sign, then settle what fired."""
        set_, x, z = self.settings, self.x, self.z
        watched = self._watched()
        before = self._monitors(s, x, p)
        low, high, best = 0.0, set_.step, x
        for _ in range(set_.halvings):
            tau = 0.5 * (low + high)
            trial = self._trial(s, tau, p)
            if why == MONITOR:
                after = self._monitors(s + tau, trial, p)
                beyond = bool(((before != 0.0) & ((before > 0.0) != (after > 0.0))).any())
            else:
                guards = self._guards(s + tau, trial, p)
                beyond = bool((guards[watched] < 0.0).any())
            if beyond:
                high = tau
            else:
                low = tau
        tau = high
        best = self._trial(s, tau, p)
        self._keep(p, np.array([s, s + tau]), np.array([x, best]), np.array([z, z]), z)
        instant = self.origin.plus(s + tau)
        if why == MONITOR:
            self.x, self.origin = best, instant
            after = self._monitors(s + tau, best, p)
            crossed = np.flatnonzero((before != 0.0) & ((before > 0.0) != (after > 0.0)))
            self.fresh[crossed] = True
            return self._monitor_events(instant, crossed, np.where(after > 0.0, 1, -1), best)
        first, last = self._guards(s, x, p), self._guards(s + tau, best, p)
        self.x = best
        fired = sorted((g for g in watched if last[g] < 0.0), key=lambda g: first[g] / (first[g] - last[g]))
        return self._settle(instant, tuple(fired), (), best)

    def _watched(self) -> list[int]:
        """Guards of the components without a surface, in their present modes."""
        if not self.declared:
            return []
        return [int(g) for g in self.system.guards_of(self.z)[self.declared].ravel() if g >= 0]

    def _guards(self, s: float, x: np.ndarray, p: np.ndarray) -> np.ndarray:
        return self.system.rows("guards", self.system.guard_count, np.array([s]), x[None, :], p, self.z)[0]

    def _trial(self, s: float, tau: float, p: np.ndarray) -> np.ndarray:
        out = np.empty(self.system.n)
        rk4_step(self.addresses, self.law, self.table, s, tau, self.x, p, self.z, out, self.work)
        self.counts[0] += 4
        return out

    def _monitors(self, s: float, x: np.ndarray, p: np.ndarray) -> np.ndarray:
        return self.system.rows(
            "monitors", len(self.system.monitor_names), np.array([s]), x[None, :], p, self.z
        )[0]

    def _monitor_events(
        self, instant: Instant, crossed: np.ndarray, directions: np.ndarray, x: np.ndarray
    ) -> bool:
        stop = False
        for k in crossed:
            monitor = self.system.model.monitors[k]
            if {"up": 1, "down": -1, "both": directions[k]}[monitor.direction] != directions[k]:
                continue
            occurrence = Occurrence(instant, "monitor", monitor.name, "", "", "", int(directions[k]), x, x)
            self.record.occurrences.append(occurrence)
            if monitor.action == "reset":
                stop = self._settle(instant, (), (), x, monitors=(int(k),)) or stop
            elif monitor.action == "terminate":
                self.record.status = "terminated"
                self.record.message = f"ended by {monitor.name} at t = {float(instant)!r}"
                stop = True
        return stop

    def _settle(
        self,
        instant: Instant,
        fired: tuple[int, ...],
        schedules: tuple[int, ...],
        x_minus: np.ndarray,
        monitors: tuple[int, ...] = (),
        starting: bool = False,
    ) -> bool:
        """Transitions and resets by the event contract, for all components but those with a surface."""
        system, record = self.system, self.record
        self.origin = instant
        p = self._vector()
        before = np.where(starting, self.task.z0, self.z)
        sides = np.sign(self._monitors(0.0, self.x, p))
        # what was located lies within the last halving of a step
        s_error = self.settings.step * 2.0**-self.settings.halvings if fired or monitors else 0.0
        x_error = 4.0 * UNIT * np.maximum(np.abs(self.x), self.scale) + s_error * np.abs(
            system.flow(0.0, self.x, p, self.z)
        )
        at = Situation(0.0, self.x.copy(), p, self.z.copy(), x_error, s_error)
        resets: list[tuple[object, ...]] = [("schedule", k) for k in schedules]
        resets += [("monitor", k) for k in monitors]
        outcome = Settling(system, at, before, forward=True, scope=self.declared).run(fired, resets)
        self.x, self.z, self.discrete = outcome.x, outcome.z, system.discrete(outcome.p).copy()
        for change in outcome.changes:
            automaton = system.automata[change.component]
            source, target = automaton.modes[change.source], automaton.modes[change.target]
            record.occurrences.append(
                Occurrence(
                    instant,
                    "transition",
                    automaton.name,
                    change.guard,
                    source,
                    target,
                    -1,
                    x_minus,
                    outcome.x,
                )
            )
            record.counters.events += 1
        for k in schedules:
            schedule = system.model.schedules[k]
            record.occurrences.append(
                Occurrence(instant, "scheduled", schedule.name, "", "", "", 0, x_minus, outcome.x)
            )
            if schedule.terminate:
                record.status, record.message = (
                    "terminated",
                    f"ended by {schedule.name} at t = {float(instant)!r}",
                )
        self._crossed_in_jump(instant, sides, np.sign(self._monitors(0.0, self.x, self._vector())), monitors)
        if outcome.status:
            record.status, record.message = outcome.status, f"at t = {float(instant)!r}: {outcome.message}"
        limit = self.accumulation.limit(instant) if outcome.changes else None
        if limit is not None:
            record.status = "accumulation"
            record.message = f"events accumulate at t = {limit!r}: declare the mode that they lead to"
        return record.status != "finished"

    def _crossed_in_jump(
        self, instant: Instant, before: np.ndarray, after: np.ndarray, handled: tuple[int, ...]
    ) -> None:
        """Record the monitors that a reset carried to their other side."""
        crossed = [k for k in np.flatnonzero(before * after < 0.0) if k not in handled]
        self._monitor_events(instant, np.array(crossed, dtype=np.int64), after.astype(np.int64), self.x)

    # -- the record -----------------------------------------------------------------------------------------

    def _keep(self, p: np.ndarray, s: np.ndarray, x: np.ndarray, z: np.ndarray, before: np.ndarray) -> None:
        """Segments of constant modes out of the rows of one stretch, and the mode changes between them."""
        record = self.record
        record.counters.steps += len(s) - 1
        if self.settings.rule == SIGN:
            self._side_of_zeros(z)
        changed = np.flatnonzero((z[1:] != z[:-1]).any(axis=1)) + 1
        if len(record.segments) and (z[0] != before).any():
            self._changes(s[0], before, z[0], x[0])
        for first, last in zip([0, *changed], [*changed, len(s) - 1], strict=True):
            if last > first:
                rows = slice(first, last + 1)
                dense = StepDense(self.system, p, z[first].copy(), s[rows].copy(), x[rows].copy())
                record.segments.append(Segment(self.origin, dense.z, p, dense.s, dense.x, dense))
        for k in changed:
            self._changes(s[k], z[k - 1], z[k], x[k])

    def _side_of_zeros(self, z: np.ndarray) -> None:
        """A row whose velocity was exactly zero gets the side it went to: that method knows no third mode."""
        for c, _, _, hold, *_ in self.table:
            for k in np.flatnonzero(z[:-1, c] == hold)[::-1]:
                z[k, c] = z[k + 1, c]
            if z[-1, c] == hold and len(z) > 1:
                z[-1, c] = z[-2, c]

    def _changes(self, s: float, source: np.ndarray, target: np.ndarray, x: np.ndarray) -> None:
        for c in np.flatnonzero(source != target):
            automaton = self.system.automata[c]
            self.record.counters.events += 1
            self.record.occurrences.append(
                Occurrence(
                    self.origin.plus(float(s)),
                    "transition",
                    automaton.name,
                    "",
                    automaton.modes[source[c]],
                    automaton.modes[target[c]],
                    -1,
                    x,
                    x,
                )
            )


def _step(
    system: System, step: float | None, period: float | None, steps_per_period: float, name: str
) -> float:
    """Length of the fixed step: as given, or the forcing's period over the number of steps per period."""
    for label, value in (("step", step), ("period", period), ("steps_per_period", steps_per_period)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise UsageError(f"{name}: {label} is {value!r}", remedy="give a positive number")
    if step is not None:
        return step
    if period is None:
        period = system_period(system)
    if period is None:
        raise UsageError(
            f"{name} steps by a share of the forcing's period, and model {system.model.name} has no single one",
            remedy="give step=... or period=...",
        )
    return period / steps_per_period


def _refuse_longer(step: float, max_step: float, name: str) -> None:
    """A fixed step is not shortened behind the user's back."""
    if step > max_step:
        raise UsageError(
            f"max_step is {max_step:g}, and the fixed step of {name} is {step:g}",
            remedy="set step or steps_per_period",
        )


@dataclass(frozen=True)
class Rk4Dichotomy(Integrator):
    """The published method: classic RK4 with step T/h0; a step in which the velocity changes sign is halved.

    The friction force follows Eq. 4 of the paper: beyond the zero-velocity interval it is the slip force; inside it
    the force that holds the body, as far as the limit allows. Halving ends when |v| <= eps_v or after 16 halvings, and
    the run goes on from there. What the paper leaves open are options; the defaults are its literal reading.

    Parameters
    ----------
    steps_per_period : steps in one period of the forcing, h0 in the paper (1200 there).
    period : that period T, if not the forcing's own.
    step : the step itself, instead of T/h0.
    eps_v : half width of the zero-velocity interval (8e-4 m/s), in the unit of the relative velocity.
    max_bisections : halvings at most (16).
    stick_velocity : "kept" as Eq. 4 reads, then the body creeps with up to eps_v while it sticks; or "zero".
    release : "step": taken at the next step; "located": halved to the limit.
    friction : "step": the force is chosen at the start of a step; "stage": at every stage.
    after_event : "full-step" from the located time on; "rest-of-step" first, back to the grid.

    When to choose it: to compare with the published figures. Its event times are as good as eps_v, whatever the step.
    Source: He, Pan, Zhang, Mei, Zhang, Symmetry 18 (2026) 57, doi:10.3390/sym18010057.
    """

    name: ClassVar[str] = "rk4-dichotomy"
    title: ClassVar[str] = "the published RK4 with a dichotomy to the zero-velocity interval"
    order: ClassVar[str] = "4 between events, 1 in eps_v at them"
    reference: ClassVar[str] = _PAPER
    when: ClassVar[str] = "to compare with the published figures"
    lacks: ClassVar[dict[str, str]] = {
        **_FIXED,
        "exact-stick": "with stick_velocity='kept' a sticking body creeps at up to eps_v",
    }

    steps_per_period: float = 1200.0
    period: float | None = None
    step: float | None = None
    eps_v: float = 8e-4
    max_bisections: int = 16
    stick_velocity: Literal["kept", "zero"] = "kept"
    release: Literal["step", "located"] = "step"
    friction: Literal["step", "stage"] = "step"
    after_event: Literal["full-step", "rest-of-step"] = "full-step"

    def __post_init__(self) -> None:
        _one_of(self.name, "stick_velocity", self.stick_velocity, ("kept", "zero"))
        _one_of(self.name, "release", self.release, ("step", "located"))
        _one_of(self.name, "friction", self.friction, ("step", "stage"))
        _one_of(self.name, "after_event", self.after_event, ("full-step", "rest-of-step"))
        if not (math.isfinite(self.eps_v) and self.eps_v > 0.0):
            raise UsageError(f"{self.name}: eps_v is {self.eps_v!r}", remedy="give a positive number")
        if not (isinstance(self.max_bisections, int) and self.max_bisections >= 1):
            raise UsageError(
                f"{self.name}: max_bisections is {self.max_bisections!r}", remedy="give a whole number"
            )

    def run(self, system: System, task: Task, progress: Callable[[float], None] | None = None) -> Trajectory:
        """Run a task with fixed steps."""
        step = _step(system, self.step, self.period, self.steps_per_period, self.name)
        _refuse_longer(step, task.tolerances.max_step, self.name)
        settings = _Settings(
            step,
            ZONE,
            self.friction == "stage",
            True,
            self.stick_velocity == "zero",
            self.release == "located",
            self.after_event == "rest-of-step",
            self.eps_v,
            self.max_bisections,
        )
        return FixedStepRun(system, task, settings, progress).run()


@dataclass(frozen=True)
class Rk4Sign(Integrator):
    """Classic RK4 with the force mu N sgn(v) and no stick: the paper's "not considering stick-slip".

    Parameters
    ----------
    steps_per_period : steps in one period of the forcing, h0 in the paper (1200 there).
    period : that period T, if not the forcing's own.
    step : the step itself, instead of T/h0.
    friction : "stage": the sign is taken at every stage; "step": at the start of each step.

    When to choose it: never for an answer; to see what chatter through a stick costs. Its modes are that chatter.
    Source: He, Pan, Zhang, Mei, Zhang, Symmetry 18 (2026) 57, doi:10.3390/sym18010057, Eq. 2.
    """

    name: ClassVar[str] = "rk4-sign"
    title: ClassVar[str] = "RK4 with the sign of the velocity and no stick"
    order: ClassVar[str] = "4 between events, 1 through them"
    reference: ClassVar[str] = _PAPER
    when: ClassVar[str] = "to see what not modelling stick does"
    lacks: ClassVar[dict[str, str]] = {
        **_FIXED,
        "exact-stick": "it has no stick: the velocity chatters around zero",
    }

    steps_per_period: float = 1200.0
    period: float | None = None
    step: float | None = None
    friction: Literal["step", "stage"] = "stage"

    def __post_init__(self) -> None:
        _one_of(self.name, "friction", self.friction, ("step", "stage"))

    def run(self, system: System, task: Task, progress: Callable[[float], None] | None = None) -> Trajectory:
        """Run a task with fixed steps."""
        step = _step(system, self.step, self.period, self.steps_per_period, self.name)
        _refuse_longer(step, task.tolerances.max_step, self.name)
        settings = _Settings(step, SIGN, self.friction == "stage", False, False, False, False, 0.0, 16)
        return FixedStepRun(system, task, settings, progress).run()


def _one_of(integrator: str, option: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise UsageError(f"{integrator}: {option} is {value!r}", remedy=f"give one of {', '.join(known)}")
