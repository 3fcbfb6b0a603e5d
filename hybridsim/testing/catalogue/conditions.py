"""This module contains test cases of conditions on time and states that make rates, contacts and guards jump."""

from __future__ import annotations

import math

from hybridsim.testing.scene import Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return test cases of pulses, a region, partial sliding, and jumps of a load, a belt and guards."""
    return _pulses(), _region(), _held_in_part(), _load(), _belt(), _guards()


def _pulses() -> Scene:
    """Return the test case of pulses in a rate; the solution is the sum of their widths times their heights."""
    states = ((20.0, (0.0, 0.0, 0.0, 20.0, -10.0)), (100.0, (1000.0, 40.0, 10.0, 50.0, -80.0)))
    return named("conditions", (0.0, 100.0), Truth((), states), unit=10.0)


def _region() -> Scene:
    """Return the test case of a condition on x = t - 1, y = t - 2 and x + y, which is true from t = 2 to 5.5."""
    states = ((4.0, (3.0, 2.0, 2.0, 2.0)), (10.0, (9.0, 8.0, 3.5, 6.5)))
    return named("region", (0.0, 10.0), Truth(None, states), needs("sliding"))


def _held_in_part() -> Scene:
    """Return the test case of a state x that reaches zero at t = 3, stays there until t = 5, and then grows."""
    states = ((2.0, (-1.0, 1.0)), (4.0, (0.0, 1.0)), (5.0, (0.0, 0.0)), (10.0, (5.0, -5.0)))
    return named("held-in-part", (0.0, 10.0), Truth(None, states), needs("sliding"))


def _load() -> Scene:
    """Return the test case of a load that jumps: an oscillation without friction, then friction, then stick."""
    x, v = 3 * math.cos(0.4), -3 * math.sin(0.4)
    amplitude, angle = math.hypot(x - 2, v), math.atan2(-v, x - 2)
    stop = 0.4 + math.pi - angle
    states = (
        (0.2, (3 * math.cos(0.2), -3 * math.sin(0.2))),
        (1.4, (2 + amplitude * math.cos(1.0 + angle), -amplitude * math.sin(1.0 + angle))),
        (5.0, (2 - amplitude, 0.0)),
    )
    truth = Truth(((stop, "f:stick"),), states)
    return named("stepped-load", (0.0, 5.0), truth, needs("contacts", "scheduled", "exact-stick"), speed=3.0)


def _belt() -> Scene:
    """Return the test case of a belt that overtakes a block, after which the block follows and stops."""
    events = ((1.0, "f:slip-"), (3.0, "f:stick"), (8.0, "f:slip+"), (10.0, "f:stick"))
    states = ((2.0, (0.5,)), (5.0, (1.0,)), (9.0, (0.5,)), (12.0, (0.0,)))
    truth = Truth(events, states)
    return named("stepped-belt", (0.0, 12.0), truth, needs("contacts", "scheduled", "exact-stick"))


def _guards() -> Scene:
    """Return the test case of a tank whose guards jump, at the border of a condition or at a known time."""
    states = ((3.0, (2.0, 0.0)), (6.0, (5.0, 3.0)), (10.0, (9.0, -1.0)))
    return named(
        "stepped-guard", (0.0, 10.0), Truth(None, states), needs("sliding", "transitions", "scheduled")
    )
