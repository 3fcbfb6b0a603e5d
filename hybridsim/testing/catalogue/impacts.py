"""This module contains test cases of impacts with restitution: bounces without end, double impacts, rows of balls."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from hybridsim.testing.checks import at_times, equals
from hybridsim.testing.facts import TRUTHS
from hybridsim.testing.scene import END, Scene, Truth, named, needs

G, E, H0 = 10.0, 0.5, 1.25  # of bounce.toml and bar.toml: a fall of half a second, and 5 m/s at its end
FALL = math.sqrt(2 * H0 / G)
REST = FALL * (1 + E) / (1 - E)


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of impacts with restitution."""
    return _bounce(), _bar(), _table(), _walls()


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
    """Return a check of a solution: each contact closes exactly once."""

    def check(solution: Any) -> list[str]:
        found = {name: closed(name, solution) for name in names}
        return [
            f"{name} closes {at_times(times)} instead of once"
            for name, times in found.items()
            if len(times) != 1
        ]

    return check


def rests(*names: str) -> Any:
    """Return a check of a solution: contacts close at the time at which the bounces end, within 1e-6."""

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
    return named("bounce", (0.0, 2.0), Truth(None, states, checks=checks), **_BOUNCES)


def _bar() -> Scene:
    """Return the test case of a bar that is hit at both ends at once, stays level, and bounces like a ball."""
    heights = ((t, _height(t)) for t in (0.3, 0.8, 1.1))
    states = (*((t, (h, h, w, w)) for t, (h, w) in heights), (END, (0.0,) * 4))
    checks = (
        ("", closes("p", "q")),
        ("located", rests("p", "q")),
        ("", equals(2.0, a=0.0, b=0.0, va=0.0, vb=0.0)),
    )
    return Scene("bar-on-two-supports", "bar", (0.0, 2.0), Truth(None, states, checks=checks), **_BOUNCES)


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


def _walls() -> Scene:
    """Return the test case of balls of masses 1 and 3 between walls, with rational impact times and velocities."""
    end = 12
    hits, motion = _impacts_of_row(end)
    sampled = (Fraction(1, 2), Fraction(2), Fraction(5), Fraction(9), Fraction(end))
    return named(
        "balls-between-walls",
        (0.0, float(end)),
        Truth(
            tuple((float(t), f"{name}:open") for t, name in hits),
            tuple((float(t), _state_of_row(motion, t)) for t in sampled),
        ),
        needs("impacts", "located"),
        tol_t=1e-9,
        tol_x=1e-9,
    )


# a time, and the positions and velocities just after it
Row = tuple[Fraction, list[Fraction], list[Fraction]]


def _impacts_of_row(end: int) -> tuple[list[tuple[Fraction, str]], list[Row]]:
    """Return the times and names of the impacts of the two balls, and the motion after each of them, as fractions.

    Between impacts the velocities are constant. An impact at a wall multiplies the velocity by -e. An impact of the
    balls keeps their momentum and multiplies the velocity of approach by -e.
    """
    e, m1, m2 = Fraction(3, 4), 1, 3
    now, x, v = Fraction(0), [Fraction(1, 4), Fraction(5, 8)], [Fraction(1), Fraction(-1, 2)]
    hits: list[tuple[Fraction, str]] = []
    motion = [(now, x, v)]
    while True:
        gaps = {"left": (x[0], v[0]), "middle": (x[1] - x[0], v[1] - v[0]), "right": (1 - x[1], -v[1])}
        time, name = min((now - gap / rate, name) for name, (gap, rate) in gaps.items() if rate < 0)
        if time > end:
            return hits, motion
        x = [place + speed * (time - now) for place, speed in zip(x, v, strict=True)]
        if name == "left":
            v = [-e * v[0], v[1]]
        elif name == "right":
            v = [v[0], -e * v[1]]
        else:
            mean, apart = (m1 * v[0] + m2 * v[1]) / (m1 + m2), e * (v[0] - v[1]) / (m1 + m2)
            v = [mean - m2 * apart, mean + m1 * apart]
        now = time
        hits.append((now, name))
        motion.append((now, x, v))


def _state_of_row(motion: list[Row], t: Fraction) -> tuple[float, ...]:
    """Return x1, v1, x2 and v2 at a time."""
    since, x, v = [row for row in motion if row[0] <= t][-1]
    return tuple(float(value) for k in range(2) for value in (x[k] + v[k] * (t - since), v[k]))
