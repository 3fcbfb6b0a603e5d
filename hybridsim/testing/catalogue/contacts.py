"""This module contains test cases of stick: with other laws, on a belt, and with several contacts at once."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.testing.checks import exact_stick
from hybridsim.testing.facts import CASES, recomputed
from hybridsim.testing.scene import Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return test cases of contacts with other laws, of a contact on a belt, and of several contacts at once."""

    def belt(name: str, delta: float) -> Scene:
        events, states = recomputed(name)
        fact = CASES[name]
        x, v = fact["x0"]
        return Scene(
            name,
            "belt",
            tuple(fact["t_span"]),
            Truth(events, states, checks=(("exact-stick", exact_stick("f", {"v": 0.2})),)),
            needs("contacts", "exact-stick"),
            params={"delta": delta},
            start={"x": x, "v": v},
            unit=10.0,
            start_is_event=False,
        )

    events, states = recomputed("MSL-stribeck")
    at_rest = (("exact-stick", exact_stick("f", {"v": 0.0}, rest=("x",))),)
    stribeck = Scene(
        "MSL-stribeck",
        "stribeck",
        (0.0, 5.0),
        Truth(events, states, checks=at_rest),
        needs("contacts", "exact-stick"),
        unit=4.0,
        start_is_event=False,
        speed=8.0,
    )
    events, states = recomputed("NOS-blocks0")
    stops = tuple(("exact-stick", exact_stick(f"f{i}", {f"v{i}": 0.0}, rest=(f"q{i}",))) for i in (1, 2, 3))
    blocks = Scene(
        "NOS-blocks0",
        "blocks",
        (0.0, 12.0),
        Truth(events, states, checks=stops),
        needs("contacts", "exact-stick"),
        unit=5.0,
        start_is_event=False,
    )
    return belt("LEINE-3", 3.0), belt("NOS-codim1", 1.0), stribeck, blocks, tied(), turning_belt()


def tied() -> Scene:
    """Return the test case of two contacts that reach their limits together; only one of them releases."""
    release, own, forced = math.asin(0.4) / 4, math.sqrt(30), 7.5 / 14

    def after(t: float) -> tuple[float, float]:
        """Return position and velocity of body 2, released at rest, with x2'' + 30 x2 = 7.5 sin(4 t) - 2.1."""
        x0 = -forced * math.sin(4 * release) + 0.07
        v0 = -4 * forced * math.cos(4 * release) / own
        c, s = math.cos(own * (t - release)), math.sin(own * (t - release))
        x = x0 * c + v0 * s + forced * math.sin(4 * t) - 0.07
        return x, own * (v0 * c - x0 * s) + 4 * forced * math.cos(4 * t)

    states = tuple((t, (0.0, 0.0, *after(t))) for t in (0.15, 0.2))
    return named(
        "tied-limits",
        (0.0, 0.2),
        Truth(((release, "b:slip+"),), states),
        needs("contacts", "exact-stick", "adaptive"),  # with a fixed step both limits are exceeded at once
        start_is_event=False,
        unit=0.2,
    )


def turning_belt() -> Scene:
    """Return the test case of a belt whose speed jumps, so that the body slips."""
    turns = ["f:stick", "f:slip+", "f:slip-"]
    states = ((0.5, (0.5,)), (1.5, (1.0,)), (3.25, (-0.5,)), (4.5, (0.25,)))
    return named(
        "turning-belt",
        (0.0, 5.0),
        Truth(None, states, checks=(("", sequence(turns)),)),
        needs("contacts", "exact-stick", "scheduled"),
        unit=1.0,
        start_is_event=False,
    )


def sequence(expected: list[str]) -> Any:
    """Return a check of a solution: the mode changes have the expected order; their times are not checked."""

    def check(solution: Any) -> list[str]:
        found = [f"{e.component}:{e.target}" for e in solution.events if e.component]
        return (
            []
            if found == expected
            else [f"the modes follow as {', '.join(found)} instead of {', '.join(expected)}"]
        )

    return check
