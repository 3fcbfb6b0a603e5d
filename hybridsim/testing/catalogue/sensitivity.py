"""This module contains test cases that amplify errors, such as chaotic motion and grazing."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.testing.facts import CASES, recomputed
from hybridsim.testing.scene import Scene, Truth, needs

# impact-oscillator: the force a and the state at t = 0 of the vibration without a stop, whose amplitude is 1.0001 gaps.
_OMEGA, _DAMPING, _REACH = 2.5, 0.1, 1.0001
_D = (1 - _OMEGA**2) ** 2 + (_DAMPING * _OMEGA) ** 2
GRAZING_FORCE = _REACH * math.sqrt(_D)
GRAZING_START = (GRAZING_FORCE * (1 - _OMEGA**2) / _D, _DAMPING * _OMEGA**2 * GRAZING_FORCE / _D)


def scenes() -> tuple[Scene, ...]:
    """Return all test cases that amplify small errors."""
    return lifting(), grazing_stop()


def grazing_stop() -> Scene:
    """Return the test case of a vibration that hits a rigid stop at low speed, which amplifies errors."""
    events, states = recomputed("grazing-stop")
    return Scene(
        "grazing-stop",
        "impact-oscillator",
        (0.0, 15.0),
        Truth(events, states),
        needs("transitions", "multiple-roots"),
        params={"a": GRAZING_FORCE},
        start=dict(zip("xv", GRAZING_START, strict=True)),
        unit=2 * math.pi / _OMEGA,
        speed=2.5,
        tol_t=1e-5,  # after a touch at 0.035 of 2.5 in speed, errors are seventy times larger
        tol_x=1e-5,
        floor=1e-9,
    )


def lifting() -> Scene:
    """Return the test case of a contact that opens in chaotic motion, which amplifies errors of a fixed step."""
    expected = CASES["FEENY"]["expected"]

    def turns(solution: Any) -> list[float]:
        return [e.t for e in solution.events if e.component == "f"]

    def counted(solution: Any) -> list[str]:
        found = len(turns(solution))
        return (
            []
            if found == expected["n_events"]
            else [f"{found} changes of mode are found instead of {expected['n_events']}"]
        )

    def nearest_to(t: float) -> Any:
        return lambda solution: min(turns(solution), key=lambda found: abs(found - t))

    times = [(nearest_to(t), t) for t in (*expected["events_t_first"], *expected["close_pair"])]
    states = tuple((float(t), tuple(x)) for t, x in expected["samples"].items())
    return Scene(
        "FEENY",
        "feeny",
        (0.0, 40.0),
        Truth(None, states, tuple(times), checks=(("", counted),)),
        needs("contacts", "exact-stick", "transitions", "adaptive"),
        unit=5.0,
        tol_x=1e-7,
        tol_t=1e-7,
    )
