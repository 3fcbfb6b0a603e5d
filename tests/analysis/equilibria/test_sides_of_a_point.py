"""Linearizations and functions of one mode take the side of each corner, the piece of each table, at their point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

import hybridsim as hs
from hybridsim.errors import UsageError

SPEEDS, COEFFICIENTS = (0.0, 0.1, 0.3, 0.8, 1.5, 2.5), (0.6, 0.45, 0.4, 0.38, 0.42, 0.5)
MU = PchipInterpolator(SPEEDS, COEFFICIENTS)  # of Fritsch and Butland, as the law's tables
BELT = f"""schema = 1
name = "measured"
[parameters]
belt = 1
[states]
x = {{ start = 0, der = "v", nominal = 1 }}
v = {{ start = 0, der = "-9*x - 0.2*v - f", nominal = 1 }}
[contacts.f]
velocity = "v - belt"
normal = 10
law = {{ name = "measured" }}
[laws.measured]
slip = "mu*N"
stick = "mu*N"
tables.mu = {{ at = {list(SPEEDS)}, values = {list(COEFFICIENTS)} }}
"""


def scalar(der: str, definitions: str = "") -> hs.Model:
    return hs.Model.from_toml(
        f'schema = 1\nname = "corner"\n[states]\nx = {{ start = -1, der = "{der}" }}\n{definitions}'
    )


@pytest.mark.parametrize(
    ("der", "slopes"),
    [
        ("x + 3 - 2*abs(x)", {-1.0: 3.0, 2.0: -1.0}),
        ("-x - (max(x - 0.5, 0) - max(-x - 0.5, 0))", {-1.0: -2.0, 0.0: -1.0, 2.0: -2.0}),
        ("x - 2*min(x, 1)", {0.0: -1.0, 2.0: 1.0}),
        ("(3*x if x > 1 else x + 2) - 3", {-1.0: 1.0, 2.0: 3.0}),
        ("-x + abs(x - abs(x - 1))", {0.0: -3.0, 0.75: 1.0, 2.0: -1.0}),
        ("-x**2 - sign(x - 1)", {-1.0: 2.0, 2.0: -4.0}),
        ("-x + sqrt(1 + abs(x))", {-1.0: -1.0 - 0.5 / math.sqrt(2.0), 3.0: -0.75}),
    ],
)
def test_the_slope_on_the_side_of_the_point(der: str, slopes: dict[float, float]) -> None:
    for x, slope in slopes.items():
        found = hs.linearize(scalar(der), at=[x])
        assert pytest.approx(np.array([[slope]]), rel=1e-14) == found.A, (der, x)
        assert found.stable == (slope < 0.0)


@pytest.mark.parametrize(
    ("der", "x"), [("x + 3 - 2*abs(x)", 0.0), ("-x + max(x, 1)", 1.0), ("-sign(x) + 2", 0.0)]
)
def test_at_the_corner_itself_there_is_none(der: str, x: float) -> None:
    with pytest.raises(UsageError, match="two sides differ"):
        hs.linearize(scalar(der), at=[x])


@pytest.mark.parametrize(
    ("der", "x", "slope"), [("x**2*sign(x) - x", 0.0, -1.0), ("-x + max(x, 0)**2", 0.0, -1.0)]
)
def test_a_corner_without_an_angle_is_none(der: str, x: float, slope: float) -> None:
    assert pytest.approx(np.array([[slope]]), abs=1e-14) == hs.linearize(scalar(der), at=[x]).A


def test_the_equilibrium_is_looked_for_across_corners() -> None:
    """x + 3 - 2 |x| vanishes at -1, where it rises with the slope 3, and at 3, where it falls with the slope -1."""
    model = scalar("x + 3 - 2*abs(x)")
    near = hs.linearize(model)
    far = hs.linearize(hs.Model("corner", [hs.State("x", 7.0, "x + 3 - 2*abs(x)")]))
    assert (near.x[0], near.A[0, 0]) == pytest.approx((-1.0, 3.0), rel=1e-12)
    assert (far.x[0], far.A[0, 0]) == pytest.approx((3.0, -1.0), rel=1e-12)
    assert sorted(e.x[0] for e in hs.equilibria(model)) == pytest.approx([-1.0, 3.0])


def test_rest_inside_the_play_feels_no_spring() -> None:
    found = hs.linearize("elastic-gap", at=[0.0, 0.0])
    assert pytest.approx(np.array([[0.0, 1.0], [0.0, -0.2]]), abs=1e-15) == found.A
    assert hs.linearize("elastic-gap", at=[0.1, 0.0]).A[1, 0] == pytest.approx(-100.0, rel=1e-12)


@pytest.mark.parametrize("v", [0.95, 0.85, 0.5, 0.0, -0.3, -1.2, -5.0])
def test_a_tables_piece_is_that_of_the_speed(v: float) -> None:
    model = hs.Model.from_toml(BELT)
    speed = min(1.0 - v, 2.5)
    slope = 0.0 if speed >= 2.5 else float(MU.derivative()(speed))
    rate = -9.0 * 0.2 - 0.2 * v + 10.0 * float(MU(speed))  # friction drives the slower body on
    A = np.array([[0.0, 1.0], [-9.0, -0.2 - 10.0 * slope]])
    fun, events, jac = hs.to_ivp(model, {"f": "slip-"})
    assert fun(0.0, [0.2, v]) == pytest.approx([v, rate], rel=1e-12)
    assert jac(0.0, [0.2, v]) == pytest.approx(A, rel=1e-7, abs=1e-7)
    assert [event.guard for event in events] == ["velocity"]
    assert pytest.approx(A, rel=1e-11, abs=1e-12) == hs.linearize(model, "slip-", at=[0.2, v]).A


def test_the_growth_of_sliding_under_a_table() -> None:
    """About steady sliding the growth is half of -(0.2 + 10 mu'(belt)) as long as it oscillates."""
    for belt in (0.2, 0.6, 1.0, 2.0):
        model = hs.Model.from_toml(BELT).with_(belt=belt)
        expected = -0.5 * (0.2 + 10.0 * float(MU.derivative()(belt)))
        assert hs.linearize(model, "slip-").growth == pytest.approx(expected, rel=1e-9)
        (rest,) = [e for e in hs.equilibria(model) if e.modes["f"] == "slip-"]
        assert rest.growth == pytest.approx(expected, rel=1e-9)


def test_a_corner_in_a_load_and_a_clipped_force() -> None:
    """A load 2 + |x| under Coulomb friction: the slope of the rate by x changes its sign with x."""
    text = """schema = 1
name = "load"
[states]
x = { start = 0, der = "v", nominal = 1 }
v = { start = 1, der = "-min(x, 0.5) - f", nominal = 1 }
[contacts.f]
velocity = "v"
normal = "2 + abs(x)"
law = { name = "coulomb", mu = 0.25 }
"""
    model = hs.Model.from_toml(text)
    for x, slope in ((-1.0, -1.0 + 0.25), (0.3, -1.0 - 0.25), (0.8, -0.25)):
        found = hs.linearize(model, "slip+", at=[x, 1.0])
        assert found.A[1] == pytest.approx([slope, 0.0], rel=1e-14)
        fun, _, jac = hs.to_ivp(model, {"f": "slip+"})
        assert jac(0.0, [x, 1.0])[1] == pytest.approx([slope, 0.0], rel=1e-6, abs=1e-7)
        assert fun(0.0, [x, 1.0])[1] == pytest.approx(-min(x, 0.5) - 0.25 * (2.0 + abs(x)), rel=1e-14)


@pytest.mark.parametrize("kind", ["tanh", "arctan", "karnopp"])
def test_a_table_may_be_regularized(kind: str) -> None:
    """Faster than the width by far, the force is the table's: v' = 10 mu(1 - v) - 0.2 v - 9 x on the way up."""
    model = hs.Model.from_toml(BELT).regularized(kind, v0=1e-9)
    found = hs.simulate(model, (0.0, 0.05), x0={"x": 0.2, "v": -0.5}, integrator="dop853", rtol=1e-11)
    from scipy.integrate import solve_ivp

    def rate(t: float, x: np.ndarray) -> list[float]:
        return [x[1], 10.0 * float(MU(1.0 - x[1])) - 0.2 * x[1] - 9.0 * x[0]]

    exact = solve_ivp(rate, (0.0, 0.05), [0.2, -0.5], rtol=1e-11, atol=1e-13).y[:, -1]
    assert found.y[:, -1] == pytest.approx(exact, rel=1e-8)


def test_advice_says_of_a_model_that_cannot_be_run_that_it_does_not_apply() -> None:
    forced = BELT.replace('velocity = "v - belt"', 'velocity = "v"').replace(
        "- 0.2*v - f", "- 0.2*v - f + 9*cos(2*t)"
    )
    rungs = ["no-friction", "tanh", "karnopp"]
    advice = hs.advise(hs.Model.from_toml(forced), "amplitude.x", 0.05, rungs=rungs, integrators=False)
    assert not any("\n" in step.why or "unknown name" in step.why for step in advice.ladder)
    assert advice["tanh"].verdict == advice["karnopp"].verdict == "adequate"
