"""Models with impacts that time stepping is measured on: balls, a pendulum, a shaken mass between stops."""

from __future__ import annotations

import hybridsim as hs

G = 9.81


def ball(restitution: str = "e", **parameters: float) -> hs.Model:
    return hs.Model(
        "ball",
        states=[hs.State("h", 1, der="w", nominal=1), hs.State("w", 0, der="-g + p/m", nominal=1)],
        parameters={"g": G, "m": 2, "e": 0.7} | parameters,
        impacts=[hs.Impact("p", gap="h", restitution=restitution)],
    )


def balls() -> hs.Model:
    """Two balls above each other; the upper one comes down on the lower while that bounces."""
    return hs.Model(
        "balls",
        states=[
            hs.State("x", 1, der="u", nominal=1), hs.State("u", 0, der="-g + (p - q)/M", nominal=1),
            hs.State("y", 1.3, der="v", nominal=1), hs.State("v", -1, der="-g + q/m", nominal=1),
        ],
        parameters={"g": G, "M": 3, "m": 1, "e": 0.5},
        impacts=[hs.Impact("p", gap="x", restitution="e"), hs.Impact("q", gap="y - x", restitution="e")],
    )  # fmt: skip


def pendulum() -> hs.Model:
    """A gap that no state is linear in; the rod comes to rest on the floor."""
    return hs.Model(
        "pendulum",
        states=[hs.State("th", 1.0, der="om", nominal=1), hs.State("om", 0, der="-g/l*sin(th) + p*sin(th)/(m*l)")],
        parameters={"g": G, "l": 1, "m": 2, "d": 0.1},
        impacts=[hs.Impact("p", gap="l*(1 - cos(th)) - d", restitution=0.5)],
    )  # fmt: skip


def shaken() -> hs.Model:
    """A block on a belt, a spring, and a mass between two stops that is shaken: slip, stick and impacts."""
    return hs.Model(
        "shaken",
        states=[
            hs.State("x", 0, der="v", nominal=1), hs.State("v", 0, der="k*(y - x) - f", nominal=1),
            hs.State("y", 0, der="w", nominal=1),
            hs.State("w", 0, der="a*cos(omega*t) + k*(x - y) - c*w + p - q", nominal=1),
        ],
        parameters={"a": 3, "omega": 2.2, "k": 1, "c": 0.2, "d": 0.8, "e": 0.6, "mu": 0.4, "N": 1.5, "belt": 0.2},
        impacts=[hs.Impact("p", gap="y + d", restitution="e"), hs.Impact("q", gap="d - y", restitution="e")],
        contacts=[hs.Contact("f", "v - belt", "N", "coulomb", {"mu": "mu"})],
    )  # fmt: skip
