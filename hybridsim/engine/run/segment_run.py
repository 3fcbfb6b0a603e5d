"""Integrate one segment: take steps up to the next event, search each step, and refine the event time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from hybridsim.engine.events.backward import Entry, entries
from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.native.constants import IN_A_ROW, STANDSTILL
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.segments import Dense, PiecewiseDense, Segment
from hybridsim.engine.roots.roots import POINTS, find_roots
from hybridsim.engine.run.locate import SHORTER, Findings, Hit, Locator, polish
from hybridsim.engine.run.stepping import Flow, Method, Step, Stepper, Still, Watch
from hybridsim.engine.series.bounded import ORDER, UNIT
from hybridsim.engine.system.failures import Creeping, StepFailure
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.errors import UsageError

_NEIGHBOURHOOD = 0.125  # fraction of a step by which an event time may be corrected
_CORRECTIONS = 5  # Newton iterations for an event time, starting at the accuracy of the dense output
_DIRECTIONS = {"up": 1, "down": -1, "both": 0}


@dataclass(frozen=True)
class PassedMonitor:
    """A zero crossing of a monitor inside a segment."""

    s: float  # local time
    x: np.ndarray  # states (n,)
    number: int  # of the monitor
    direction: int  # 1 rising, -1 falling


@dataclass(frozen=True)
class Arrival:
    """The end of a segment."""

    s: float  # local time
    x: np.ndarray  # states (n,)
    fired: tuple[int, ...] = ()  # located guards
    stopping: tuple[int, ...] = ()  # monitors that stop the run or reset states
    entered: str = ""  # backward in time: a guard through which the present mode may have been entered

    @property
    def is_bare(self) -> bool:
        """Return whether the segment ends without an event."""
        return not (self.fired or self.stopping or self.entered)


class SegmentRun:
    """Integrates one segment, and stores its steps and events."""

    def __init__(
        self,
        system: System,
        method: Method,
        origin: Instant,
        p: np.ndarray,
        z: np.ndarray,
        x: np.ndarray,
        watch: Watch,
        tolerances: Tolerances,
        counters: Counters,
        forward: bool,
        progress: Callable[[Instant, SegmentRun], None] | None,
    ) -> None:
        self.system, self.method, self.origin = system, method, origin
        self.tolerances, self.counters, self.progress = tolerances, counters, progress
        self.watch = watch
        self.flow = Flow(system, p, z, counters, forward)
        self.locator = Locator(self.flow, watch)
        self.monitors = system.model.monitors
        self.knots, self.states = [0.0], [x]
        self.interpolants: list[Dense] = []
        # largest magnitude of each state on the segment, to which rounding is relative
        self.scale = np.abs(x)
        self.passed_monitors: list[PassedMonitor] = []
        self.grazings: list[tuple[int, float, float]] = []  # guard, local time, distance
        self.undefined: set[int] = set()  # monitors that were not a number somewhere
        self.last_step: float | None = None  # the last length that was not limited by the end of the segment
        # consecutive steps that are too short, and the local time at which they began
        self.short, self.since = 0, 0.0
        self.refused = math.inf  # length of the shortest first step that contradicts the flow
        self.entries = () if forward else entries(system, z)

    def run(self, bound: float, first_step: float | None) -> Arrival:
        """Take steps up to the first event, or up to the bound of the segment."""
        undecided = self.watch.guards[np.isnan(self.watch.guard_floors[self.watch.guards])]
        # the stepper reports rates that are not finite
        if len(undecided) and np.isfinite(self.flow.rhs(0.0, self.states[0])).all():
            self._refuse_undefined(int(undecided[0]), 0.0)
        self.bound, self.stepper = bound, self._start(bound, first_step)
        self.counters.restarts += 1
        while True:
            try:
                step = self.stepper.step()
            except Creeping as failure:
                self._collapse(failure.since, str(failure))
            self.counters.steps += 1
            if self.counters.steps == 1:
                self._check_shape(step)
            if not np.isfinite(step.x1).all():
                raise StepFailure(
                    f"the state is not finite at the end of a step of length {step.s1 - step.s0:.3g}"
                )
            self._note_length(step, bound, first_step)
            self._refuse_standstill(step)
            whole, known = step.s1, self.scale
            self.scale = np.maximum(known, np.abs(step.x1))
            if step.roots is None:
                step, arrival = self._examine(step)
            else:
                arrival = self._take_roots(step)
            if self.entries:
                step, arrival = self._look_for_entries(step, arrival)
            # only a part is used; the states at the end of the whole step may be far larger
            if step.s1 != whole:
                parts = np.array([step.s0, 0.5 * (step.s0 + step.s1), step.s1])
                self.scale = np.maximum(known, np.abs(step.dense(parts)).max(axis=0))
            self.knots.append(step.s1)
            self.states.append(step.x1)
            self.interpolants.append(step.dense)
            if self.progress:
                self.progress(self.origin.plus(step.s1), self)
            if arrival:
                return arrival
            if step.s1 == bound:
                return Arrival(step.s1, self._projected(step))

    def _note_length(self, step: Step, bound: float, first_step: float | None) -> None:
        """Store the length of a step; a step that ends at the bound can only increase the stored length."""
        length, known = abs(step.s1 - step.s0), first_step if self.last_step is None else self.last_step
        self.last_step = length if step.s1 != bound else known and max(known, length)

    def cut(self) -> Arrival:
        """Return the end of the last complete step as the end of an unfinished segment."""
        s = self.knots[-1]
        return Arrival(s, self.flow.project(np.array([s]), self.states[-1][None, :])[0])

    def _refuse_standstill(self, step: Step) -> None:
        """Stop a run whose steps have become too short, and discard these steps."""
        length = abs(step.s1 - step.s0)
        if length >= STANDSTILL * abs(step.s1):
            self.short = 0
            return
        if self.short == 0:
            self.since = step.s0
        self.short += 1
        if self.short == IN_A_ROW:
            self._collapse(
                self.since,
                f"{IN_A_ROW} consecutive steps were shorter than {STANDSTILL:g} times the time since the last restart "
                f"({step.s1:.9g}) and were discarded; the last step was {length:.3g}",
            )

    def _collapse(self, since: float, reason: str) -> NoReturn:
        """End the run at the local time at which its steps became too short."""
        self._go_back(since)
        raise Creeping(f"steps became too small at t = {float(self.origin.plus(since)):.9g}: {reason}", since)

    def _go_back(self, s: float) -> None:
        """Discard everything after the end of the given step."""
        knot = self.knots.index(s)
        del self.knots[knot + 1 :], self.states[knot + 1 :], self.interpolants[knot:]
        self.passed_monitors = [seen for seen in self.passed_monitors if seen.s <= s]
        self.grazings = [grazing for grazing in self.grazings if grazing[1] <= s]

    def _check_shape(self, step: Step) -> None:
        """Check the shape of the dense output by a call with more or fewer times than states."""
        n = self.system.n
        times = np.linspace(step.s0, step.s1, 2 if n != 2 else 3)
        try:
            shape = np.shape(step.dense(times))
        except (TypeError, ValueError, IndexError) as error:
            fault = f"fails for an array of times ({type(error).__name__}: {error})"
        else:
            fault = f"gives an array of shape {shape} for {len(times)} times and {n} states"
            if shape == (len(times), n):
                return
        raise UsageError(
            f"the dense output of a step of {getattr(self.method, 'name', 'the integrator')} {fault}",
            remedy="step.dense(times) must accept an array of k local times and return states of shape (k, n)",
        )

    def carry_on(self, arrival: Arrival, s: float) -> Arrival:
        """Return the end of the segment, moved to a time that differs from the end time by rounding only."""
        if not self.interpolants:
            return arrival
        before, after = self.interpolants[-1](np.array([arrival.s, s]))
        self.knots[-1], self.states[-1] = s, self.states[-1] + (after - before)
        x = self.flow.project(np.array([s]), (arrival.x + (after - before))[None, :])[0]
        return replace(arrival, s=s, x=x)

    def is_clear_at_end(self, t: float) -> bool:
        """Return whether all guards and monitors are far from zero at the end of the last step."""
        s = self.knots[-1]
        return len(self.knots) > 1 and self.locator.is_clear(s - self.knots[-2], max(s, abs(t)))

    def rounding(self) -> np.ndarray:
        """Return error bounds of the states on the segment, including the errors at its start."""
        return 4.0 * UNIT * self.scale + self.watch.x_error

    def segment(self) -> Segment:
        """Return the finished segment, for the trajectory."""
        knots, flow = np.array(self.knots), self.flow
        states = flow.project(knots, np.array(self.states).reshape(len(knots), -1))
        return Segment(
            self.origin, flow.z, flow.p, knots, states, PiecewiseDense(knots, tuple(self.interpolants))
        )

    def _start(self, bound: float, first_step: float | None) -> Stepper:
        if self.system.n == 0:
            return Still(bound)
        if not np.isfinite(self.states[0]).all():
            raise StepFailure("the state is not finite at the start of a mode")
        if first_step is not None:
            first_step = min(first_step, abs(bound))
        return self.method.start(self.flow, self.states[0], bound, self.tolerances, first_step, self.watch)

    def _projected(self, step: Step) -> np.ndarray:
        return self.flow.project(np.array([step.s1]), step.x1[None, :])[0]

    # -- events that the engine locates ---------------------------------------------------------------------

    def _examine(self, step: Step) -> tuple[Step, Arrival | None]:
        """Search a step for zeros; if an event stops the segment, return the step up to the event."""
        found = self.locator.search(step, self.rounding)
        first = self._first_stop(found)
        if first is not None and step.s0 == 0.0 and abs(step.s1) < self.refused and not first[1]:
            errors, is_accurate = 4.0 * UNIT * self.scale, self.method.dense_is_accurate
            if self.locator.contradicts_flow(step, first[0], errors, is_accurate):
                return self._examine(self._start_again(step))
        passed = [hit for hit in found.crossings if self._is_recorded(hit, first)]
        located = []
        for hit, is_monitor in [*((hit, True) for hit in passed), *([first] if first else [])]:
            ended, is_reached = self._refine(step, hit, is_monitor)
            if not is_reached:
                return self._examine(ended)
            located.append(ended)
        for hit, ended in zip(passed, located, strict=False):
            self.passed_monitors.append(
                PassedMonitor(ended.s1, self._projected(ended), hit.number, hit.direction)
            )
        limit = first[0].theta if first else 1.0
        for theta, g in found.guard_gaps:
            if first is None or theta < limit:
                self._refuse_undefined(g, step.s0 + theta * (step.s1 - step.s0))
        self.undefined |= {k for theta, k in found.monitor_gaps if theta <= limit}
        for g, grazing in found.grazings:
            if grazing.theta < limit:
                self.grazings.append((g, step.s0 + grazing.theta * (step.s1 - step.s0), grazing.distance))
        if first is not None:
            (hit, is_monitor), ended = first, located[-1]
            x = self._projected(ended)
            self._remember_monitors(found, hit.theta)
            if is_monitor:
                return ended, Arrival(ended.s1, x, stopping=(hit.number,))
            return ended, Arrival(ended.s1, x, fired=(hit.number,))
        return self._at_step_end(step, found)

    def _start_again(self, step: Step) -> Step:
        """Restart the method with a shorter first step, and return this step."""
        self.refused = abs(step.s1)
        self.counters.rejected += 1
        self.last_step = SHORTER * self.refused
        self.tolerances = self.tolerances._replace(first_step=self.last_step)
        self.stepper = self._start(self.bound, self.last_step)
        return self.stepper.step()

    def _refuse_undefined(self, guard: int, s: float) -> None:
        t = float(self.origin.plus(s))
        raise StepFailure(
            f"{self.system.guard_title(guard, self.flow.z)} is not a number from t = {t:.9g} on; write the guard so "
            "that it is defined on both sides of its zero"
        )

    def _fires_in(self, monitor: int, direction: int) -> bool:
        want = _DIRECTIONS[self.monitors[monitor].direction]
        return want in (0, direction)

    def _is_recorded(self, hit: Hit, first: tuple[Hit, bool] | None) -> bool:
        """Return whether a monitor that only records has its zero before any event of the step."""
        is_before = first is None or hit.theta < first[0].theta
        recorded = self.monitors[hit.number].action == "record"
        return is_before and recorded and self._fires_in(hit.number, hit.direction)

    def _first_stop(self, found: Findings) -> tuple[Hit, bool] | None:
        stops = [(hit, False) for hit in found.exits]
        stops += [
            (hit, True)
            for hit in found.crossings
            if self.monitors[hit.number].action != "record" and self._fires_in(hit.number, hit.direction)
        ]
        return min(stops, key=lambda stop: stop[0].theta, default=None)

    def _remember_monitors(self, found: Findings, theta: float) -> None:
        """Store the signs of the monitors just before the event that stops the segment."""
        for hit in found.crossings:
            if hit.theta < theta:
                self.locator.monitor_sides[hit.number] = hit.direction

    def _at_step_end(self, step: Step, found: Findings) -> tuple[Step, Arrival | None]:
        """Set the signs of guards and monitors for the next step; a zero at the end of a step belongs to that step.

        A guard that the search left undecided and that is negative beyond rounding at the end was zero before it.
        """
        locator = self.locator
        start = dict(vars(locator))
        open_guards = [int(g) for g in self.watch.guards if found.guard_ends[g] == 0]
        open_monitors = [k for k in range(len(self.monitors)) if found.monitor_ends[k] == 0]
        locator.sides, locator.orders = found.guard_ends.copy(), np.zeros_like(locator.orders)
        locator.floors, locator.monitor_floors = np.zeros(len(locator.sides)), np.zeros(len(self.monitors))
        before = locator.monitor_sides.copy()
        for hit in found.crossings:
            before[hit.number] = hit.direction
        locator.monitor_sides, locator.monitor_orders = found.monitor_ends.copy(), np.zeros_like(before)
        if not open_guards and not open_monitors:
            return step, None
        x = self._projected(step)
        errors = self.rounding()
        series = self.system.series(step.s1, x, self.flow.p, self.flow.z, errors, math.ulp(step.s1))
        side_of = side_after if self.flow.forward else side_before
        fired: list[int] = []
        passed: list[int] = []
        stopping: list[int] = []
        for g in open_guards:
            locator.sides[g], order = side_of(series.guards[g], series.guard_bounds[g], 0)
            locator.orders[g] = order if order <= ORDER else 0
            locator.floors[g] = series.guard_bounds[g, 0] if order > 0 else 0.0
            if locator.sides[g] < 0:
                (passed if order == 0 else fired).append(g)
        if passed:
            hit = min((locator.exit(step, g) for g in passed), key=lambda hit: hit.theta)
            ended, is_reached = self._refine(step, hit, is_monitor=False)
            if not is_reached:
                vars(locator).update(start)
                return self._examine(ended)
            return ended, Arrival(ended.s1, self._projected(ended), fired=(hit.number,))
        for k in open_monitors:
            side, order = side_of(series.monitors[k], series.monitor_bounds[k], 0)
            locator.monitor_sides[k], locator.monitor_orders[k] = side, order if order <= ORDER else 0
            locator.monitor_floors[k] = series.monitor_bounds[k, 0] if order > 0 else 0.0
            if math.isnan(series.monitors[k, 0]):
                locator.monitor_sides[k] = 0
            elif side == 0:
                locator.monitor_sides[k] = before[k]
            elif before[k] != 0 and side != before[k] and self._fires_in(k, side):
                if self.monitors[k].action == "record":
                    self.passed_monitors.append(PassedMonitor(step.s1, x, k, side))
                else:
                    stopping.append(k)
                    locator.monitor_sides[k] = before[k]  # this decides the recorded direction
        if fired or stopping:
            return step, Arrival(step.s1, x, tuple(fired), tuple(stopping))
        return step, None

    def _refine(self, step: Step, hit: Hit, is_monitor: bool) -> tuple[Step, bool]:
        """Return the step up to the event and True if this step is accurate, otherwise a shorter step and False.

        If the dense output is less accurate than the method, the step is repeated to the event time, which Newton's
        method corrects until the guard is zero within rounding. An event in a step whose error there exceeds the
        tolerance is discarded, and a shorter step is searched instead.
        """
        s = step.s0 + hit.theta * (step.s1 - step.s0) if hit.theta < 1.0 else step.s1
        if self.method.dense_is_accurate or s == step.s0:
            if step.holds is not None and s != step.s0 and not step.holds(s):
                return self.stepper.restep(step, s), False
            x = step.dense(np.array([s]))[0]
            return Step(step.s0, s, step.x0, x, step.dense), True
        on_dense = s
        # the dense output errs by a small part of a step, so a zero farther away is another one
        window = _NEIGHBOURHOOD * abs(step.s1 - step.s0)
        low = max(min(step.s0, step.s1), s - window)
        high = min(max(step.s0, step.s1), s + window)
        ended = self.stepper.restep(step, s)
        for _ in range(_CORRECTIONS):
            if ended.s1 != s:
                return ended, False
            x = self._projected(ended)
            zero = np.zeros(self.system.n)
            series = self.system.series(s, x, self.flow.p, self.flow.z, zero, 0.0)
            value, slope = (series.monitors if is_monitor else series.guards)[hit.number, :2].tolist()
            shift = -value / slope if slope != 0.0 else math.nan
            if not math.isfinite(shift) or abs(shift) <= 2.0 * math.ulp(s):
                break
            corrected = min(max(s + shift, low), high)
            if corrected in (s, step.s0):
                break
            s = corrected
            ended = self.stepper.restep(step, s)
        if ended.s1 != s:
            return ended, False
        if self._is_zero(ended, hit.number, is_monitor):
            return ended, True
        # the dense output crosses zero but the repeated step does not reach it: use the dense output
        return Step(step.s0, on_dense, step.x0, step.dense(np.array([on_dense]))[0], step.dense), True

    def _is_zero(self, step: Step, number: int, is_monitor: bool) -> bool:
        """Return whether a guard or monitor is zero at the end of a step, within rounding of state and time."""
        x = self._projected(step)
        errors = 2.0 * self.rounding() + np.abs(self.flow.rhs(step.s1, x)) * 8.0 * math.ulp(step.s1)
        series = self.system.series(step.s1, x, self.flow.p, self.flow.z, errors, 8.0 * math.ulp(step.s1))
        values = series.monitors if is_monitor else series.guards
        bounds = series.monitor_bounds if is_monitor else series.guard_bounds
        return bool(abs(values[number, 0]) <= bounds[number, 0])

    def _look_for_entries(self, step: Step, arrival: Arrival | None) -> tuple[Step, Arrival | None]:
        """Stop a run backward in time if a transition from another mode may have started the present mode."""
        for entry in self.entries:
            sample = self._entry_sampler(step, entry)
            found, *_ = find_roots(sample, sample(POINTS), 0, 0, 0, lambda: 0.0, lambda _: 0.0, 0.0)
            if found:
                s = step.s0 + (step.s1 - step.s0) * polish(sample, found[0])
                step = Step(step.s0, s, step.x0, step.dense(np.array([s]))[0], step.dense, step.roots)
                arrival = Arrival(s, self._projected(step), entered=entry.label)
        return step, arrival

    def _entry_sampler(self, step: Step, entry: Entry) -> Callable[[np.ndarray], np.ndarray]:
        system, p = self.system, self.flow.p

        def sample(theta: np.ndarray) -> np.ndarray:
            times = step.s0 + (step.s1 - step.s0) * theta
            states = np.ascontiguousarray(step.dense(times))
            return system.rows("guards", system.guard_count, times, states, p, entry.z)[:, entry.guard]

        return sample

    # -- events that the method locates itself --------------------------------------------------------------

    def _take_roots(self, step: Step) -> Arrival | None:
        if not step.roots:
            values = self.flow.guards(np.array([step.s1]), step.x1[None, :])[0]
            for g in self.watch.guards[np.isnan(values[self.watch.guards])]:
                self._refuse_undefined(int(g), step.s1)
            return None
        x = self._projected(step)
        series = self.system.series(
            step.s1, x, self.flow.p, self.flow.z, self.rounding(), 2.0 * math.ulp(step.s1)
        )
        direction = 1.0 if self.flow.forward else -1.0
        located = [r.number for r in step.roots if not r.is_monitor and r.direction < 0]
        rising = [g for g in located if series.guards[g, 1] * direction > series.guard_bounds[g, 1]]
        fired = tuple(g for g in located if g not in rising)
        for g in rising:
            # a corner has the same value on both sides, so noise near its zero is harmless
            if not self.system.is_corner[self.system.owner[g]]:
                raise StepFailure(
                    f"{self.system.guard_title(g, self.flow.z)} was found to fall through zero, but it rises there; "
                    "the events are too close together for the tolerances of the integrator"
                )
        stopping = []
        for root in step.roots:
            if not root.is_monitor:
                continue
            fires = self._fires_in(root.number, root.direction)
            if fires and self.monitors[root.number].action != "record":
                # its side before the event decides the recorded direction
                stopping.append(root.number)
                continue
            self.locator.monitor_sides[root.number] = root.direction
            if fires:
                self.passed_monitors.append(PassedMonitor(step.s1, x, root.number, root.direction))
        if fired or stopping:
            return Arrival(step.s1, x, fired, tuple(stopping))
        return None
