"""Scenes of conditions that jump: combined comparisons of time and states in rates, contacts and guards."""

from __future__ import annotations

import math

from hybridsim.testing.scene import Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """Return scenes of pulses, a region, partial sliding, and jumps of a load, a belt and guards."""
    return _pulses(), _region(), _held_in_part(), _load(), _belt(), _guards()


def _pulses() -> Scene:
    """The solution is the sum of widths times heights."""
    states = ((20.0, (0.0, 0.0, 0.0, 20.0, -10.0)), (100.0, (1000.0, 40.0, 10.0, 50.0, -80.0)))
    return Scene("conditions", "conditions", (0.0, 100.0), Truth((), states), unit=10.0)


def _region() -> Scene:
    """The states x = t - 1 and y = t - 2 are positive after t = 2, and their sum is below 8 until t = 5.5."""
    states = ((4.0, (3.0, 2.0, 2.0, 2.0)), (10.0, (9.0, 8.0, 3.5, 6.5)))
    return Scene("region", "region", (0.0, 10.0), Truth(None, states), needs("sliding"))


def _held_in_part() -> Scene:
    """The state x reaches zero at t = 3, stays there while y > 0 until t = 5, and then grows."""
    states = ((2.0, (-1.0, 1.0)), (4.0, (0.0, 1.0)), (5.0, (0.0, 0.0)), (10.0, (5.0, -5.0)))
    return Scene("held-in-part", "held-in-part", (0.0, 10.0), Truth(None, states), needs("sliding"))


def _load() -> Scene:
    """The motion is 3 cos t without friction, then half an oscillation about x = 2, which ends in stick."""
    x, v = 3 * math.cos(0.4), -3 * math.sin(0.4)
    amplitude, angle = math.hypot(x - 2, v), math.atan2(-v, x - 2)
    stop = 0.4 + math.pi - angle
    states = (
        (0.2, (3 * math.cos(0.2), -3 * math.sin(0.2))),
        (1.4, (2 + amplitude * math.cos(1.0 + angle), -amplitude * math.sin(1.0 + angle))),
        (5.0, (2 - amplitude, 0.0)),
    )
    truth = Truth(((stop, "f:stick"),), states)
    return Scene(
        "stepped-load",
        "stepped-load",
        (0.0, 5.0),
        truth,
        needs("contacts", "scheduled", "exact-stick"),
        speed=3.0,
    )


def _belt() -> Scene:
    """The belt overtakes the block, which follows at the rate 1/2, and stops below it."""
    events = ((1.0, "f:slip-"), (3.0, "f:stick"), (8.0, "f:slip+"), (10.0, "f:stick"))
    states = ((2.0, (0.5,)), (5.0, (1.0,)), (9.0, (0.5,)), (12.0, (0.0,)))
    truth = Truth(events, states)
    return Scene(
        "stepped-belt", "stepped-belt", (0.0, 12.0), truth, needs("contacts", "scheduled", "exact-stick")
    )


def _guards() -> Scene:
    """The tank fills from t = 3 to x = 5 at t = 6, and empties at twice the rate to x = 7 at t = 8."""
    states = ((3.0, (2.0, 0.0)), (6.0, (5.0, 3.0)), (10.0, (9.0, -1.0)))
    return Scene(
        "stepped-guard",
        "stepped-guard",
        (0.0, 10.0),
        Truth(None, states),
        needs("sliding", "transitions", "scheduled"),
    )
