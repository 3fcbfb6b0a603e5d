"""A steady motion has its shortest period, however many passages were followed before it was found."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.analysis.steady.motion import Motion, point_at_end
from hybridsim.analysis.steady.shooting import Orbit
from hybridsim.analysis.steady.shortest_period import with_shortest_period


def brake() -> hs.Model:
    """Pad and caliper on a moving disc, with friction that falls with speed; a multiplier of the motion is near -1."""
    parameters = {"k1": 2e5, "k2": 8e5, "N": 500, "mu_s": 0.55, "mu_k": 0.35, "v_s": 0.05, "vd": 0.3}
    spring = "k1*(x1 - x2) + 10*(v1 - v2)"
    return hs.Model(
        "brake",
        states=[
            hs.State("x1", 0, "v1", nominal=1e-3),
            hs.State("v1", 0, f"(-({spring}) - f)/0.5", nominal=0.1),
            hs.State("x2", 0, "v2", nominal=1e-3),
            hs.State("v2", 0, f"({spring} - k2*x2 - 20*v2)/2", nominal=0.1),
        ],
        parameters=parameters,
        contacts=[
            hs.Contact(
                "f", "v1 - vd", "N", law="stribeck", arguments={"mu_s": "mu_s", "mu_k": "mu_k", "v_s": "v_s"}
            )
        ],
    )


@pytest.mark.parametrize("x1", [0.0, 0.0014, 0.002, 0.0022])
def test_the_period_is_the_time_between_two_stops(x1: float) -> None:
    """The time between two stops of a long run is the period, and the multiplier is that of one stop to the next."""
    model = brake()
    stops = [e.t for e in hs.simulate(model, (0, 6), x0={"x1": x1}).events if e.target == "stick"]
    gaps = np.diff(stops[-41:])
    assert gaps == pytest.approx(gaps[0], rel=1e-5)
    found = hs.steady_state(model, x0={"x1": x1})
    assert found.multiple == 1
    assert found.period == pytest.approx(gaps.mean(), rel=1e-6)
    assert found.stops_per_period["f"] == 1


@pytest.mark.parametrize("damping", [0.005, 0.01, 0.02])
def test_a_stuck_contact_does_not_double_the_period(damping: float) -> None:
    """An oscillator is forced at twice its natural frequency, so that its multiplier per period is near -1.

    x'' + 2 damping x' + x = sin(2 t) has the amplitude 1/sqrt(9 + (4 damping)**2). The contact never slips from its
    start, because its load is 0.2 and its limit 1, so that its place y is one of a family. A start that is off by 1e-9
    nearly repeats after two periods, and less nearly after one.
    """
    model = hs.Model(
        "near-doubling",
        states=[
            hs.State("x", 0, "v"),
            hs.State("v", 0, f"sin(2*t) - x - {2 * damping}*v"),
            hs.State("y", 0.3, "w"),
            hs.State("w", 0, "0.2*cos(2*t) - f"),
        ],
        contacts=[hs.Contact("f", "w", 1, law="stribeck", arguments={"mu_s": 1, "mu_k": 0.5, "v_s": 0.1})],
    )
    size = 9.0 + (4.0 * damping) ** 2
    at_zero = np.array([-4.0 * damping / size, -6.0 / size, 0.3, 0.0])
    motion = Motion(model, {"integrator": "taylor", "rtol": 1e-12})
    start = point_at_end(motion.run(None, 1.0))
    start = start.moved(at_zero + [1e-9, 0.0, 0.0, 0.0] - start.values)
    twice = Orbit(start, 2.0 * np.pi, 2, 1e-11)
    scale = np.array([1.0 / np.sqrt(size), 2.0 / np.sqrt(size), 3e-4, 0.0])
    found = with_shortest_period(motion, twice, scale, True, 1e-10)
    assert (found.multiple, found.period) == (1, np.pi)
    assert found.start.values == pytest.approx(at_zero, abs=1e-11)
