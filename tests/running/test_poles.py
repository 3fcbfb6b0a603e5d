"""A run ends where a rate has a pole or is 0/0 without a limit; it goes on where there is one."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs
from hybridsim.model.checks.denominators import denominators


def braked(rate: str = "B*(v - r*w)/v") -> hs.Model:
    """A tyre that brakes: its slip ratio is 0/0 at standstill, which it reaches at v0/(mu g) at the latest."""
    return hs.Model(
        "tyre",
        states=[hs.State("v", 10, "-F/m"), hs.State("w", 30, "(r*F - T)/J")],
        parameters={"m": 300.0, "r": 0.3, "J": 1.0, "T": 300.0, "B": 10.0},
        definitions={"slip": rate, "F": "2354.4*tanh(slip)"},
    )


@pytest.mark.parametrize("save", ["all", "events", "nothing"])
@pytest.mark.parametrize("integrator", ["dop853", "tsit5", "rodas5p", "scipy-rk45"])
def test_a_run_ends_where_nothing_is_known_beyond(integrator: str, save: str) -> None:
    """m r v + J w = 930 - T t is zero with v and w at t = 3.1, where the slip ratio is 0/0."""
    sol = hs.simulate(braked(), (0, 10), integrator=integrator, rtol=1e-6, keep=save)
    ends = sol.status == "step-failure" and sol.t_end == pytest.approx(3.1, abs=1e-4)
    # where the way is not kept it is said
    told = save != "all" and any("the denominator v in the rate of v" in w for w in sol.warnings)
    assert ends or told, sol.message
    if ends:
        assert abs(sol.y[:, -1]).max() < 1e-2


def test_a_pole_in_a_quadrature_ends_the_run_and_its_events() -> None:
    model = hs.Model(
        "steep",
        states=[hs.State("x", 1, "-1"), hs.State("y", 0, "atan(1/x)")],
        monitors=[hs.Monitor("half", "x - 0.5", "both"), hs.Monitor("beyond", "x + 0.5", "both")],
    )
    sol = hs.simulate(model, (0, 3), integrator="dop853")
    assert sol.status == "step-failure" and "the denominator x in the rate of y" in sol.message
    assert sol.t_end == pytest.approx(1.0, abs=1e-9)
    assert [event.component for event in sol.events] == ["half"]


REMOVABLE = [
    ("-(x**2 - 1)/(x - 1)", 2.0, 3.0, 3.0 * math.exp(-3.0) - 1.0),
    ("-1 + x**2/x - x", 1.0, 3.0, -2.0),
    ("1 + 0*sin(t - 1)/(t - 1)", 0.0, 3.0, 3.0),
]


@pytest.mark.parametrize("integrator", ["dop853", "rodas5p"])
@pytest.mark.parametrize(("rate", "start", "end", "truth"), REMOVABLE)
def test_a_quotient_with_a_limit_is_passed(
    rate: str, start: float, end: float, truth: float, integrator: str
) -> None:
    model = hs.Model("limit", states=[hs.State("x", start, rate)])
    sol = hs.simulate(model, (0, end), integrator=integrator)
    assert sol.success and not sol.warnings
    assert sol.y[0, -1] == pytest.approx(truth, rel=1e-6)


def test_a_jump_over_the_zero_is_no_passage() -> None:
    """x from 1 to 1/2, then from -1/2 to -1: y = log 2 - log 2."""
    jump = hs.Guard("low", "x - 0.5", then=(hs.Choice("low", reset={"x": "-0.5"}),))
    switch = hs.Component("c", [hs.Mode("high", guards=[jump]), hs.Mode("low")], initial="high")
    states = [hs.State("x", 1, "-1"), hs.State("y", 0, "1/x")]
    sol = hs.simulate(hs.Model("over", states=states, components=[switch]), (0, 1), integrator="dop853")
    assert sol.success and not sol.warnings
    assert sol.y[1, -1] == pytest.approx(0.0, abs=1e-8)


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
