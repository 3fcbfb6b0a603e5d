"""Scenes of stiffness: regularised friction, and a smooth control."""

from __future__ import annotations

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
    )
