"""Scenes of stiffness: regularised friction, and a smooth control."""

from __future__ import annotations

import math

from hybridsim.testing.facts import CASES, recomputed
from hybridsim.testing.scene import Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """No event at all: the controls, one of them stiff."""
    stiff = CASES["TANH"]["expected"]["eps_1e_6"]
    return (
        Scene("FMI-vdp", "vdp", (0.0, 20.0), Truth((), recomputed("FMI-vdp")[1]), unit=6.66, speed=3.0),
        Scene(
            "TANH-1e-3",
            "tanh",
            (0.0, 20.0),
            Truth((), recomputed("TANH-1e-3")[1]),
            params={"eps": 1e-3},
            unit=6.28,
            speed=10.0,
            tol_x=1e-7,
        ),
        Scene(
            "TANH-1e-6",
            "tanh",
            (0.0, 20.0),
            Truth((), ((5.0, tuple(stiff["5"])), (20.0, (stiff["20"], None)))),
            needs("stiff"),
            params={"eps": 1e-6},
            unit=6.28,
            speed=10.0,
            tol_x=1e-7,
            floor=1e-9,
        ),
        _decades(),
    )


def _decades() -> Scene:
    """One half-life is ln(2)/1e8, the other ln(2)."""
    early, late = math.log(2) * 1e-8, math.log(2)
    states = (
        (early, (math.exp(-early), 0.5)),
        (late / 2, (math.sqrt(0.5), 0.5)),
        (2.0, (math.exp(-2.0), 0.5)),
    )
    return Scene(
        "eight-decades",
        "decades",
        (0.0, 2.0),
        Truth(((early, "a:held"), (late, "b:low")), states),
        needs("transitions", "adaptive"),  # no fixed step suits both
        tol_t=1e-9,
        tol_x=1e-9,
    )
