"""This module contains test cases of flows with corners, which must be as accurate as smooth flows."""

from __future__ import annotations

import math

from hybridsim.testing.facts import TRUTHS
from hybridsim.testing.scene import Scene, Truth, named, needs


def scenes() -> tuple[Scene, ...]:
    """Return test cases of a bilinear spring, backlash, saturation, drag, a hinge and an elastogap."""
    return _bilinear(), _backlash(), _saturation(), _drag(), _hinge(), _elastogap(), _sizes()


def _bilinear() -> Scene:
    """Return the test case of a bilinear oscillator with half periods of pi/2 and pi."""
    period = 1.5 * math.pi
    quarter, root = math.pi / 4, math.sqrt(0.5)
    states = (
        (quarter / 2, (root, -2 * root)),
        (quarter + math.pi / 2, (-2.0, 0.0)),
        (period, (1.0, 0.0)),
        (4 * period + quarter + 0.75 * math.pi, (-2 * root, 2 * root)),
        (6 * period, (1.0, 0.0)),
    )
    return named("bilinear", (0.0, 6 * period), Truth((), states), unit=period, speed=2.0)


def _backlash() -> Scene:
    """Return the test case of backlash: free flights alternate with half periods of a spring of frequency 2."""
    half = math.pi / 2
    states = (
        (0.5, (0.5, 1.0)),
        (1 + half / 2, (1.5, 0.0)),
        (1 + half + 0.5, (0.5, -1.0)),
        (3 + half + half / 2, (-1.5, 0.0)),
        (5 * (4 + 2 * half), (0.0, 1.0)),
    )
    return named("backlash", (0.0, 5 * (4 + 2 * half)), Truth((), states), unit=7.0, speed=1.0)


def _saturation() -> Scene:
    """Return the test case of x' = 2 sin(t) with saturation, so that x' is 1 between pi/6 and 5 pi/6."""
    rise = 2 * (1 - math.cos(math.pi / 6))
    top = rise + 2 * math.pi / 3
    states = (
        (math.pi / 6, (rise,)),
        (math.pi / 2, (rise + math.pi / 3,)),
        (5 * math.pi / 6, (top,)),
        (math.pi, (top + rise,)),
        (6 * math.pi, (0.0,)),
    )
    return named("saturation", (0.0, 6 * math.pi), Truth((), states), unit=2 * math.pi, speed=3.0)


def _drag() -> Scene:
    """Return the test case of quadratic drag: v = vt tan upward, v = -vt tanh downward, with terminal speed vt."""
    g, c, v0 = 9.81, 0.3, 5.0
    terminal = math.sqrt(g / c)
    rate = math.sqrt(g * c)
    top = math.atan(v0 / terminal) / rate
    states = (
        (top / 2, (terminal * math.tan(rate * top / 2),)),
        (top, (0.0,)),
        (top + 0.5, (-terminal * math.tanh(rate * 0.5),)),
        (top + 2.0, (-terminal * math.tanh(rate * 2.0),)),
    )
    return named("drag", (0.0, top + 2.0), Truth((), states), unit=1.0, speed=6.0)


def _hinge() -> Scene:
    states = tuple((t, (math.exp(-t), -math.exp(t), 0.0)) for t in (0.5, 2.0, 5.0))
    return named("hinge", (0.0, 5.0), Truth((), states), speed=100.0)


def _elastogap() -> Scene:
    """Return the test case MSL-elastogap, declared with corners instead of modes."""
    states = tuple((row[0], tuple(row[1:])) for row in TRUTHS["MSL-elastogap"]["states"])
    return named("elastogap-clipped", (0.0, 5.0), Truth((), states), unit=2.0, speed=3.0, tol_x=1e-7)


def _sizes() -> Scene:
    """Return the test case of nested absolute values with known zeros: x = 1.06, y = -0.86 and z = -1.75."""
    events = ((0.04, "second:off"), (0.16, "first:off"), (0.25, "third:off"))
    return named(
        "sizes-of-sizes", (0.0, 1.0), Truth(events, ((1.0, (1.9, 0.1, -1.0)),)), needs("transitions")
    )
