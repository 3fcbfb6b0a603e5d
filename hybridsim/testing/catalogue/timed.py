"""This module contains test cases of events at known times, and of runs backward in time."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.testing.checks import equals
from hybridsim.testing.facts import CASES
from hybridsim.testing.scene import Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of events at known times and of runs backward in time."""
    return *scheduled(), *backward()


def scheduled() -> tuple[Scene, ...]:
    """Return test cases of events at known times."""
    stair = CASES["FMI-stair"]["expected"]
    ticks = tuple((float(k), "tick") for k in range(1, 10)) + ((9.0, "full"),)
    counts = tuple(("", equals(float(t), counter=float(n))) for t, n in stair["counter_at"].items())
    disc = CASES["SUN-disc"]["expected"]["y"]
    resonance = [(n * math.pi, ((-1) ** (n + 1) * 2.0 * n, 0.0)) for n in range(1, 11)]

    def small(solution: Any) -> list[str]:
        y = float(solution(2.0)[0])
        return [] if abs(y / disc["2"] - 1) < 1e-4 else [f"y is {y!r} at t = 2 instead of {disc['2']!r}"]

    return (
        Scene(
            "FMI-stair",
            "stair",
            (0.0, 10.0),
            Truth(ticks, status="terminated", end=9.0, checks=counts),
            needs("scheduled", "monitors"),
            count_scheduled=True,
            tol_t=0.0,
            floor=0.0,
        ),
        Scene(
            "SUN-disc",
            "disc",
            (0.0, 2.0),
            Truth(((1.0, "faster"),), ((1.0, (disc["1"],)), (2.0, (disc["2"],))), checks=(("", small),)),
            needs("scheduled"),
            count_scheduled=True,
            tol_t=0.0,
            tol_x=1e-9,
        ),
        Scene(
            "SQ-res",
            "square",
            (0.0, 10 * math.pi),
            Truth((), tuple(resonance)),
            needs("scheduled"),
            unit=2 * math.pi,
            speed=20.0,
        ),
    )


def backward() -> tuple[Scene, ...]:
    """Return test cases that run backward in time inside a mode."""
    t = CASES["DEQ-rev"]["expected"]["t_event"]
    zeros = tuple(((n + 0.5) * math.pi, "zero") for n in reversed(range(6)))
    samples = tuple((s, (math.cos(s), -math.sin(s))) for s in (15.0, 7.0, 0.0))
    return (
        Scene(
            "DEQ-rev",
            "growth",
            (2.0, 0.0),
            Truth(((t, "e"),), ((1.0, (5 * math.exp(-1.0),)), (0.0, (5 * math.exp(-2.0),)))),
            needs("backward", "monitors"),
            tol_t=1e-9,
        ),
        Scene(
            "backward-oscillator",
            "harmonic",
            (20.0, 0.0),
            Truth(zeros, samples),
            needs("backward", "monitors"),
            start={"x": math.cos(20.0), "v": -math.sin(20.0)},
            unit=2 * math.pi,
        ),
    )
