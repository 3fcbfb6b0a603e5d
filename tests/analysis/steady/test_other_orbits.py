"""Newton's method may find a stable orbit that the run from the start does not approach: it is not the steady motion.

Two blocks on a moving base slide with friction, and the second one hits a wall. At this forcing a motion without
impacts is stable, with 7.851 mm as its largest x2. A separate loop around `scipy.integrate.solve_ivp` with its own
events, from rest, still hits the wall at 8 mm after 500 periods.
"""

from __future__ import annotations

import numpy as np

import hybridsim as hs

WALL, F = 0.008, 20.0


def blocks(start: dict[str, float]) -> hs.Model:
    """The two blocks, with the impacts on the wall as a guard and a reset."""
    hit = hs.Guard("touch", "wall - x2", hs.Choice("free", reset={"x2": "wall", "v2": "-0.6*v2"}))
    law = {"law": "static-kinetic", "arguments": {"mu_s": 0.3, "mu_k": 0.2}}
    return hs.Model(
        "blocks",
        parameters={"wall": WALL, "w": 2.0 * np.pi * F},
        definitions={"s": "5000*(x2 - x1)", "b": "4000*(0.003*sin(w*t) - x1) + 8*(0.003*w*cos(w*t) - v1)"},
        states=[
            hs.State("x1", start.get("x1", 0.0), "v1", nominal=1e-3),
            hs.State("v1", start.get("v1", 0.0), "b + s - f1", nominal=0.1),
            hs.State("x2", start.get("x2", 0.0), "v2", nominal=1e-3),
            hs.State("v2", start.get("v2", 0.0), "(-s - f2)/0.5", nominal=0.1),
        ],
        contacts=[
            hs.Contact("f1", velocity="v1", normal="9.81", **law),
            hs.Contact("f2", velocity="v2", normal="0.5*9.81", **law),
        ],
        components=[hs.Component("hits", [hs.Mode("free", hit)])],
    )


def test_an_orbit_that_the_run_does_not_approach_is_not_its_steady_motion() -> None:
    model = blocks({})
    steady = hs.steady_state(model, max_periods=64)
    assert steady.kind != "periodic"
    run = hs.simulate(model, (0.0, 64.0 / F))
    assert run.event_times("hits").max() > 54.0 / F
