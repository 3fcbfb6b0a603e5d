"""What is known of an event as it was located: the state with bounds of its errors, and the guards zero together."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hybridsim.engine.decide import side_after
from hybridsim.engine.jets import UNIT
from hybridsim.engine.outcome import Situation
from hybridsim.engine.segment import Arrival, SegmentRun
from hybridsim.engine.system import System
from hybridsim.engine.timepair import Instant


def situation(system: System, arrival: Arrival, segment: SegmentRun) -> Situation:
    """The state before an event with bounds of its rounding: of the states, the instant, the residual."""
    flow, s_error = segment.flow, 2.0 * math.ulp(arrival.s)
    zero = np.zeros(system.n)
    series = system.series(arrival.s, arrival.x, flow.p, flow.z, zero, 0.0)
    located = series.guards[list(arrival.fired)].tolist() + series.monitors[list(arrival.stopping)].tolist()
    # where a speed dies out below all that is asked for, value and rate are both noise, and tell of no time
    least = UNIT * float(segment.tolerances.atol.min(initial=math.inf))
    for value, slope, *_ in located:
        if max(abs(value), abs(slope)) > least and slope != 0.0 and math.isfinite(value / slope):
            s_error = max(s_error, abs(value / slope))
    slopes = np.abs(system.flow(arrival.s, arrival.x, flow.p, flow.z)) if system.n else zero
    x_error = segment.rounding() + s_error * slopes
    holding = system.evaluated(flow.z)
    x_error[holding] = UNIT * np.abs(arrival.x[holding])
    return Situation(arrival.s, arrival.x.copy(), flow.p, flow.z.copy(), x_error, s_error)


def with_monitors(system: System, at: Situation, arrival: Arrival, sides: np.ndarray) -> Arrival:
    """The arrival with all monitors that reset and cross zero at its instant, so that their resets see one state.

    sides are those of the monitors just before.
    """
    resetting = [k for k, m in enumerate(system.model.monitors) if m.action == "reset" and sides[k] != 0]
    if not set(resetting).difference(arrival.stopping):
        return arrival
    series = system.series(at.s, at.x, at.p, at.z, at.x_error, at.s_error)
    stopping = set(arrival.stopping)
    for k in resetting:
        value, bound = series.monitors[k], series.monitor_bounds[k]
        wanted = {"up": 1, "down": -1, "both": -int(sides[k])}[system.model.monitors[k].direction]
        if abs(value[0]) <= bound[0] and side_after(value, bound, 1)[0] == wanted == -sides[k]:
            stopping.add(k)
    return replace(arrival, stopping=tuple(sorted(stopping)))


def coincident(system: System, origin: Instant, at: Situation, fired: tuple[int, ...]) -> dict[int, int]:
    """The located guards and those that are zero with them and leave, with the order of their times."""
    series = system.series(at.s, at.x, at.p, at.z, at.x_error, at.s_error)
    together: dict[int, float] = {}
    for g in map(int, np.flatnonzero(system.active(at.z))):
        value, bound = series.guards[g], series.guard_bounds[g]
        distance, rate = value[:2].tolist()
        leaves = abs(value[0]) <= bound[0] and side_after(value, bound, 1)[0] < 0
        if g in fired or leaves:
            together[g] = -distance / rate if rate != 0.0 else 0.0
    # guards within one ulp of the time are at one place of the order
    ulp = math.ulp(max(abs(float(origin.plus(at.s))), math.ulp(1.0)))
    order: dict[int, int] = {}
    place, last = -1, -math.inf
    for g in sorted(together, key=lambda g: together[g]):
        if together[g] - last > ulp:
            place, last = place + 1, together[g]
        order[g] = place
    return order
