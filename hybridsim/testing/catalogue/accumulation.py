"""Scenes of events that follow each other ever faster."""

from __future__ import annotations

import math

from hybridsim.testing.checks import equals
from hybridsim.testing.facts import CASES
from hybridsim.testing.scene import Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """All of them."""
    return _ball()


def _ball() -> tuple[Scene, ...]:
    """The bouncing ball, with its rule of rest and without."""
    p = CASES["FMI-ball"]["params"]
    g, e, v_min = p["g"], p["e"], p["v_min"]
    fall = math.sqrt(2 / g)
    speed, times, states = g * fall, [fall], [(0.2, (1 - g * 0.02, -g * 0.2))]
    while e * speed >= v_min:
        speed *= e
        states.append((times[-1] + 0.3 * speed / g, (0.3 * speed**2 / g * (1 - 0.15), 0.7 * speed)))
        times.append(times[-1] + 2 * speed / g)
    events = [(t, "mode:flight") for t in times[:-1]] + [(times[-1], "mode:rest")]
    at_rest = (("", equals(times[-1] + 0.1, h=0.0, w=0.0)), ("", equals(3.0, h=0.0, w=0.0)))
    bouncing = Scene(
        "FMI-ball",
        "ball",
        (0.0, 3.0),
        Truth(tuple(events), (*states, (3.0, (0.0, 0.0))), checks=at_rest),
        needs("transitions"),
        tol_t=1e-9,
        tol_x=1e-9,
        speed=4.0,
    )
    endless = Scene(
        "ball-accumulation",
        "ball",
        (0.0, 3.0),
        Truth(None, ((0.2, states[0][1]),), status="accumulation", end=fall * (1 + e) / (1 - e)),
        needs("transitions", "accumulation"),
        params={"v_min": 0.0},
        speed=4.0,
    )
    return bouncing, endless
