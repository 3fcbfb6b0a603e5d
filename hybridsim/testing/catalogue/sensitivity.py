"""Scenes that lose digits: chaos."""

from __future__ import annotations

from typing import Any

from hybridsim.testing.facts import CASES
from hybridsim.testing.scene import Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """All of them."""
    return (lifting(),)


def lifting() -> Scene:
    """A contact that opens, in chaotic motion: what a fixed step does wrong grows."""
    expected = CASES["FEENY"]["expected"]

    def turns(solution: Any) -> list[float]:
        return [e.t for e in solution.events if e.component == "f"]

    def counted(solution: Any) -> list[str]:
        found = len(turns(solution))
        return [] if found == expected["n_events"] else [f"{found} events, not {expected['n_events']}"]

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
