"""This module contains test cases of stability: steps too long for a fast contact, and thousands of periods."""

from __future__ import annotations

import math

from hybridsim.testing.scene import Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return all test cases in which long steps are unstable."""
    return _walls(), _follower(), _long_swing()


def _walls() -> Scene:
    """Return the test case of two stiff walls: flights take 2 time units at speed 1, and contacts take pi/sqrt(k)."""
    contact = math.pi / 1e3
    events, t = [], 1.0
    for n in range(5):
        events += [(t, "mode:left" if n % 2 else "mode:right"), (t + contact, "mode:free")]
        t += contact + 2.0
    states = (
        (0.5, (0.5, 1.0)),
        (1 + contact / 2, (1 + 1e-3, 0.0)),
        (2 + contact, (0.0, -1.0)),
        (8 + 4 * contact, (0.0, 1.0)),
        (10.0, (5 * contact, -1.0)),
    )
    return named(
        "stiff-walls",
        (0.0, 10.0),
        Truth(tuple(events), states),
        needs("transitions", "adaptive"),  # a fixed step that suits the flight passes the contact
        tol_x=1e-7,
    )


def _follower() -> Scene:
    """Return the test case of a fast filter with the solution x = sin(t) for every value of its rate."""
    return Scene(
        "step-limit",
        "follower",
        (0.0, 10.0),
        Truth((), tuple((t, (math.sin(t),)) for t in (0.5, 2.0, 5.0, 10.0))),
        needs("stiff"),
        unit=1.0,
        tol_x=1e-8,
    )


def _long_swing() -> Scene:
    """Return the test case of a swing with the solution cos(t) over two thousand periods."""
    end = 2000 * 2 * math.pi
    times = (end / 2 + 0.5, end - 1.0, end)
    return Scene(
        "long-swing",
        "swing",
        (0.0, end),
        Truth((), tuple((t, (math.cos(t), -math.sin(t))) for t in times)),
        unit=2 * math.pi,
        tol_x=1e-5,  # two thousand errors of the loosest tolerance
        floor=1e-10,  # a rounding of the time at the end is 2e-12
        tolerances=(1e-9, 1e-12),
        effort=100_000,
    )
