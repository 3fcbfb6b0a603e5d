"""A run that passes the zero of a denominator says so; one that stays away from it does not."""

from __future__ import annotations

import pytest

import hybridsim as hs
from hybridsim.model.denominators import denominators


def braked(rate: str = "B*(v - r*w)/v") -> hs.Model:
    """A tyre that brakes: its slip ratio is 0/0 at standstill, which it reaches at v0/(mu g) at the latest."""
    return hs.Model(
        "tyre",
        states=[hs.State("v", 10, "-F/m"), hs.State("w", 30, "(r*F - T)/J")],
        parameters={"m": 300.0, "r": 0.3, "J": 1.0, "T": 300.0, "B": 10.0},
        definitions={"slip": rate, "F": "2354.4*tanh(slip)"},
    )


@pytest.mark.parametrize("integrator", ["dop853", "tsit5", "rodas5p", "scipy-rk45"])
def test_a_zero_of_a_denominator_is_pointed_out(integrator: str) -> None:
    sol = hs.simulate(braked(), (0, 10), integrator=integrator, rtol=1e-6)
    told = [w for w in sol.warnings if "the denominator v in the rate of v passes zero" in w]
    assert bool(told) == (sol.output("v")[-1] < 0)
    assert told or not sol.success


def test_before_standstill_nothing_is_said() -> None:
    sol = hs.simulate(braked(), (0, 1), integrator="dop853")
    assert sol.success
    assert not [w for w in sol.warnings if "denominator" in w]


def test_what_cannot_pass_zero_or_is_kept_away_is_not_looked_at() -> None:
    assert [d.text for d in denominators(braked())] == ["v"]
    assert not denominators(braked("B*(v - r*w)/(1 + v**2)"))
    assert not denominators(braked("B*(v - r*w)/v if v > 0.1 else 0"))
    assert not denominators(braked("B*(v - r*w)/m"))


def test_a_negative_power_is_a_division() -> None:
    assert [d.text for d in denominators(braked("B*(v - r*w)*v**-1"))] == ["v"]
