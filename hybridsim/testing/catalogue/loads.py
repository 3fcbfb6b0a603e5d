"""This module contains test cases of normal loads: a load that touches zero, a reaction, contacts in series."""

from __future__ import annotations

import math

from scipy.optimize import brentq

from hybridsim.testing.checks import no_transition, says
from hybridsim.testing.scene import END, Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of loads."""
    return (
        _floor(),
        _touching(),
        _waves(),
        _ending(),
        _series(),
        _painleve(),
        _stop_off_zero(),
        _moving_floor(),
        _kinked_floors(),
        _own_speed(),
        _element(),
    )


def _floor() -> Scene:
    """Return the test case of a bounce on a spring, with friction that slows the speed along the floor."""
    g, k, mu, end = 9.81, 1000.0, 0.3, 0.3
    own, down, start = math.sqrt(k), math.sqrt(2 * g * 0.1), math.sqrt(2 * 0.1 / g)

    def depth(t: float) -> float:
        return -g / k + g / k * math.cos(own * t) - down / own * math.sin(own * t)

    lasts = float(brentq(depth, 0.9 * math.pi / own, 1.3 * math.pi / own, xtol=1e-15))
    left = end - start - lasts
    state = (down * left - g * left**2 / 2, down - g * left, 3.0 - mu * (2 * down + g * lasts))
    return named(
        "elastic-floor",
        (0.0, end),
        Truth(None, ((END, state),), checks=(("located", no_transition),)),
        needs("contacts"),
        unit=0.1,
        speed=3.0,
    )


def _touching() -> Scene:
    """Return the test case of a load that touches zero; the friction impulse is the area under the load."""
    return named(
        "touching-load",
        (0.0, 2.0),
        Truth(None, ((END, (1.0, 3.0 - 0.3 * 2.0)),), checks=(("located", no_transition),)),
        needs("contacts"),
        speed=3.0,
    )


def _waves() -> Scene:
    """Return the test case of a triangular load that touches zero, with a known friction impulse."""
    return named(
        "load-of-waves",
        (0.0, 2.0),
        Truth(
            None,
            ((END, (50.0 * 2 - 0.4 * 25 * (2.0 + 2 / 8), 50.0 - 0.4 * 25 * 2)),),
            checks=(("located", no_transition),),
        ),
        needs("contacts", "scheduled"),
        speed=50.0,
    )


def _ending() -> Scene:
    """Return the test case of two loads that decrease to zero: one body slides on, the other starts to slide."""
    return named(
        "load-that-ends",
        (0.0, 3.0),
        Truth(((2.0, "g:slip+"),), ((END, (50.0 * 3 - 20 * (0.5 * 3 - 1 / 6), 40.0, 1 / 6, 0.5)),)),
        needs("contacts", "scheduled", "exact-stick"),
        start_is_event=False,
        speed=50.0,
    )


def _series() -> Scene:
    """Return the test case of two blocks in series that move together from t = 2 to 5."""
    tau = 3.0
    x = 0.125 * (tau + 1.0 - math.cos(tau) - math.sin(tau))
    v = 0.125 * (1.0 + math.sin(tau) - math.cos(tau))
    return Scene(
        "blocks-in-series",
        "series",
        (0.0, 2.0 + tau),
        Truth(((2.0, "f:slip+"),), ((END, (x, v, x, v)),)),
        needs("contacts", "exact-stick"),
        start_is_event=False,
    )


def _painleve() -> Scene:
    """Return the test case of a start with two admissible motions; the message of the run must name both."""
    return Scene(
        "painleve-start",
        "painleve",
        (0.0, 1.0),
        Truth(
            (),
            ((END, (0.0, 0.0, 0.0, -1.0)),),
            status="nonunique",
            end=0.0,
            checks=(("", says("p: closed", "p: open")),),
        ),
        needs("impacts", "contacts", "located"),
    )


def _stop_off_zero() -> Scene:
    """Return the test case of a gap that opens at t = pi/6 with zero force, and grows as the cube of time."""
    began, end = math.pi / 6, 3.0
    left = end - began
    v = math.cos(began) - math.cos(end) - 0.5 * left
    x = 0.5 + math.cos(began) * left - (math.sin(end) - math.sin(began)) - 0.25 * left**2
    return named(
        "stop-off-zero",
        (0.0, end),
        Truth(((began, "p:open"),), ((END, (x, v)),)),
        needs("impacts", "located"),
        start_is_event=False,
    )


def _moving_floor() -> Scene:
    """Return the test case of a body that leaves the floor when the floor's acceleration reaches gravity."""
    g, size, turns, end = 9.81, 0.02, 30.0, 0.25
    phase = math.asin(g / (size * turns**2))
    first, again = phase / turns, (phase + 2 * math.pi) / turns
    height, speed = size * math.sin(phase), size * turns * math.cos(phase)

    def gap(t: float) -> float:
        return height + speed * (t - first) - g * (t - first) ** 2 / 2 - size * math.sin(turns * t)

    lands = float(brentq(gap, 0.1, again, xtol=1e-15))
    left = end - again
    return named(
        "moving-floor",
        (0.0, end),
        Truth(
            ((first, "p:open"), (lands, "p:closed"), (again, "p:open")),
            ((END, (height + speed * left - g * left**2 / 2, speed - g * left)),),
        ),
        needs("impacts", "located"),
        unit=2 * math.pi / turns,
        start_is_event=False,
        speed=speed,
    )


def _kinked_floors() -> Scene:
    """Return the test case of two floors whose speeds jump at t = 0.1, one upward and one downward."""
    began, end = 0.1, 0.14

    def state(t: float) -> tuple[float, ...]:
        since = max(t - began, 0.0)
        if not since:
            return 0.0, 0.0, 0.0, 0.0
        return 0.75 * since - 5 * since**2, 0.75 - 10 * since, -5 * since**2, -10 * since

    return named(
        "kinked-floors",
        (0.0, end),
        Truth(((began, "p:open"), (began, "q:open")), tuple((t, state(t)) for t in (0.05, 0.12, end))),
        needs("impacts", "located"),
        unit=0.1,
        start_is_event=False,
    )


def _own_speed() -> Scene:
    """Return the test case of v' = 0.48 min(-v, 0.85) - 2, whose solution is exponential, then linear."""
    limit = 2.0 / 0.48
    reached = math.log((limit - 0.2) / (limit - 0.85)) / 0.48

    def speed(t: float) -> float:
        if t < reached:
            return (limit - 0.2) * math.exp(-0.48 * t) - limit
        return -0.85 - (2.0 - 0.48 * 0.85) * (t - reached)

    return named(
        "own-speed-in-load",
        (0.0, 1.0),
        Truth((), tuple((t, (speed(t),)) for t in (0.2, 0.6, 1.0))),
        needs("contacts"),
        start_is_event=False,
    )


def _element() -> Scene:
    """Return the test case of a spring with a slider, in which the force limit of the slider varies."""
    stiffness, mu, end = 20.0, 0.5, 7.0

    def place(t: float) -> float:
        return 2.0 / 1.3 * math.sin(1.3 * t)

    def limit(t: float) -> float:
        return mu * (1.0 + 0.6 * math.sin(2.1 * t))

    def slider(t: float, side: float) -> float:
        return side * stiffness * 2.0 * math.cos(1.3 * t) - mu * 0.6 * 2.1 * math.cos(2.1 * t)

    events, held, force, side = [], 0.0, 0.0, 1.0
    for turn in (1.0, 3.0, 5.0, 7.0):  # the motion turns at these quarters of its period
        about = turn * math.pi / 2.6
        start, before = held, force

        def short(t: float, start: float = start, before: float = before, side: float = side) -> float:
            return limit(t) - side * (before + stiffness * (place(t) - place(start)))

        slips = float(brentq(short, held, about - 0.3, xtol=1e-15))
        if slips > end:
            break
        events.append((slips, "f:slip+" if side > 0.0 else "f:slip-"))
        held = float(brentq(slider, about - 0.2, about + 0.2, args=(side,), xtol=1e-15))
        force = side * limit(held)
        if held > end:
            break
        events.append((held, "f:stick"))
        side = -side
    states = tuple((t, (place(t), 2.0 * math.cos(1.3 * t), None)) for t in (3.0, end))
    return Scene(
        "element-under-varying-load",
        "element",
        (0.0, end),
        Truth(tuple(events), states),
        needs("contacts", "located"),
        unit=2.0 * math.pi / 1.3,
        start_is_event=False,
        speed=2.0,
    )
