"""This module contains test cases of starts and jumps, at which corners, guards and contacts choose their sides."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from hybridsim.testing.checks import exact_stick
from hybridsim.testing.scene import Scene, Truth, named, needs

_SUMS = (
    (-1.57, 0.265),
    (1.55, 0.547),
    (2.19, -0.164),
)  # a and b of starts-at-zeros and starts-at-belt-speeds


def scenes() -> tuple[Scene, ...]:
    """Return test cases with guards, contacts, a relay and a gap next to corners, and zeros at the start."""
    return _guards(), _contacts(), _relay(), _gap(), _sampled(), _order(), _flat(), _zeros(), _held()


def _guards() -> Scene:
    """Return the test case of guards with corners; all states move at constant rates."""
    events = (
        (0.5, "nested:after"),
        (1.0, "largest:after"),
        (1.0, "mover:after"),
        (1.0, "swapped:after"),
        (2.0, "inside:after"),
        (2.5, "sum:after"),
        (4.5, "moved:after"),
        (5.5, "set:after"),
    )
    states = ((0.75, (0.25, -2.25, -1.75, 1.15, 0.75, -5.0)), (6.0, (-5.0, 3.0, -7.0, -0.1, 6.0, 5.0)))
    return named("sides-of-guards", (0.0, 6.0), Truth(events, states), needs("transitions", "scheduled"))


def _contacts() -> Scene:
    """Return the test case of five contacts: three bodies rest, one starts at t = 2, and one slides freely."""
    events = ((0.0, "lifted_N:open"), (2.0, "step:slip+"))
    states = (
        (1.0, (-1.0, 0.0, -2.0, 0.0, 0.0, 0.0, -1.0, 0.5)),
        (3.0, (-1.0, 0.0, -2.0, 0.0, 0.0, 1.7, -1.0, 1.5)),
    )
    return named(
        "sides-of-contacts",
        (0.0, 3.0),
        Truth(events, states),
        needs("contacts", "transitions", "exact-stick"),
    )


def _relay() -> Scene:
    return named(
        "sides-of-a-relay", (0.0, 4.0), Truth((), ((1.0, (0.0, -0.5)), (4.0, (0.0, 1.0)))), needs("sliding")
    )


def _gap() -> Scene:
    """Return the test case of a ball that a force with a corner lifts at y = 1/3."""
    lifted = 0.5 + 2.0 + 1.0 / 3.0
    rise = 4.0 - lifted
    states = ((0.25, (0.0, 0.0, -0.75)), (2.5, (0.0, 0.0, 0.0)), (4.0, (0.5 * rise**3, 1.5 * rise**2, 1.5)))
    return named(
        "sides-of-a-gap", (0.0, 4.0), Truth(((lifted, "p:open"),), states), needs("impacts", "scheduled")
    )


def _sampled() -> Scene:
    """Return the test case of a clock that ticks at the start, before the contacts have modes."""
    read = tuple(
        (partial(_read, name, t), value)
        for t, values in (
            (0.5, {"height": 3.0, "speed": -0.7, "force": -0.5}),
            (1.25, {"height": 2.5, "speed": -0.2, "force": -0.5}),
        )
        for name, value in values.items()
    )
    return named(
        "sampled-start",
        (0.0, 1.5),
        Truth(None, ((0.5, (2.875, -0.5, -0.45)), (1.25, (3.0 - 0.5 * 1.25**2, -1.25, -0.075))), read),
        needs("impacts", "contacts", "scheduled"),
    )


def _read(name: str, t: float, solution: Any) -> float:
    return float(solution.output(name, t))


def _order() -> Scene:
    events = ((1.0, "few:second"), (1.0, "few:third"), (1.0, "more:second"), (1.0, "more:third"))
    return named(
        "order-of-guards",
        (0.0, 2.0),
        Truth(events, ((2.0, (-3.0, -3.4)),)),
        needs("transitions"),
        tol_t=1e-12,
    )


def _flat() -> Scene:
    """Return the test case of a corner with zero slope on both sides; the solution is c = 9 + cos(t)."""
    return named(
        "flat-corner",
        (0.0, 2.0),
        Truth(
            ((math.pi / 3, "band:outside"),), ((0.5, (9.0 + math.cos(0.5),)), (2.0, (9.0 + math.cos(2.0),)))
        ),
        needs("transitions"),
    )


def _zeros() -> Scene:
    """Return the test case whose states start at zeros of their guards and change at rate one."""
    starts = tuple(a + b for a, b in _SUMS)
    return named(
        "starts-at-zeros",
        (0.0, 1.0),
        Truth((), tuple((t, tuple(start + t for start in starts)) for t in (0.5, 1.0))),
        needs("transitions", "monitors"),
    )


def _held() -> Scene:
    """Return the test case of three bodies that start at the speeds of their belts and stay in stick."""
    starts = {f"v{k}": a + b for k, (a, b) in enumerate(_SUMS[:3])}
    return named(
        "starts-at-belt-speeds",
        (0.0, 1.0),
        Truth(
            (),
            ((1.0, tuple(starts.values())),),
            checks=tuple(
                ("exact-stick", exact_stick(f"f{k}", {f"v{k}": v})) for k, v in enumerate(starts.values())
            ),
        ),
        needs("contacts", "exact-stick"),
    )
