"""A body that comes to rest between the kinetic and the static limit stays there, although it could slip on."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs

MODEL = hs.Model(
    "spring",
    [hs.State("x", 1.5, "v"), hs.State("v", 0, "-x - f")],
    contacts=[
        hs.Contact("f", velocity="v", normal=1, law="static-kinetic", arguments={"mu_s": 1, "mu_k": 0.4})
    ],
)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-radau"])
def test_a_spring_between_the_limits_does_not_move_a_body_at_rest(integrator: str) -> None:
    """It slips from 1.5 around the centre 0.4, and turns at -0.7 at t = pi, between mu_k and mu_s."""
    sol = hs.simulate(
        MODEL, (0, 20), integrator=integrator, **({} if integrator == "exact" else {"rtol": 1e-9})
    )
    assert [(e.source, e.target) for e in sol.events] == [("slip-", "stick")]
    assert sol.events[0].t == pytest.approx(math.pi, abs=1e-6)
    assert sol.y[0, -1] == pytest.approx(-0.7, abs=1e-6)
    assert sol.y[1, -1] == 0.0
