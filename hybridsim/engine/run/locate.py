"""Locate the first event in a step: search guards and monitors on the dense output, and refine the roots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.roots.roots import POINTS, Crossing, Grazing, find_roots, quiet
from hybridsim.engine.run.stepping import Flow, Step, Watch
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.failures import StepFailure

_POLISH = 200  # largest number of iterations; bisection alone needs 52 until the bracket ends are adjacent
_WIDER = 6  # doublings of a bracket whose end is on the wrong side because of the error of the isolating polynomial
# Width below which the isolation stops bisecting. The ends of wider brackets are certain: a sign change beyond them is
# another zero.
_NARROW = 2.0**-24
_FAR = 2.0**-10  # of the values on a step; a function closer to zero at its end may be zero there
_SHORT = 2.0**-13  # of the time of a run; on shorter steps it may be close to zero throughout
SHORTER = 0.1  # factor by which a first step is shortened that contradicts the flow


@dataclass(frozen=True)
class Hit:
    """A located zero of a guard or a monitor."""

    theta: float  # position in (0, 1] of the step
    number: int  # guard or monitor number
    direction: int  # 1 rising, -1 falling


@dataclass(frozen=True)
class Findings:
    """The zeros of guards and monitors found in a step."""

    exits: tuple[Hit, ...]  # guards that become negative
    crossings: tuple[Hit, ...]  # all crossings of monitors
    grazings: tuple[tuple[int, Grazing], ...]  # guards that come near zero
    guard_ends: np.ndarray  # sides at the end of the step
    monitor_ends: np.ndarray  # the same for monitors
    guard_gaps: tuple[tuple[float, int], ...]  # (theta, number) from which on a guard is not a number
    monitor_gaps: tuple[tuple[float, int], ...]  # the same for monitors


def polish(sample: Callable[[np.ndarray], np.ndarray], crossing: Crossing) -> float:
    """Return the zero in a bracket, accurate to rounding error, by safeguarded secant steps."""
    left, right = crossing.left, crossing.right

    def value(theta: float) -> float:
        return crossing.direction * float(sample(np.array([theta]))[0])

    high, low, width = value(right), value(left), right - left
    for _ in range(_WIDER if width < _NARROW else 0):
        if high < 0.0 and right < 1.0:
            left, low, right = right, high, min(right + width, 1.0)
            high = value(right)
        elif low > 0.0 and left > 0.0:
            left, right, high = max(left - width, 0.0), left, low
            low = value(left)
        else:
            break
        width *= 2.0
    else:  # no zero is near: the sign is decided by rounding
        left, right = crossing.left, crossing.right
        low, high = value(left), value(right)
    low = min(low, 0.0)  # the side at the start of a step is known, whatever the rounding of the value
    same_end = 0
    for _ in range(_POLISH):
        if right - left <= math.ulp(right) or high == 0.0:
            break
        theta = left + (right - left) * (low / (low - high)) if low < high else math.nan
        if not left < theta < right or same_end > 2:
            theta, same_end = 0.5 * (left + right), 0
            if not left < theta < right:
                break
        found = value(theta)
        if found > 0.0:
            right, high = theta, found
            same_end = same_end + 1 if same_end >= 0 else 0
            low *= 0.5  # Illinois method: halve the value at the end that stays
        elif found < 0.0:
            left, low = theta, found
            high *= 0.5
        else:
            return theta
    return right


def _in_order(hits: list[Hit]) -> tuple[Hit, ...]:
    return tuple(sorted(hits, key=lambda hit: (hit.theta, hit.number)))


class Locator:
    """Searches the steps of one segment for zeros, and stores the sign of each guard and monitor."""

    def __init__(self, flow: Flow, watch: Watch) -> None:
        self.flow = flow
        self.numbers, self.x_error = watch.guards, watch.x_error
        self.sides, self.orders = watch.sides.copy(), watch.orders.copy()
        self.floors, self.monitor_floors = watch.guard_floors, watch.monitor_floors
        self.monitor_numbers = np.arange(len(watch.monitor_sides))
        self.monitor_sides, self.monitor_orders = watch.monitor_sides.copy(), watch.monitor_orders.copy()
        self.samples: list[np.ndarray] = []  # of guards and monitors, on the last searched step

    def search(self, step: Step, rounding: Callable[[], np.ndarray]) -> Findings:
        """Return all zeros in a step; the function `rounding` returns the state errors up to this step."""
        flow, width = self.flow, step.s1 - step.s0
        times = step.s0 + width * POINTS
        times[-1] = step.s1
        states = step.dense(times)
        exits, crossings, grazings, guard_gaps, monitor_gaps = [], [], [], [], []
        guard_ends = np.ones_like(self.sides)
        self.samples = []
        if len(self.numbers):
            values = flow.guards(times, states)
            self.samples.append(values)
            still = quiet(values, self.numbers, self.sides, self.orders, self.floors)
            for g in self.numbers[~still]:
                sample, side = self._sampler(step, flow.guards, int(g)), int(self.sides[g])
                order = int(self.orders[g]) if side else 0
                floor = self.floors[g]
                if flow.system.is_corner[flow.system.owner[g]]:  # within rounding both sides are equally good
                    floor = max(floor, self._bound(step, int(g), rounding()))
                try:
                    found, grazed, guard_ends[g], gap = find_roots(
                        sample,
                        values[:, g],
                        order,
                        side or 1,
                        -1,
                        self._rounding(step, int(g), False),
                        self._before(step, int(g), False),
                        floor,
                        step.s0 == 0.0,
                    )
                except StepFailure as failure:
                    raise StepFailure(f"{flow.system.guard_title(int(g), flow.z)}: {failure}") from None
                grazings += [(int(g), z) for z in grazed]
                exits += [Hit(polish(sample, c), int(g), -1) for c in found if c.direction < 0]
                guard_gaps += [(gap, int(g))] if gap <= 1.0 else []
        monitor_ends = self.monitor_sides.copy()
        if len(self.monitor_sides):
            values = flow.monitors(times, states)
            self.samples.append(values)
            still = quiet(
                values, self.monitor_numbers, self.monitor_sides, self.monitor_orders, self.monitor_floors
            )
            for k in self.monitor_numbers[~still]:
                sample, side = self._sampler(step, flow.monitors, int(k)), int(self.monitor_sides[k])
                order = int(self.monitor_orders[k]) if side else 0
                try:
                    found, _, monitor_ends[k], gap = find_roots(
                        sample,
                        values[:, k],
                        order,
                        side,
                        0,
                        self._rounding(step, int(k), True),
                        self._before(step, int(k), True),
                        self.monitor_floors[k],
                    )
                except StepFailure as failure:
                    if np.isfinite(values[:, k]).all():
                        raise StepFailure(f"monitor {flow.system.monitor_names[k]}: {failure}") from None
                    found, monitor_ends[k], gap = [], 0, 0.0  # it ends at a pole
                crossings += [Hit(polish(sample, c), int(k), c.direction) for c in found]
                monitor_gaps += [(gap, int(k))] if gap <= 1.0 else []
        return Findings(
            _in_order(exits),
            _in_order(crossings),
            tuple(grazings),
            guard_ends,
            monitor_ends,
            tuple(guard_gaps),
            tuple(monitor_gaps),
        )

    def is_clear(self, length: float, time: float) -> bool:
        """Return whether no guard or monitor is near zero at the end of a step of a given length."""
        found = len(self.samples) == (len(self.numbers) > 0) + (len(self.monitor_numbers) > 0)
        clear = found and (length > _SHORT * time or not self.samples)
        for values in self.samples:
            first, middle, last = values[0].tolist(), values[len(values) // 2].tolist(), values[-1].tolist()
            for a, b, c in zip(first, middle, last):
                clear = clear and (abs(c) > _FAR * max(abs(a), abs(b)) or a == b == c == 0.0)
        return clear

    def contradicts_flow(self, step: Step, hit: Hit, errors: np.ndarray, is_accurate: bool) -> bool:
        """Return whether the early zero of a guard that starts at zero is only a numerical error of the first step.

        A corner keeps its side if the flow rises from the located zero, and the next segment would begin in the same
        way. A first step of order one may have such an error. Another guard must have changed by more than rounding,
        unless the dense output is accurate: a long step of a stiff method may contradict the flow at its start.
        """
        g, order, flow = hit.number, int(self.orders[hit.number]), self.flow
        if order == 0 or hit.theta >= SHORTER:
            return False
        times = hit.theta * np.array([0.0, step.s1])
        start, found = (
            flow.system.series(s, x, flow.p, flow.z, errors, math.ulp(s))
            for s, x in zip(times.tolist(), flow.project(times, step.dense(times)), strict=True)
        )
        leading, rounding = abs(start.guards[g, order]), start.guard_bounds[g, 0]
        if flow.system.is_corner[flow.system.owner[g]]:
            side_of = side_after if flow.forward else side_before
            is_wrong = side_of(found.guards[g], found.guard_bounds[g], 1)[0] > 0
        else:
            is_wrong = not is_accurate and leading * abs(times[1]) ** order <= rounding
        # a shorter step must be long enough for the guard to exceed rounding
        return bool(is_wrong and rounding < leading * abs(SHORTER * step.s1) ** order)

    def exit(self, step: Step, guard: int) -> Hit:
        """Return the zero of a guard that is positive at the start of a step and negative at the end."""
        sample = self._sampler(step, self.flow.guards, guard)
        return Hit(polish(sample, Crossing(0.0, 1.0, -1)), guard, -1)

    def _rounding(self, step: Step, number: int, is_monitor: bool) -> Callable[[], float]:
        """Return a function that computes, on demand, the rounding error of a guard or monitor on the step."""
        known: list[float] = []

        def bound() -> float:
            if not known:
                times = step.s0 + (step.s1 - step.s0) * POINTS
                states = step.dense(times)
                rates = np.array([self.flow.rhs(s, x) for s, x in zip(times.tolist(), states, strict=True)])
                sizes, speeds = (np.abs(np.nan_to_num(v)).max(axis=0) for v in (states, rates))
                # the time of a sample is rounded, with all values that depend on it
                errors = 4.0 * UNIT * sizes + 2.0 * math.ulp(max(abs(step.s0), abs(step.s1))) * speeds
                bound_at_end = self._bound(step, number, errors, is_monitor)
                if not math.isfinite(bound_at_end):  # not a number there
                    start = replace(step, s1=step.s0, x1=step.x0)
                    bound_at_end = self._bound(start, number, errors, is_monitor)
                known.append(bound_at_end)
            return known[0]

        return bound

    def _before(self, step: Step, number: int, is_monitor: bool) -> Callable[[float], float]:
        """Return a function that computes, at theta, the error of a guard or monitor due to the errors at the start."""
        known: list[list[float]] = []

        def bound(theta: float) -> float:
            if not known:
                flow = self.flow
                series = flow.system.series(step.s0, step.x0, flow.p, flow.z, self.x_error, math.ulp(step.s0))
                bounds = series.monitor_bounds if is_monitor else series.guard_bounds
                known.append(bounds[number].tolist())
            d, total = abs(theta * (step.s1 - step.s0)), 0.0
            for coefficient in reversed(known[0]):
                total = coefficient + d * total
            return total if math.isfinite(total) else 0.0

        return bound

    def _bound(self, step: Step, number: int, errors: np.ndarray, is_monitor: bool = False) -> float:
        """Return the error of a guard or monitor at the end of a step, given the errors of the states."""
        flow, s_error = self.flow, math.ulp(max(abs(step.s0), abs(step.s1)))
        series = flow.system.series(step.s1, step.x1, flow.p, flow.z, errors, s_error)
        return float((series.monitor_bounds if is_monitor else series.guard_bounds)[number, 0])

    def _sampler(
        self, step: Step, function: Callable[[np.ndarray, np.ndarray], np.ndarray], column: int
    ) -> Callable[[np.ndarray], np.ndarray]:
        width = step.s1 - step.s0

        def sample(theta: np.ndarray) -> np.ndarray:
            times = step.s0 + width * theta
            return function(times, step.dense(times))[:, column]

        return sample
