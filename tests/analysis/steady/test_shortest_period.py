"""A steady motion has its shortest period, however many passages were followed before it was found."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs


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
