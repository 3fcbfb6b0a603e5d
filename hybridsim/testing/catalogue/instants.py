"""Scenes of several changes at one instant: resets that add, and guards and monitors at the tick of a clock."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.testing.checks import at_times, equals
from hybridsim.testing.scene import Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """Resets that add, and what comes to zero where a clock ticks."""
    return (_doses(), _counting_balls(), _guard_and_tick(), _carried_back())


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


def _guard_and_tick() -> Scene:
    """Every 0.3 the ramp of 0.7 comes to 0.21; 0.7 and 0.21 as doubles make that differ by some roundings."""
    times = [0.3 * k for k in range(1, 11)]
    return Scene(
        "guard-at-each-tick",
        "guard-and-tick",
        (0.0, 3.15),
        Truth(
            tuple((t, name) for t in times for name in ("top:rising", "back")),
            ((1.6, (0.07,)), (3.15, (0.105,))),
            checks=(("", equals(3.15, passed=10.0)),),
        ),
        needs("transitions", "scheduled", "adaptive"),
        unit=0.3,
        count_scheduled=True,
        tol_t=1e-12,
    )


def _carried_back() -> Scene:
    """The monitor touches zero and changes its side at no instant."""
    return Scene(
        "monitor-carried-back",
        "carried-back",
        (0.0, 3.15),
        Truth(
            None,
            ((1.6, (0.07,)), (3.15, (0.105,))),
            checks=(("", equals(3.15, ticks=10.0)), ("", _never_crossed)),
        ),
        needs("transitions", "monitors", "scheduled", "adaptive"),
        unit=0.3,
        tol_t=1e-12,
    )


def _never_crossed(solution: Any) -> list[str]:
    crossed = [event.t for event in solution.events if event.kind == "monitor"]
    return [f"the monitor fires {at_times(crossed)} instead of never"] if crossed else []
