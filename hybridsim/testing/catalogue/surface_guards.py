"""This module contains test cases of guards that reach zero together with the velocity of a contact or a gap."""

from __future__ import annotations

import math

from hybridsim.testing.checks import exact_stick
from hybridsim.testing.scene import Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return test cases of guards that depend on speeds and gaps."""
    return _speeds(), _gaps()


def _speeds() -> Scene:
    """Return the test case of three bodies with guards on their speeds, which fire at stops."""
    back = math.sqrt(5.4) - 2.0  # after its kick the third body moves by -0.7 + 2 s + s**2/2
    turn = 0.8 + 1 / 3
    events = (
        (0.8, "thrown:after"),
        (1.0, "kicked:after"),
        (1.0, "h:slip-"),
        (turn, "f:slip-"),
        (1.25, "g:stick"),
        (1.0 + back, "h:slip+"),
    )
    states = (
        (0.9, (0.35, 0.28, 0.9, 0.0)),
        (1.1, (0.05, 0.12, 1.1, -0.7 + 0.2 + 0.005)),
        (2.0, (-0.5 * (2.0 - turn), 0.0, 2.0, (1.0 - back**2) / 2)),
    )
    checks = (("exact-stick", exact_stick("g", {"w": 0.0})),)
    return named(
        "guards-on-speeds",
        (0.0, 2.0),
        Truth(events, states, checks=checks),
        # the first speed reaches zero and is reset within one step
        needs("contacts", "transitions", "exact-stick", "multiple-roots"),
        start_is_event=False,
    )


def _gaps() -> Scene:
    """Return the test case of guards on two gaps with piecewise polynomial motion."""
    rest = math.sqrt(2.0)
    states = (
        (0.5, (0.75, -1.0, 1.75, -1.0, 0.0)),
        (1.25, (0.1875, 0.5, 2 - 1.25**2, -2.5, 0.0)),
        (1.75, (0.1875, -0.5, 0.0, 0.0, 0.0)),
    )
    return named(
        "guards-on-gaps",
        (0.0, 1.75),
        Truth(((1.0, "p:open"), (rest, "q:closed")), states),
        needs("impacts", "transitions", "located"),
        start_is_event=False,
    )
