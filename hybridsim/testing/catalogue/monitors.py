"""This module contains test cases of monitors: at stops and bounces, with all actions, and with other guards."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.testing.checks import at_times, equals
from hybridsim.testing.scene import END, Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of monitors."""
    return _stops(), _bounces(), _table(), _corner(), _rope()


def _stops() -> Scene:
    """Return the test case of monitors on the speeds of two bodies, which decrease to zero and stay zero."""
    first = ((1.0, "f:stick"), (1.0, "stopped"), (1.0, "counted"))
    return Scene(
        "monitors-at-stops",
        "stops-watched",
        (0.0, 3.0),
        Truth(
            (*first, (1.5, "g:stick"), (1.5, "done")),
            ((0.5, (0.5, 1.0)), (END, (0.0, 0.0))),
            status="terminated",
            end=1.5,
            checks=(("", equals(1.25, stops=1.0)),),
        ),
        needs("monitors", "adaptive"),
        tol_t=1e-12,
    )


def _bounces() -> Scene:
    """Return the test case of monitors on a ball that first hits the floor at t = 1 and rests at t = 3."""
    return Scene(
        "monitors-at-bounces",
        "bounces-watched",
        (0.0, 4.0),
        Truth(
            None,
            ((1.5, (0.25, 0.0)), (4.0, (0.0, 0.0))),
            checks=(("", equals(4.0, n=1.0)), ("", _fires_at_rest)),
        ),
        needs("impacts", "accumulation", "monitors", "adaptive"),
        tol_t=1e-10,
    )


def _fires_at_rest(solution: Any) -> list[str]:
    wrong = []
    for name in ("recorded", "counted"):
        times = [event.t for event in solution.events if event.component == name]
        if len(times) != 1 or abs(times[0] - 3.0) > 1e-6:
            wrong.append(f"monitor {name} fires {at_times(times)} instead of once, at t = 3")
    return wrong


def _table() -> Scene:
    """Return the test case of monitors on a table that falls to zero and rises again."""
    return Scene(
        "monitors-of-a-turning-table",
        "turning-table",
        (0.0, 2.0),
        Truth((), ((1.0, (25.0,)), (2.0, (50.0,))), checks=(("", equals(2.0, n=0.0)),)),
        needs("monitors", "adaptive"),
    )


def _corner() -> Scene:
    """Return the test case of a body in the corner of a box, which hits two walls at t = 1, 3 and 5."""
    return Scene(
        "corners-of-a-box",
        "box-corner",
        (0.0, 5.5),
        Truth(
            tuple((t, "box:fly") for t in (1.0, 1.0, 3.0, 3.0, 5.0, 5.0)),
            ((2.0, (0.0, 0.0, -1.0, -1.0)), (5.5, (0.5, 0.5, -1.0, -1.0))),
            checks=(("", equals(5.5, n=6.0)),),
        ),
        needs("transitions"),
        tol_t=1e-9,
    )


def _rope() -> Scene:
    """Return the test case of a rope that slides off a table, with solution b/a + (1/2 - b/a) cosh(sqrt(a) t)."""
    a, b = 9.81 * 1.3 / 2.0, 9.81 * 0.3
    rest = b / a
    end = math.acosh((2.0 - rest) / (0.5 - rest)) / math.sqrt(a)
    speed = (0.5 - rest) * math.sqrt(a) * math.sinh(math.sqrt(a) * end)
    return Scene(
        "end-where-a-load-vanishes",
        "rope-off-table",
        (0.0, 9.0),
        Truth(((end, "off"),), ((END, (2.0, speed)),), status="terminated", end=end),
        needs("monitors", "adaptive"),
        unit=1.0,
        tol_x=1e-7,
    )
