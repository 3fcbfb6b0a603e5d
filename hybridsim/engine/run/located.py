"""Determine the state at a located event with error bounds, and the guards and monitors that are zero there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybridsim.engine.events.backward import cross_backward
from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.events.compiled.after_segment import spread
from hybridsim.engine.events.input_jumps import surfaces_jump
from hybridsim.engine.events.monitor_sides import MonitorSides
from hybridsim.engine.events.outcome import Outcome, Situation
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.run.segment_run import Arrival, SegmentRun
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


def situation(system: System, arrival: Arrival, segment: SegmentRun) -> Situation:
    """Return the state before an event, with bounds of the rounding errors, and the instant of the event."""
    flow, s_error = segment.flow, 2.0 * math.ulp(arrival.s)
    zero, asked = np.zeros(system.n), segment.tolerances
    slopes = np.abs(system.flow(arrival.s, arrival.x, flow.p, flow.z)) if system.n else zero
    located: list[Any] = []
    if arrival.fired or arrival.stopping:
        series = system.series(arrival.s, arrival.x, flow.p, flow.z, zero, 0.0)
        # for a corner both sides are equally good if its time error moves the states by less than the tolerance
        fine = asked.atol + asked.rtol * np.abs(arrival.x)
        fired = [
            g
            for g in arrival.fired
            if not system.is_corner[system.owner[g]]
            or (distance_of_zero(series.guards[g]) * slopes <= fine).all()
        ]
        located = [*series.guards[fired], *series.monitors[list(arrival.stopping)]]
    # if value and rate are far below the tolerance, both are noise and give no time
    least = UNIT * float(asked.atol.min(initial=math.inf))
    for series_of_zero in located:
        if np.abs(series_of_zero[:2]).max() > least:
            s_error = max(s_error, distance_of_zero(series_of_zero))
    x_error = segment.rounding() + s_error * slopes
    holding = system.evaluated(flow.z)
    x_error[holding] = UNIT * np.abs(arrival.x[holding])
    return Situation(arrival.s, arrival.x.copy(), flow.p, flow.z.copy(), x_error, s_error)


def distance_of_zero(series: Any) -> float:
    """Return the time from a point to the zero of a function, from its Taylor coefficients, or 0 if undetermined.

    For a function that only touches zero the slope is useless: a double zero is at the distance sqrt(2 |g/g''|).
    """
    value, slope, bend = (abs(float(c)) for c in series[:3])
    by_slope = value / slope if slope > 0.0 else math.inf
    by_bend = math.sqrt(value / bend) if bend > 0.0 else math.inf
    distance = min(by_slope, by_bend)
    return distance if math.isfinite(distance) else 0.0


def time_error(series: Any, bounds: Any) -> float:
    """Return the error of the time of a zero, from the error bound of the function at the zero."""
    return distance_of_zero((bounds[0], *series[1:]))


@dataclass(frozen=True)
class Located:
    """The end of a segment at an event: the instant, the state, and the functions that are zero.

    Parameters
    ----------
    at : the state just before it.
    fired : guards that are zero and become negative, with their order in time.
    monitors : their sides just before it, and those to which the motion leads them.
    is_met : whether the instant coincides with what is scheduled.
    inputs : the run-time vector with the inputs before a jump; None if `at` has them.
    waiting : components whose loads are zero and that wait for schedules that are due.
    """

    at: Situation
    fired: dict[int, int]
    monitors: MonitorSides
    is_met: bool
    inputs: np.ndarray | None = None
    waiting: frozenset[int] = frozenset()

    def scope(self, system: System) -> set[int]:
        """Return the components that take part in the event; components that wait for a schedule come later."""
        return set(range(len(system.automata))) - self.waiting

    def is_event(self, system: System) -> bool:
        """Return whether there is an event at the end of the run; changes of branch in abs, min or max do not count."""
        owners = set(system.owner[list(self.fired)].tolist())
        silent = set(system.led).difference(system.numbers)
        return bool(owners.difference(silent)) or bool(self.monitors.leads.any())

    def resolved(
        self,
        system: System,
        instant: Instant,
        forward: bool,
        fired: dict[int, int],
        resets: list[tuple[object, ...]],
    ) -> Outcome:
        """Resolve guards and resets of monitors on a copy of the state."""
        at = replace(self.at, x=self.at.x.copy(), z=self.at.z.copy())
        if fired and not forward:
            return cross_backward(system, at, tuple(fired))
        scope = self.scope(system)
        resolution = EventResolution(system, at, at.z.copy(), forward, scope, self.inputs)
        resolution.jumped = self.inputs is not None and surfaces_jump(system, instant, at, True)
        return resolution.run(fired, resets)


def coincident(
    system: System, origin: Instant, at: Situation, fired: tuple[int, ...], known: Any = None
) -> dict[int, int]:
    """Return the located guards and the guards that leave zero at the same instant, in order of time.

    known: the series there, if they have been computed.
    """
    series = known or system.series(at.s, at.x, at.p, at.z, at.x_error, at.s_error)
    together: dict[int, float] = {}
    for g in map(int, np.flatnonzero(system.active(at.z))):
        value, bound = series.guards[g], series.guard_bounds[g]
        leaves = abs(value[0]) <= bound[0] and side_after(value, bound, 1)[0] < 0
        if g in fired or leaves:
            together[g] = math.copysign(distance_of_zero(value), float(value[0]))
    # guards within one ulp of the time share a position in the order
    ulp = math.ulp(max(abs(float(origin.plus(at.s))), math.ulp(1.0)))
    order: dict[int, int] = {}
    place, last = -1, -math.inf
    for g in sorted(together, key=lambda g: together[g]):
        if together[g] - last > ulp:
            place, last = place + 1, together[g]
        order[g] = place
    return order


def located(
    system: System, origin: Instant, arrival: Arrival, segment: SegmentRun, target: float, is_due: bool
) -> Located:
    """Return the state at the end of a segment, and the guards and monitors that are zero there.

    is_due: something is scheduled at the local time `target`, which may be this instant.
    """
    at, is_met = situation(system, arrival, segment), False
    series = system.series(at.s, at.x, at.p, at.z, at.x_error, at.s_error)
    if is_due:  # at a scheduled time the error of the motion there counts
        wide, known = as_stepped(system, at, arrival, segment)
        zeros = [(known.guards[g], known.guard_bounds[g]) for g in arrival.fired]
        zeros += [(known.monitors[k], known.monitor_bounds[k]) for k in arrival.stopping]
        late = max((time_error(value, bound) for value, bound in zeros), default=0.0)
        known_at = math.ulp(float(origin.plus(target)))  # the scheduled time is rounded to double precision
        is_met = abs(target - arrival.s) <= at.s_error + late + known_at
        if is_met:
            if arrival.s != target:  # they differ by rounding
                shift, arrival = abs(target - arrival.s), segment.carry_on(arrival, target)
                at = situation(system, arrival, segment)
                at.s_error += shift
                wide, known = as_stepped(system, at, arrival, segment)
            at, series = _as_due(system, origin, wide, known, arrival, known_at)
    share = spread(len(segment.knots), segment.method.rounding)
    if not is_met and others_near(system, at, series, arrival, share):
        wide, known = as_stepped(system, at, arrival, segment)
        if others_near(system, wide, known, arrival, 1.0):
            at, series = wide, known
    fired = coincident(system, origin, at, arrival.fired, series)
    sides = _before_instant(series, arrival, segment)
    segment.grazings = [
        grazing
        for grazing in segment.grazings
        if grazing[0] not in fired or not _is_near(series, arrival, *grazing[:2])
    ]
    monitors = MonitorSides.located(system.model.monitors, sides, series, arrival.stopping)
    return Located(at, fired, monitors, is_met)


def as_stepped(system: System, at: Situation, arrival: Arrival, segment: SegmentRun) -> tuple[Situation, Any]:
    """Return the state at an event with error bounds that include the rounding of all steps."""
    with np.errstate(invalid="ignore"):  # a state may have become infinite
        wide, way = replace(at), np.abs(np.diff([*segment.states, arrival.x], axis=0)).sum(axis=0)
    add_steps(system, wide, segment.scale + way, len(segment.knots), segment.method.rounding * way)
    return wide, system.series(wide.s, wide.x, wide.p, wide.z, wide.x_error, wide.s_error)


def _as_due(
    system: System, origin: Instant, at: Situation, series: Any, arrival: Arrival, known_at: float
) -> tuple[Situation, Any]:
    """Return the state at a scheduled time, with wider error bounds if these show more functions at zero."""
    slopes = np.abs(system.flow(at.s, at.x, at.p, at.z)) if system.n else 0.0
    wide = replace(at, x_error=at.x_error + known_at * slopes, s_error=at.s_error + known_at)
    known = system.series(wide.s, wide.x, wide.p, wide.z, wide.x_error, wide.s_error)
    fewer = _zero_count(system, origin, at, arrival, series)
    return (wide, known) if _zero_count(system, origin, wide, arrival, known) > fewer else (at, series)


def others_near(system: System, at: Situation, series: Any, arrival: Arrival, share: float) -> bool:
    """Return whether another guard or monitor is smaller than `share` times its error bound."""
    is_read = ~system.is_corner[system.owner] | np.isin(system.owner, [*system.numbers])
    active = set(map(int, np.flatnonzero(system.active(at.z) & is_read)))
    monitors = set(range(len(series.monitors))) - set(arrival.stopping)
    values = [(series.guards[g][0], series.guard_bounds[g][0]) for g in active.difference(arrival.fired)]
    values += [(series.monitors[k][0], series.monitor_bounds[k][0]) for k in monitors]
    return any(0.0 < bound < math.inf and abs(value) <= share * bound for value, bound in values)


def _zero_count(system: System, origin: Instant, at: Situation, arrival: Arrival, series: Any) -> int:
    """Return how many guards leave zero at an event, plus how many monitors are zero."""
    bounded_monitors = zip(series.monitors, series.monitor_bounds, strict=True)
    monitors = sum(abs(value[0]) <= bound[0] for value, bound in bounded_monitors)
    return len(coincident(system, origin, at, arrival.fired, series)) + monitors


def _is_near(series: Any, arrival: Arrival, guard: int, s: float) -> bool:
    """Return whether a minimum of a guard near zero coincides with the event, within the error of its time."""
    return abs(arrival.s - s) <= 2.0 * time_error(series.guards[guard], series.guard_bounds[guard])


def _before_instant(series: Any, arrival: Arrival, segment: SegmentRun) -> np.ndarray:
    """Return the signs of the monitors just before an instant; monitors at zero have not yet crossed.

    If a crossing of such a monitor was recorded, it is removed. The sides before and after the instant decide.
    """
    sides, watch = segment.locator.monitor_sides.copy(), segment.watch
    for k, (value, bound) in enumerate(zip(series.monitors, series.monitor_bounds, strict=True)):
        is_zero = abs(value[0]) <= bound[0]
        before = side_before(value, bound, 1)[0] if is_zero else 0
        if is_zero and before == 0 and watch.monitor_sides[k] == 0:  # it stayed at zero
            sides[k] = 0
        near = 2.0 * time_error(value, bound)
        if before == 0 or (
            watch.monitor_orders[k] > 0 and abs(arrival.s) <= near
        ):  # it is still leaving the previous zero
            continue
        sides[k] = before
        segment.passed_monitors = [
            seen for seen in segment.passed_monitors if seen.number != k or abs(arrival.s - seen.s) > near
        ]
    return sides


def located_backward(system: System, origin: Instant, arrival: Arrival, segment: SegmentRun) -> Located:
    """Return the state at the end of a segment of a backward run, and the guards and monitors that are zero there."""
    at = situation(system, arrival, segment)
    fired = coincident(system, origin, at, arrival.fired) if arrival.fired else {}
    sides = segment.locator.monitor_sides
    monitors = MonitorSides.of(system.model.monitors, sides)
    monitors.leads[list(arrival.stopping)] = -sides[list(arrival.stopping)]
    return Located(at, fired, monitors, True)


def errors_when_due(
    system: System, target: Instant, outcome: Outcome, steps: int, rounding: float, before: np.ndarray
) -> np.ndarray:
    """Return the state errors at a scheduled time that a compiled loop reached in the given number of steps.

    outcome: the last one, with the states just before the target. rounding: of the method. before: the states at which
    the loop began.
    """
    p = system.vector(target, system.discrete(outcome.p), forward=False)
    at = Situation(0.0, outcome.x, p, outcome.z, outcome.x_error, 0.0)
    way = np.abs(at.x - before)
    scale = np.maximum(np.abs(before), np.abs(at.x)) + way
    slopes = np.abs(system.flow(at.s, at.x, at.p, at.z)) if system.n else 0.0
    at.x_error = at.x_error + 4.0 * UNIT * scale + math.ulp(float(target)) * slopes
    add_steps(system, at, scale, steps, rounding * way)
    return at.x_error


def add_steps(system: System, at: Situation, scale: np.ndarray, steps: int, stages: np.ndarray) -> None:
    """Add the rounding errors of `steps` steps to the error bounds of the states.

    A step is a sum of rounded terms. scale: size of the states plus the distance they moved. stages: that distance
    times the sum of the stages of the method, which cancel each other.
    """
    held = system.evaluated(at.z)
    at.x_error = at.x_error + UNIT * (16.0 * steps * scale + stages)
    at.x_error[held] = UNIT * np.abs(at.x[held])


def without_fatal(system: System, found: Located) -> Located:
    """Return a located event without its fatal guards, which have no effect at the end of a run."""
    modes = zip(system.automata, found.at.z.tolist(), strict=True)
    fatal = {g for a, m in modes if m >= 0 for g, message in zip(a.guards[m], a.fatal[m]) if message}
    return replace(found, fired={g: place for g, place in found.fired.items() if g not in fatal})
