"""This module contains test cases of a stop in the direction of friction: bounces without end, rest, and release."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.testing.catalogue.impacts import closed, closes
from hybridsim.testing.checks import at_times
from hybridsim.testing.scene import END, Scene, Truth, named, needs

# of rubbing-stop.toml, mass 1: what drives the block in and what brakes it on its way out, less and plus its friction
PUSH, LIMIT, E, START, RISE = 10.0, 2.0, 0.5, 1.0, 5.0
IN, OUT = PUSH - LIMIT, PUSH + LIMIT
FALL = math.sqrt(2 * START / IN)
SHRINKS = E * math.sqrt(IN / OUT)  # speed of one blow over that of the one before
REST = FALL + E * IN * FALL * (1 / OUT + 1 / math.sqrt(IN * OUT)) / (1 - SHRINKS)
OFF = 3.0 + (PUSH + LIMIT) / RISE  # the pull has come to what friction carries
LAST = 6.0


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of stops."""
    return (_stop(),)


def _motion(t: float) -> tuple[float, float, float]:
    """Return the position, the velocity and the applied force of the exact motion."""
    drive = -PUSH + RISE * max(t - 3.0, 0.0)
    if t >= OFF:
        return RISE * (t - OFF) ** 3 / 6, RISE * (t - OFF) ** 2 / 2, drive
    if t >= REST:
        return 0.0, 0.0, drive
    if t < FALL:
        return START - IN * t**2 / 2, -IN * t, drive
    began, speed = FALL, E * IN * FALL
    while t >= began + speed * (1 / OUT + 1 / math.sqrt(IN * OUT)):
        began, speed = began + speed * (1 / OUT + 1 / math.sqrt(IN * OUT)), SHRINKS * speed
    out = min(t - began, speed / OUT)
    back = t - began - out
    return speed * out - OUT * out**2 / 2 - IN * back**2 / 2, speed - OUT * out - IN * back, drive


def _pulled_off(solution: Any) -> list[str]:
    """Check that the friction limit is reached at the instant at which the gap opens."""
    found = {
        name: [e.t for e in solution.events if e.component == name and e.source == mode and e.t > REST + 1e-3]
        for name, mode in (("f", "stick"), ("p", "closed"))
    }
    return [
        f"{name} lets go {at_times(times)} instead of once, at t = {OFF!r}"
        for name, times in found.items()
        if len(times) != 1 or abs(times[0] - OFF) > 1e-6
    ]


def _rests(solution: Any) -> list[str]:
    found = closed("p", solution)
    return (
        [f"p closes {at_times(found)} instead of {REST!r}"] if found and abs(found[0] - REST) > 1e-6 else []
    )


def _stop() -> Scene:
    times = (0.3, 0.6, 0.8, 1.0, 1.05, 2.0, 4.0, 5.2, 5.7)
    states = (*((t, _motion(t)) for t in times), (END, _motion(LAST)))
    checks = (("located", closes("p")), ("located", _rests), ("located", _pulled_off))
    return named(
        "rubbing-stop",
        (0.0, LAST),
        Truth(None, states, checks=checks),
        needs("contacts", "impacts", "accumulation", "located"),
        speed=4.0,
        tol_x=1e-8,
    )
