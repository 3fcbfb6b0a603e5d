"""This module contains test cases of impacts with curved gaps: a round wall, two discs."""

from __future__ import annotations

import math

from hybridsim.testing.scene import END, Scene, Truth, needs


def scenes() -> tuple[Scene, ...]:
    """Return all test cases of impacts with curved gaps."""
    return _drum(), _discs()


def _drum() -> Scene:
    """Return the test case of a ball in a round wall, which moves along chords of the circle."""
    x, y, vx, vy = 0.3, 0.0, 0.4, 0.9
    blows: list[tuple[float, str]] = []
    t, end = 0.0, 6.0
    speed = vx**2 + vy**2
    while True:
        along = x * vx + y * vy
        flight = (-along + math.sqrt(along**2 + speed * (1.0 - x**2 - y**2))) / speed
        if blows:
            flight = -2.0 * along / speed  # from the wall to the wall
        if t + flight > end:
            break
        t, x, y = t + flight, x + flight * vx, y + flight * vy
        outward = x * vx + y * vy
        vx, vy = vx - 2.0 * outward * x, vy - 2.0 * outward * y
        blows.append((t, "p:open"))
    left = end - t
    return Scene(
        "round-wall",
        "drum",
        (0.0, end),
        Truth(tuple(blows), ((END, (x + left * vx, y + left * vy, vx, vy)),)),
        needs("impacts", "located"),
        speed=1.0,
    )


def _discs() -> Scene:
    """Return the test case of two discs; their impact exchanges the velocities along the line of centres."""
    instant = 1.0 - math.sqrt(0.2**2 - 0.1**2)
    normal = ((1.0 - instant) / 0.2, 0.1 / 0.2)
    taken = (normal[0] ** 2, normal[0] * normal[1])
    end = 1.0  # while a disc that went on would still be inside the other
    left = end - instant
    one, two = (1.0 - taken[0], -taken[1]), taken
    state = (
        *(instant + left * one[0], left * one[1], 1.0 + left * two[0], 0.1 + left * two[1]),
        *(*one, *two),
    )
    return Scene(
        "two-discs",
        "discs",
        (0.0, end),
        Truth(((instant, "p:open"),), ((END, state),)),
        needs("impacts", "located"),
        speed=1.0,
    )
