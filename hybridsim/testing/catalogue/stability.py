"""Scenes of stability: steps beyond what a fast contact or a fast filter allows, and ten thousand periods."""

from __future__ import annotations

import math

from hybridsim.testing.scene import END, Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """All of them."""
    return _walls(), _follower(), _long_swing()


def _walls() -> Scene:
    """Flights of length 2 (1 at first) at speed 1, and contacts of pi/sqrt(k) that turn it."""
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
    return Scene(
        "stiff-walls",
        "stiff-walls",
        (0.0, 10.0),
        Truth(tuple(events), states),
        needs("transitions", "adaptive"),  # a fixed step that suits the flight passes the contact
        tol_x=1e-7,
    )


def _follower() -> Scene:
    """x = sin(t) whatever the rate is."""
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
    """bilinear over ten thousand periods."""
    period = 1.5 * math.pi
    root = math.sqrt(0.5)
    end = 1e4 * period
    states = ((5e3 * period + math.pi / 8, (root, -2 * root)), (end - math.pi / 8, (root, 2 * root)))
    return Scene(
        "long-swing",
        "bilinear",
        (0.0, end),
        Truth((), (*states, (END, (1.0, 0.0)))),
        unit=period,
        speed=2.0,
        tol_x=1e-6,
        floor=1e-7,
        tolerances=(1e-9, 1e-12),
        effort=10_000_000,
    )
