"""Resolve the changes that are due at one instant: schedules, input jumps, then resets of monitors that fired."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.events.input_jumps import surfaces_jump
from hybridsim.engine.events.monitor_sides import MonitorSides
from hybridsim.engine.events.outcome import Outcome, Situation
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


def resolve_schedules(
    system: System,
    forward: bool,
    instant: Instant,
    before: Outcome,
    x_minus: np.ndarray,
    schedules: tuple[int, ...],
    error: np.ndarray,
    s_error: float,
    adopted: Instant | None,
) -> Outcome:
    """Resolve a scheduled event, with the values of the inputs just after the event.

    before: the outcome that holds until then. s_error: error of the times of zeros located there. adopted: the
    last event before. One within two roundings has its zero at the instant as well.
    """
    rounding = math.ulp(float(instant))
    if adopted is not None and abs(instant.minus(adopted)) <= 2.0 * rounding:
        s_error = max(s_error, rounding)
    at = situation_when_due(system, forward, instant, before.p, x_minus, before.z, error)
    at.s_error = max(s_error, at.s_error)
    resets = [("schedule", k) for k in schedules]
    resolution = EventResolution(system, at, at.z.copy(), forward)
    resolution.jumped = surfaces_jump(system, instant, at, forward)
    return resolution.run((), resets)


def situation_when_due(
    system: System,
    forward: bool,
    instant: Instant,
    before: np.ndarray,
    x: np.ndarray,
    z: np.ndarray,
    error: np.ndarray,
) -> Situation:
    """Return the state at a scheduled time, with the values of the inputs just after that time.

    before: the run-time vector that holds until then.
    """
    p = system.vector(instant, system.discrete(before), forward)
    error = _with_evaluated(system, before, x, p, z, error)
    return Situation(0.0, x.copy(), p, z.copy(), error, math.ulp(0.0))


def _with_evaluated(
    system: System, before: np.ndarray, x: np.ndarray, p: np.ndarray, z: np.ndarray, error: np.ndarray
) -> np.ndarray:
    """Return error bounds of the states at a scheduled time, with new bounds for the held states.

    Held states were evaluated at a local time of the run-time vector `before`, and are judged at the origin of p. Both
    times are rounded.
    """
    held, error = system.evaluated(z), error.copy()
    if held:
        origin, now = before[system.layout.origin_at], p[system.layout.origin_at]
        rounding = 2.0 * math.ulp(max(abs(origin), abs(now)))
        early, late = (system.project(now - origin + d, x, before, z) for d in (-rounding, rounding))
        error[held] = UNIT * np.abs(x[held]) + np.abs(late - early)[held]
    return error


def apply_crossed(
    system: System, forward: bool, outcome: Outcome, s: float, monitors: MonitorSides
) -> Outcome:
    """Apply the resets of monitors that crossed zero in an event or through another monitor's reset."""
    changes = list(outcome.changes)
    while not outcome.status and forward and (due := monitors.fire(outcome, "reset")):
        monitors.fire(outcome)
        at = Situation(s, outcome.x.copy(), outcome.p, outcome.z.copy(), outcome.x_error, math.ulp(s))
        resets = [("monitor", k) for k in due]
        outcome = EventResolution(system, at, at.z.copy(), forward).run((), resets)
        changes += outcome.changes
        outcome.continuous = False
    outcome.changes = changes
    return outcome
