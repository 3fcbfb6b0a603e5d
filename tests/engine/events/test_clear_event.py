"""What is settled at first sight is what the whole discussion comes to, to the last bit."""

from __future__ import annotations

import json
from typing import Any

from engine.uncompiled import uncompiled

import hybridsim as hs
from hybridsim.engine.events.compiled import resolve_ordinary

STATES = {
    "x1": hs.State("x1", 0, "v1"),
    "v1": hs.State("v1", 0, "a*sin(w*t) - 0.05*v1 - x1 - 0.6*(x1 - x2) - f1"),
    "x2": hs.State("x2", 0, "v2"),
    "v2": hs.State("v2", 0, "-0.05*v2 - x2 - 0.6*(x2 - x1) - f2"),
}
COULOMB = {"law": "coulomb", "arguments": {"mu": 1}}
DROPPING = {"law": "static-kinetic", "arguments": {"mu_s": 1, "mu_k": 0.7}}


def pair(a: float, w: float, first: dict[str, Any], second: dict[str, Any], belt: float = 0.0) -> hs.Model:
    """Two masses on springs, each with a contact of its own; a belt runs under the second."""
    return hs.Model(
        "pair",
        list(STATES.values()),
        parameters={"a": a, "w": w, "L1": 0.6, "L2": 0.25},
        contacts=[
            hs.Contact("f1", velocity="v1", normal="L1", **first),
            hs.Contact("f2", velocity=f"v2 - {belt}", normal="L2", **second),
        ],
    )


# no force of it is a function of time
LEFT_ALONE = hs.Model(
    "alone",
    [hs.State("x", 0, "v"), hs.State("v", 0.1, "-x - f")],
    contacts=[hs.Contact("f", velocity="v - 0.1", normal=1, **DROPPING)],
)

SCENES: dict[str, tuple[Any, float, int]] = {
    "reversals": (hs.load("dfcs").with_(F0=60, N=40, omega="1.4*sqrt(k/m)"), 0.1, 10),
    "stops": (hs.load("dfcs").with_(F0=30, N=40, omega="0.6*sqrt(k/m)"), 0.2, 30),
    "two contacts": (pair(1.0, 0.4, COULOMB, COULOMB), 150.0, 60),
    "two that let go": (pair(1.3, 0.7, DROPPING, DROPPING), 100.0, 30),
    "a belt": (pair(1.0, 0.5, DROPPING, DROPPING, belt=0.05), 100.0, 20),
    "left alone": (LEFT_ALONE, 100.0, 15),
    "slow and hard to move": (pair(0.9, 0.05, COULOMB, DROPPING), 300.0, 15),
}


def found(model: Any, end: float) -> list[Any]:
    """All that a run has found, bit by bit, and how many events were settled at first sight."""
    seen, resolve = [0], resolve_ordinary.resolve_clear

    def counted(*arguments: Any) -> bool:
        is_clear = bool(resolve(*arguments))
        seen[0] += is_clear
        return is_clear

    resolve_ordinary.resolve_clear = counted
    try:
        sol = hs.simulate(model, (0, end), integrator="exact")
    finally:
        resolve_ordinary.resolve_clear = resolve
    events = [
        [e.t.hex(), e.component, e.source, e.target, *(float(v).hex() for v in e.x_plus)] for e in sol.events
    ]
    return [seen[0], sol.status, events, [float(v).hex() for v in sol.y[:, -1]]]


def both() -> None:
    """Print what is found in each scene with and without a first sight."""
    at_first_sight = {name: found(model, end) for name, (model, end, _) in SCENES.items()}
    resolve_ordinary.resolve_clear = lambda *_: False
    print(
        json.dumps(
            {name: [at_first_sight[name], found(model, end)] for name, (model, end, _) in SCENES.items()}
        )
    )


def test_nothing_is_settled_otherwise() -> None:
    told = json.loads(uncompiled("from engine.events.test_clear_event import both\nboth()"))
    assert told.keys() == SCENES.keys()
    for scene, ((clear, *one), (none, *other)) in told.items():
        assert none == 0, scene
        assert clear >= SCENES[scene][2], scene
        assert one[0] == "finished", scene
        assert one == other, scene
