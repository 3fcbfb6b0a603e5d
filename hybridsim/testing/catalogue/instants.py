"""Scenes of several changes at one instant: resets that add, and guards and monitors at the tick of a clock."""

from __future__ import annotations

import math

from hybridsim.testing.checks import equals
from hybridsim.testing.scene import Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """Resets that add."""
    return (_doses(), _counting_balls())


def _doses() -> Scene:
    """The amount follows from the doses before: each decays by exp(-1.2 t)."""
    doses = ((0.0, 100.0), (12.0, 50.0), (24.0, 200.0), (48.0, 100.0))

    def amount(t: float) -> tuple[float, ...]:
        return (math.fsum(dose * math.exp(-1.2 * (t - due)) for due, dose in doses if due <= t),)

    events = ((0.0, "morning"), (12.0, "evening"), (24.0, "evening"), (24.0, "evening"), (24.0, "morning"))
    return Scene(
        "doses-at-one-instant",
        "doses",
        (0.0, 50.0),
        Truth((*events, (48.0, "morning")), tuple((t, amount(t)) for t in (12.0, 24.0, 25.0, 50.0))),
        needs("scheduled"),
        count_scheduled=True,
    )


def _counting_balls() -> Scene:
    """Four bounces of each ball, of restitution 0.8, from 1 m: the k-th flight takes 2 (0.8)**k of the fall."""
    fall = math.sqrt(2.0 / 9.81)
    times = [fall * (1.0 + 2.0 * sum(0.8**i for i in range(1, k + 1))) for k in range(4)]
    events = tuple((t, f"{ball}:flight") for t in times for ball in ("one", "two"))
    return Scene(
        "bounces-of-two-balls",
        "counting-balls",
        (0.0, 2.4),
        Truth(events, checks=(("", equals(2.4, bounces=8.0)),)),
        needs("transitions"),
        unit=fall,
    )
