"""A free mass that slips on an oscillating base, or on a fast one, against its straight and sinusoidal pieces."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import hybridsim as hs


def reversals(drift: Callable[[Any], Any], force: float, side: int, end: float) -> tuple[list[float], float]:
    """Times at which the relative speed r is zero, and its final value; r = 0 at the start.

    In slip r' = drift' - side force. The first negative value on a fine grid gives an interval for bisection. There
    the drift is faster than the force, so that the mass does not stick but slips to the other side.
    """
    found, start = [], 0.0
    while True:

        def speed(t: Any, start: float = start, side: int = side) -> Any:
            return side * (drift(t) - drift(start)) - force * (t - start)

        times = np.linspace(start, end, 20001)[1:]
        crossed = np.flatnonzero(speed(times) < 0.0)
        if not len(crossed):
            return found, side * float(speed(end))
        assert crossed[0] > 0
        low, high = times[crossed[0] - 1], times[crossed[0]]
        while low < (middle := 0.5 * (low + high)) < high:
            low, high = (low, middle) if speed(middle) < 0.0 else (middle, high)
        slope = (drift(high + 1e-6) - drift(high - 1e-6)) / 2e-6
        assert abs(slope) > 1.01 * force
        found.append(float(high))
        start, side = float(high), 1 if slope > 0.0 else -1


def free_mass(mu: float, base: Any, v0: float, forcing: Any = None) -> hs.MechanicalSystem:
    contact = hs.MechanicalContact("f", [1], normal=1.0, law="coulomb", arguments={"mu": mu}, base=base)
    return hs.MechanicalSystem([1.0], None, None, forcing, [contact], v0=[v0])


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("omega", [2.0, 40.0])
def test_only_the_base_limits_a_step(omega: float, rtol: float) -> None:
    """The base has the speed sin(omega t), the mass the velocity of straight pieces with the slopes +-0.15 omega."""
    mu, end = 0.15 * omega, 20.0 / omega
    times, rest = reversals(lambda t: -np.sin(omega * t), mu, -1, end)
    sol = hs.simulate(free_mass(mu, hs.Harmonic(omega, sin=1.0), 0.0), (0, end), rtol=rtol)
    assert len(times) == 6
    assert [e.t for e in sol.events] == pytest.approx(times, abs=100 * rtol / omega + 1e-14)
    assert sol.y[1, -1] == pytest.approx(rest + math.sin(omega * end), abs=100 * rtol + 1e-13)
    corners, velocity, place, side = [0.0, *times, end], 0.0, 0.0, 1.0
    for t0, t1 in pairwise(corners):
        place += velocity * (t1 - t0) + side * mu * (t1 - t0) ** 2 / 2
        velocity, side = velocity + side * mu * (t1 - t0), -side
    assert sol.y[:, -1] == pytest.approx([place, velocity], abs=100 * rtol + 1e-13)


@pytest.mark.parametrize(("speed", "rtol"), [(1e3, 1e-3), (1e6, 1e-6)])
def test_a_relative_speed_far_below_the_tolerance_of_the_velocity(speed: float, rtol: float) -> None:
    """In the frame of the base the mass is pushed by 0.01 sin(10 t) against 0.002; its velocity there is about 1e-3.

    The tolerances permit errors larger than that. Yet every reversal is found, within a hundredth of a period.
    """
    size, mu, omega, end = 0.01, 0.002, 10.0, 5.0
    released = math.asin(mu / size) / omega
    times, _ = reversals(lambda t: -size / omega * np.cos(omega * (t + released)), mu, 1, end - released)
    pushed = free_mass(mu, speed, speed, [hs.Harmonic(omega, sin=size)])
    sol = hs.simulate(pushed, (0, end), rtol=rtol)
    expected = [released, *(released + t for t in times)]
    assert [e.t for e in sol.events] == pytest.approx(expected, abs=0.02 * math.pi / omega)
    assert len(expected) > 10
