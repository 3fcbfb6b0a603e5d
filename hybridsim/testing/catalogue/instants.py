"""This module contains test cases of several changes at one instant, such as resets and zeros at clock ticks."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from hybridsim.testing.checks import at_times, equals
from hybridsim.testing.scene import Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return test cases of additive resets, zeros at clock ticks, zeros without a sign change, and copied values."""
    return (
        _doses(),
        _counting_balls(),
        _guard_and_tick(),
        _carried_back(),
        _samples(),
        _copied(),
        _successive_zeros(),
    )


def _doses() -> Scene:
    """Return the test case of doses that decay as exp(-1.2 t); several doses are due at one instant."""
    doses = ((0.0, 100.0), (3.0, 50.0), (6.0, 200.0), (12.0, 100.0))

    def amount(t: float) -> tuple[float, ...]:
        return (math.fsum(dose * math.exp(-1.2 * (t - due)) for due, dose in doses if due <= t),)

    events = ((0.0, "morning"), (3.0, "evening"), (6.0, "evening"), (6.0, "evening"), (6.0, "morning"))
    return Scene(
        "doses-at-one-instant",
        "doses",
        (0.0, 13.0),
        Truth((*events, (12.0, "morning")), tuple((t, amount(t)) for t in (3.0, 6.0, 7.0, 13.0))),
        needs("scheduled"),
        count_scheduled=True,
    )


def _counting_balls() -> Scene:
    """Return the test case of two balls that share a count of bounces and hit the ground simultaneously."""
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
    """Return the test case of a ramp 0.7 t that reaches 0.21 at a clock tick, except for rounding."""
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
    """Return the test case of a monitor that touches zero without changing its sign."""
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


def _samples() -> Scene:
    """Return the test case of a sine that is sampled at each change by 2. The sine touches this level at its peaks.

    Whether these touches are sampled is open, and with them the first level on the way back.
    """
    low, middle, high = (math.asin(0.25 * k) / math.tau for k in (1, 2, 3))
    starts = [0.5 * k for k in range(6)]
    due = [t + part for t in starts for part in (low, middle, high, 0.5 - middle, 0.5 - low, 0.5)][:-1]
    open_ = [t + part for t in starts for part in (0.25, 0.5 - high)] + [3.0]

    def state(t: float) -> tuple[float, float]:
        return 8.0 * math.sin(math.tau * t), 8.0 * math.cos(math.tau * t)

    def sampled(solution: Any) -> list[str]:
        found = [e.t for e in solution.events if e.component == "one" and e.kind == "transition"]
        missing = [t for t in due if not any(abs(t - at) < 1e-3 for at in found)]
        extra = [at for at in found if not any(abs(t - at) < 1e-3 for t in due + open_)]
        twice = [b for a, b in pairwise(found) if b - a < 1e-3]
        return [f"the sine is sampled {at_times(found)}"] if missing or extra or twice else []

    return Scene(
        "touch-beside-a-sample",
        "samplers",
        (0.0, 3.0),
        Truth(None, tuple((t, state(t)) for t in (0.4, 1.1, 2.6, 3.0)), checks=(("", sampled),)),
        needs("transitions", "adaptive", "accumulation"),  # a touch and a sample within the tolerances
        speed=50.0,
    )


def _copied() -> Scene:
    """Return the test case of x = 10 - 11.3 cos(sqrt(3) t), which is copied to other states when it reaches 0.7."""
    at, end = math.acos(9.3 / 11.3) / math.sqrt(3.0), 1.0

    def state(t: float) -> tuple[float, ...]:
        phase, since = math.sqrt(3.0) * t, t - at
        copies = (0.7 - since, 1.4 - since, -since) if since >= 0.0 else (-t, -t, -t)
        return (10.0 - 11.3 * math.cos(phase), 11.3 * math.sqrt(3.0) * math.sin(phase), *copies)

    return named(
        "copied-value",
        (0.0, end),
        Truth(((at, "s:after"),), tuple((t, state(t)) for t in (0.2, 0.6, end))),
        needs("transitions"),
        speed=20.0,
    )


def _successive_zeros() -> Scene:
    """Return the test case of three successive modes, each with a guard that is zero at t = 0.87/0.7."""
    at = 0.87 / 0.7
    return named(
        "chain-of-zeros",
        (0.0, 3.0),
        Truth(
            tuple((at, f"c:{mode}") for mode in ("second", "third", "last")),
            ((3.0, (2.1, 2.7, 3.3)),),
            checks=(("", _not_near),),
        ),
        needs("transitions", "adaptive"),
        tol_t=1e-12,
    )


def _not_near(solution: Any) -> list[str]:
    near = [event.t for event in solution.events if event.kind == "near-grazing"]
    return [f"a near-grazing is reported {at_times(near)}, where the guard leaves zero"] if near else []
