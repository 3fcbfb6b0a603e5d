"""A motion goes on through a corner, such as abs(w), where rounding hides the sign of every derivative of w."""

from __future__ import annotations

import pytest

import hybridsim as hs

ULP = 2.0**-22  # of the two large states; both their difference and the result are exact in double precision


def slow(rate: str) -> hs.Model:
    """w falls from ULP to -ULP in two time units; its rate is a difference of large states, hidden by rounding."""
    return hs.Model(
        "slow",
        states=[
            hs.State("a", 2.0**30, 0),
            hs.State("b", 2.0**30 + ULP, 0),
            hs.State("w", ULP, "a - b", nominal=ULP),
            hs.State("way", 0, rate),
        ],
    )


@pytest.mark.parametrize(
    "integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-radau", "cvode-bdf"]
)
@pytest.mark.parametrize("rate", ["4194304*abs(w)", "4194304*max(w, -w)"])
def test_a_corner_is_passed_once_and_the_run_goes_on(integrator: str, rate: str) -> None:
    """|1 - t| has the integral 1 over [0, 2]: two triangles with the area 1/2."""
    sol = hs.simulate(slow(rate), (0, 2), integrator=integrator, rtol=1e-9, atol=1e-16)
    assert (sol.status, sol.warnings) == ("finished", ())
    assert sol.x_end[2:] == pytest.approx([-ULP, 1.0], rel=1e-7)
    assert [c.t for c in sol.corners] == pytest.approx([1.0], rel=1e-6)
