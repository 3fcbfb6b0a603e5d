"""This module contains test cases of switching surfaces: crossing, sliding, release, and nonunique motions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from hybridsim.testing.checks import at_times, equals, says
from hybridsim.testing.facts import CASES, TRUTHS
from hybridsim.testing.scene import END, Check, Scene, Truth, named

NEEDS = frozenset({"sliding"})
SLIDING = "sliding"


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of switching surfaces."""
    return (
        *_published(),
        _circle(),
        _along_the_circle(),
        _decay(),
        _rubbing_servo(),
        _two_relays(),
        _chatter(),
        *_refused(),
    )


def stays(component: str, *terms: str, to_one: bool = False) -> Check:
    """Return a check of a solution: a sum of states, or of their squares, is 0 or 1 during sliding."""

    def check(solution: Any) -> list[str]:
        for interval in solution.modes[component]:
            if interval.mode == SLIDING:
                times = np.linspace(interval.t0, interval.t1, 101)[1:-1]
                x = dict(zip([s.name for s in solution.model.states], solution(times), strict=True))
                value = sum(
                    x[name] if power == "1" else x[name] ** 2 for name, power in map(str.split, terms)
                )
                target = 1.0 if to_one or any(term.endswith("2") for term in terms) else 0.0
                if np.abs(value - target).max() > 1e-14:
                    return [
                        f"while it slides, {component} is off its surface by {np.abs(value - target).max():.2g}"
                    ]
        return []

    return check


def _published() -> tuple[Scene, ...]:
    """Return test cases published with other tools, and the same systems declared with modes."""
    exact: dict[str, Any] = {"tol_t": 1e-9, "tol_x": 1e-9}
    at_rest = (("", equals(1.0, x1=0.0, x2=0.0)),)
    passages = CASES["SIC-filippov"]["expected"]["first_crossings"]
    spiral = tuple((t, tuple(x)) for t, x in passages)
    relay = TRUTHS["SIC-relayosc"]
    events = tuple((t, f"s:{'above' if mode == 'plus' else 'below'}") for t, _, mode in relay["events"])
    states = tuple((row[0], tuple(row[1:])) for row in relay["states"])
    circle = CASES["NOS-osc"]["expected"]
    inside = (math.exp(-0.5) * math.cos(math.pi), math.exp(-0.5) * math.sin(math.pi))
    return (
        Scene(
            "NOS-leave",
            "leave",
            (0.0, 1.5),
            Truth(((1.0, "u:above"),), ((1.5, (0.125,)),), checks=(("", equals(0.5, x=0.0)),)),
            NEEDS,
            **exact,
        ),
        Scene(
            "SIC-relay2",
            "relay-pair",
            (0.0, 1.0),
            Truth(((0.5, "u1:sliding"), (0.5, "u2:sliding")), ((0.25, (0.5, -0.5)),), checks=at_rest),
            NEEDS,
            **exact,
        ),
        Scene(
            "SIC-filippov",
            "spiral",
            (0.0, 2.0),
            Truth(
                None,
                (*spiral, (END, (0.0, 0.0))),
                checks=(("", spirals_in), ("", equals(2.0, x1=0.0, x2=0.0))),
            ),
            NEEDS,
            **exact,
        ),
        Scene(
            "SIC-relayosc-surface",
            "relay-surface",
            (0.0, 100.0),
            Truth(events, states),
            NEEDS,
            unit=1.83,
            tol_t=1e-9,
            speed=0.5,
            effort=10_000,
        ),
        Scene(
            "NOS-cross-surface",
            "crossing-surface",
            (0.0, 1.5),
            Truth(((0.5, "side:above"),), ((0.25, (-0.5,)), (1.5, (0.2,)))),
            NEEDS,
            **exact,
        ),
        Scene(
            "NOS-osc-surface",
            "circle-surface",
            (0.0, math.pi / 2),
            Truth(((1.0, "s:above"),), ((0.5, inside), (math.pi / 2, tuple(circle["x_end"])))),
            NEEDS,
            tol_t=1e-10,
            tol_x=1e-9,
        ),
    )


def spirals_in(solution: Any) -> list[str]:
    """Check that |x1| + |x2| is 6 - 4t until t = 1.5, at which infinitely many crossings accumulate."""
    times = np.linspace(0.0, 1.5, 301)
    off = np.abs(np.abs(solution(times)).sum(axis=0) - (6 - 4 * times)).max()
    wrong = [f"|x1| + |x2| is off by {off:.2g}"] if off > 1e-8 else []  # the rates are constant in between
    reached = [event.t for event in solution.events if event.target == SLIDING]
    if len(reached) != 2 or any(abs(t - 1.5) > 1e-6 for t in reached):
        wrong.append(f"sliding begins {at_times(reached)} instead of 1.5 along both surfaces")
    return wrong


def _along_the_circle() -> Scene:
    """Return the test case of a motion that slides along a circle until the end of the run, t = 3.5."""
    scene = _circle()
    events = (scene.truth.events or ())[:1]
    truth = replace(scene.truth, events=events, states=scene.truth.states[:2])
    return replace(scene, name="along-the-circle", span=(0.0, 3.5), truth=truth, needs=NEEDS)


def _circle() -> Scene:
    """Return the test case of a motion that spirals to the circle r = 1, slides along it and leaves it."""
    onto, off = 4 - math.sqrt(16 - 8 * math.log(2)), 4.0

    def at(t: float, log_r: float) -> tuple[float, tuple[float, float]]:
        return t, (math.exp(log_r) * math.cos(t), math.exp(log_r) * math.sin(t))

    states = (at(0.5, math.log(2) + 1 / 32 - 0.5), at(2.0, 0.0), at(4.0, 0.0), at(5.0, 1 / 8), at(6.0, 1 / 2))
    return named(
        "sliding-circle",
        (0.0, 6.0),
        Truth(((onto, "u:sliding"), (off, "u:above")), states, checks=(("", stays("u", "x 2", "y 2")),)),
        NEEDS | {"tangent-exit"},
        unit=6.0,
        tol_t=1e-9,
    )


def _decay() -> Scene:
    """Return the test case of v = -t up to the surface x + v = 0 at t = sqrt(3) - 1; then x decays as exp(-t)."""
    onto = math.sqrt(3) - 1
    states = [(0.5, (0.875, -0.5))]
    states += [(t, (onto * math.exp(onto - t), -onto * math.exp(onto - t))) for t in (1.0, 2.0, 5.0)]
    return named(
        "sliding-mode",
        (0.0, 5.0),
        Truth(((onto, "u:sliding"),), tuple(states), checks=(("", stays("u", "x 1", "v 1")),)),
        NEEDS,
        tol_t=1e-9,
    )


def _rubbing_servo() -> Scene:
    """Return the test case of a servo with friction, which slides along x - 1 + v = 0 with decay exp(-t)."""

    def speed(t: float) -> float:
        return 1.7 * t + (1.0 - math.cos(3.0 * t)) / 6.0

    def place(t: float) -> float:
        return 0.85 * t**2 + (t - math.sin(3.0 * t) / 3.0) / 6.0

    onto = brentq(lambda t: place(t) - 1.0 + speed(t), 0.0, 1.0, xtol=1e-15)
    left = [(t, speed(onto) * math.exp(onto - t)) for t in (1.0, 5.0, 20.0, 40.0)]
    states = ((0.3, (place(0.3), speed(0.3))), *((t, (1.0 - v, v)) for t, v in left))
    return named(
        "rubbing-servo",
        (0.0, 40.0),
        Truth(((onto, "u:sliding"),), states, checks=(("", stays("u", "x 1", "v 1", to_one=True)),)),
        NEEDS | {"contacts"},
        unit=math.tau / 3.0,  # the period of the load
        tol_t=1e-9,
    )


def _two_relays() -> Scene:
    """Return the test case of two relays: the motion slides along x = y = 0, and leaves x = 0 at t = 3/2."""
    first, both, off = 1 / 6, 1.5 - math.sqrt(0.75), 1.5

    def x(t: float) -> float:
        return t**2 / 2 - 1.5 * t + 0.75

    states = ((0.1, (0.705, -0.2)), (0.4, (x(0.4), 0.0)), (1.0, (0.0, 0.0)), (2.5, (0.5, 0.0)))
    return named(
        "two-relays",
        (0.0, 2.5),
        Truth(
            ((first, "w:sliding"), (both, "u:sliding"), (off, "u:above")),
            states,
            checks=(("", equals(1.0, x=0.0, y=0.0)), ("", equals(2.0, y=0.0))),
        ),
        NEEDS,
        tol_t=1e-9,
    )


def _chatter() -> Scene:
    """Return the test case of a thermostat whose state changes between rising and falling within +-1e-3."""
    band, end = 1e-3, 0.3
    events, t, up = [], band, True
    while t < end:
        events.append((t, "mode:down" if up else "mode:up"))
        t, up = band + (len(events) // 2) * (10 / 3) * band + (len(events) % 2) * (4 / 3) * band, not up
    states = ((0.5e-3, (0.5e-3,)), (events[-2][0], (band if len(events) % 2 == 0 else -band,)))
    return Scene(
        "relay-chatter",
        "thermostat-band",
        (0.0, end),
        Truth(tuple(events), states),
        frozenset({"transitions", "adaptive"}),  # a fixed step in units of the run passes several changes
        tol_t=1e-9,
        tol_x=1e-9,
        floor=1e-9,  # the roundings of all events add up
    )


def _refused() -> tuple[Scene, ...]:
    """Return test cases with several admissible motions, in which the run must stop and name the surfaces."""
    return (
        Scene(
            "ambiguous-meeting",
            "ambiguous",
            (0.0, 1.0),
            Truth(
                (),
                ((0.2, (0.4, 0.4)),),
                status="nonunique",
                end=1 / 3,
                checks=(("", says("u: above, w: below", "u: below, w: above", "u: sliding, w: sliding")),),
            ),
            NEEDS,
        ),
        Scene(
            "repelling-start",
            "repelling",
            (0.0, 1.0),
            Truth(
                (),
                ((END, (0.0,)),),
                status="nonunique",
                end=0.0,
                checks=(("", says("u: above", "u: below")),),
            ),
            NEEDS,
        ),
    )
