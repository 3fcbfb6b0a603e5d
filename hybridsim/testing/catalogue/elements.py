"""This module contains test cases of guards with a direction, and of elements that are declared in one line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from hybridsim.testing.checks import at_times, equals
from hybridsim.testing.scene import END, Check, Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of elements that are declared in one line, and of guards with a direction."""
    return _directions(), _elements(), _delays(), _wrapped()


def _transitions(component: str, expected: Sequence[tuple[float, str]], within: float = 1e-3) -> Check:
    """Return a check of a solution: a component changes its mode only near the expected times."""

    def check(solution: Any) -> list[str]:
        found = [(event.t, event.target) for event in solution.events if event.component == component]
        if [mode for _, mode in found] != [mode for _, mode in expected]:
            return [f"{component} goes to {[mode for _, mode in found]} {at_times([t for t, _ in found])}"]
        wrong = [(t, due) for (t, _), (due, _) in zip(found, expected, strict=True) if abs(t - due) > within]
        return [f"a transition of {component} is at t = {t!r} instead of {due!r}" for t, due in wrong]

    return check


def _directions() -> Scene:
    """Return the test case of x = sin(t), whose values 1/2 and 0 are passed in both directions."""
    opens, closes = 5 * math.pi / 6, 13 * math.pi / 6
    gate = ((opens, "open"), (closes, "closed"), (opens + 2 * math.pi, "open"))
    zeros = tuple((k * math.pi, "on") for k in (1, 2, 3))
    time_open = closes - opens + 10.0 - (opens + 2 * math.pi)
    return Scene(
        "guards-with-directions",
        "guard-directions",
        (0.0, 10.0),
        Truth(
            None,
            (
                (4.0, (math.sin(4.0), math.cos(4.0), 4.0 - opens)),
                (END, (math.sin(10.0), math.cos(10.0), time_open)),
            ),
            checks=(
                ("", _transitions("gate", gate)),
                ("", _transitions("counter", zeros)),
                ("", equals(10.0, n=3.0)),
            ),
        ),
        needs("transitions"),
        unit=2 * math.pi,
        tol_x=1e-7,
    )


def _elements() -> Scene:
    """Return the test case of elements that follow x = sin(t), with closed forms for their integrals until t = 10."""
    end, sixth, three = 10.0, math.pi / 6, 3 * math.pi
    on = 2 * math.pi  # from 1/2 to -1/2, twice
    half_wave = 4 * math.sin(sixth / 2) ** 2 + 2 * sixth  # 2 (1 - cos(pi/6)) + (4 pi/6)/2
    saturated = half_wave + math.cos(three) - math.cos(three + sixth) - 0.5 * (end - three - sixth)
    moved = math.cos(sixth) - sixth + math.pi / 4 + (math.pi / 4 - 1) - math.pi / 4 + (1 - math.pi / 4)
    moved += math.pi / 4 + math.cos(three) - math.cos(end) + 0.5 * (end - three)
    small, large = math.asin(0.25), math.asin(0.75)
    stepped = math.pi - small - large - 0.5 * (end - three - small)
    values = (
        math.sin(end),
        math.cos(end),
        2 * on - (end - on),
        saturated,
        1 - math.cos(end) - saturated,
        moved,
        stepped,
    )
    return Scene(
        "elements-of-loops",
        "elements",
        (0.0, end),
        Truth(None, ((END, values),), checks=(("", equals(end, q_whole=-1.0)),)),
        needs("transitions"),
        unit=2 * math.pi,
        tol_x=1e-7,
    )


def _delays() -> Scene:
    """Return the test case of delayed signals: the sample is 0 on (0, 1), and sin(k - 1) on (k, k + 1)."""
    samples = sum(math.sin(k - 1) for k in range(1, 10))
    states = ((3.0, (math.sin(3.0), math.cos(3.0), math.sin(1.0), 1.0, 0.5)),)
    return Scene(
        "delayed-signals",
        "delays",
        (0.0, 10.0),
        Truth(None, (*states, (END, (math.sin(10.0), math.cos(10.0), samples, 0.0, 1.0)))),
        needs("scheduled"),
        unit=2 * math.pi,
        tol_x=1e-7,
    )


def _wrapped() -> Scene:
    """Return the test case of angle = 8 t - t**2/2, which passes 2 pi k at t = 8 -+ sqrt(64 - 4 pi k), k = 1 to 5.

    The level 1/4 + t/32 equals mod(t, 1) at t = 32 (k + 1/4)/31, and is passed by the jump of mod(t, 1) at each tick.
    """
    end = 15.5
    half = [math.sqrt(64.0 - 4.0 * math.pi * k) for k in range(1, 6)]
    turns = [8.0 - h for h in half] + [8.0 + h for h in half]
    off = [32.0 * (k + 0.25) / 31.0 for k in range(15)]
    events = [(t, "turns:on") for t in turns] + [(t, "switch:off") for t in off]
    events += [(float(k), "switch:on") for k in range(1, 16)]

    def state(t: float) -> tuple[float, ...]:
        beyond = math.fsum(max(min(t, 8.0 + h) - (8.0 - h), 0.0) for h in half)
        whole = math.floor(t)
        return (
            8.0 * t - t**2 / 2,
            8.0 - t,
            4.0 * t**2 - t**3 / 6 - 2.0 * math.pi * beyond,
            whole / 2 + (t - whole) ** 2 / 2,
            math.fsum(min(t, until) - k for k, until in enumerate(off) if k < t) + max(t - 15.0, 0.0),
        )

    return named(
        "wrapped-angle",
        (0.0, end),
        Truth(tuple(sorted(events)), tuple((t, state(t)) for t in (3.1, 8.2, 12.3, end))),
        needs("transitions"),
        speed=8.0,
    )
