"""Scenes of impacts with restitution: infinitely many bounces, double impacts, a vibrating table."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.testing.checks import at_times, equals
from hybridsim.testing.facts import TRUTHS
from hybridsim.testing.scene import END, Scene, Truth, named, needs

G, E, H0 = 10.0, 0.5, 1.25  # of bounce.toml and bar.toml: a fall of half a second, and 5 m/s at its end
FALL = math.sqrt(2 * H0 / G)
REST = FALL * (1 + E) / (1 - E)


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of impacts with restitution."""
    return _bounce(), _bar(), _table()


def _height(t: float) -> tuple[float, float]:
    """Return height and velocity of the bouncing ball before it rests."""
    if t < FALL:
        return H0 - G * t**2 / 2, -G * t
    began, speed = FALL, E * G * FALL
    while began + 2 * speed / G <= t:
        began, speed = began + 2 * speed / G, E * speed
    return speed * (t - began) - G * (t - began) ** 2 / 2, speed - G * (t - began)


def closed(name: str, solution: Any) -> list[float]:
    """Return the times at which a contact closes in a solution."""
    return [e.t for e in solution.events if e.component == name and e.target == "closed"]


def closes(*names: str) -> Any:
    """Return a function that checks that each contact closes exactly once."""

    def check(solution: Any) -> list[str]:
        found = {name: closed(name, solution) for name in names}
        return [
            f"{name} closes {at_times(times)} instead of once"
            for name, times in found.items()
            if len(times) != 1
        ]

    return check


def rests(*names: str) -> Any:
    """Return a function that checks that the contacts close at the limit of the bounces, within 1e-6."""

    def check(solution: Any) -> list[str]:
        found = {name: closed(name, solution) for name in names}
        return [
            f"{name} closes {at_times(times)} instead of {REST!r}"
            for name, times in found.items()
            if times and abs(times[0] - REST) > 1e-6
        ]

    return check


# on a fixed grid the delay of a bounce is arbitrary
_BOUNCES: dict[str, Any] = {
    "needs": needs("impacts", "accumulation", "located"), "speed": 5.0, "tol_x": 1e-9,
}  # fmt: skip


def _bounce() -> Scene:
    """Return the test case of a ball that bounces from t = 0.5 on, and comes to rest at t = 1.5."""
    states = (*((t, _height(t)) for t in (0.3, 0.8, 1.1, 1.3)), (END, (0.0, 0.0)))
    checks = (("", closes("p")), ("located", rests("p")), ("", equals(2.0, h=0.0, w=0.0)))
    return named(
        "bounce",
        (0.0, 2.0),
        Truth(None, states, checks=checks),
        **_BOUNCES,
    )


def _bar() -> Scene:
    """Return the test case of a bar that is hit at both ends at once, stays level, and bounces like a ball."""
    heights = ((t, _height(t)) for t in (0.3, 0.8, 1.1))
    states = (*((t, (h, h, w, w)) for t, (h, w) in heights), (END, (0.0,) * 4))
    checks = (
        ("", closes("p", "q")),
        ("located", rests("p", "q")),
        ("", equals(2.0, a=0.0, b=0.0, va=0.0, vb=0.0)),
    )
    return Scene(
        "bar-on-two-supports",
        "bar",
        (0.0, 2.0),
        Truth(None, states, checks=checks),
        **_BOUNCES,
    )


def _table() -> Scene:
    """Return the test case of a ball on a vibrating table, which rests and is thrown again."""
    truth = TRUTHS["vibrating-table"]
    end = 0.25  # a rest and a throw; later periods are the same
    states = tuple((float(row[0]), tuple(row[1:])) for row in truth["states"] if row[0] < end)
    period = math.pi / 20
    return named(
        "vibrating-table",
        (0.0, end),
        Truth(None, states),
        needs("impacts", "accumulation"),
        unit=period,
        speed=0.4,
        tol_x=1e-8,
    )
