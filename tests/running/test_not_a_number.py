"""What has no value is named where it arises: the rate, the guard or the reset, the mode and the state."""

from __future__ import annotations

import numpy as np
import pytest

import hybridsim as hs

METHODS = ("taylor", "dop853", "scipy-dop853", "rodas5p", "cvode-bdf")


def model(rate: str = "-1", guard: str = "x + 10", reset: str = "0") -> hs.Model:
    return hs.Model.from_toml(f"""
schema = 1
name = "falling"
[states]
x = {{ start = 1, der = "{rate}" }}
y = {{ start = 0, der = "1" }}
[modes.down]
initial = true
guards.g = {{ expr = "{guard}", then = {{ to = "down", reset = {{ x = "{reset}" }} }} }}
""")


@pytest.mark.parametrize("name", METHODS)
def test_a_rate(name: str) -> None:
    sol = hs.simulate(model(rate="-1 - 0.1*sqrt(x)"), (0.0, 2.0), integrator=name)
    assert sol.status == "step-failure"
    assert "the rate of x is not a number" in sol.message and "mode down" in sol.message
    # dx/dt = -1 - a sqrt(x) reaches zero at (2/a)(1 - ln(1 + a)/a)
    assert sol.t_end == pytest.approx(20.0 * (1.0 - 10.0 * np.log(1.1)), abs=1e-6)
    assert abs(sol.y[0, -1]) < 1e-6


@pytest.mark.parametrize("name", METHODS)
def test_a_guard(name: str) -> None:
    sol = hs.simulate(model(guard="sqrt(x) + 1"), (0.0, 2.0), integrator=name)
    assert sol.status == "step-failure"
    assert "guard g in mode down is not a number" in sol.message


@pytest.mark.parametrize("name", [*METHODS, "exact"])
@pytest.mark.parametrize("reset", ["log(x - 2)", "exp(1e4*x)"])
def test_a_reset(name: str, reset: str) -> None:
    sol = hs.simulate(model(guard="x - 0.5", reset=reset), (0.0, 2.0), integrator=name)
    assert sol.status == "inconsistent"
    assert (
        "the reset of guard g of mode.down sets x to" in sol.message and "at x = 0.5, y = 0.5" in sol.message
    )
    assert sol.t_end == pytest.approx(0.5)


def test_a_state_that_grows() -> None:
    sol = hs.simulate(model(rate="x**2"), (3.0, 5.0), integrator="dop853")
    assert sol.status == "step-failure" and "may grow without bound" in sol.message
    assert sol.t_end == pytest.approx(4.0, abs=1e-5)
    assert sol.message.startswith(f"after t = {sol.t_end:.9g}: the step size fell to ")


def test_a_start() -> None:
    sol = hs.simulate(model(rate="log(x - 2)"), (0.0, 2.0), integrator="dop853")
    assert not sol.success and "the rate of x is not a number" in sol.message


@pytest.mark.parametrize("name", METHODS)
def test_a_corner(name: str) -> None:
    """exp(-1/u**2) has no value where u = max(x, 0) is nothing: which of two is larger cannot be told from there on."""
    nested = hs.Model(
        "nested",
        states=[hs.State("x", 1, "-1"), hs.State("y", 0, "max(-0.5 - x, exp(-1/max(x, 0)**2))")],
    )
    sol = hs.simulate(nested, (0.0, 3.0), integrator=name)
    assert sol.status == "step-failure"
    assert "max(-0.5 - x, exp(-1/max(x, 0)**2)) in mode + is not a number" in sol.message
    assert sol.t_end == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["dop853", "tsit5", "taylor", "scipy-dop853"])
def test_a_load_that_loses_its_value_ends_the_run_at_once(name: str) -> None:
    block = hs.Model(
        "block",
        states=[hs.State("x", 0, "v"), hs.State("v", 2, "-f")],
        contacts=[hs.Contact("f", velocity="v", normal="sqrt(1 - t)", law="coulomb", arguments={"mu": 0.1})],
    )
    sol = hs.simulate(block, (0.0, 3.0), integrator=name, limits={"steps": 10_000})
    assert sol.status == "step-failure" and "'sqrt(1 - t)' has no value" in sol.message
    assert sol.t_end == pytest.approx(1.0, abs=1e-12)
    # v = 2 - mu (2/3)(1 - (1 - t)**1.5), by steps that each keep to 1e-9
    assert sol.y[1, -1] == pytest.approx(2.0 - 0.1 * 2.0 / 3.0, rel=1e-8)


@pytest.mark.parametrize("name", ["taylor", "dop853", "scipy-dop853"])
def test_a_monitor_is_warned_of(name: str) -> None:
    falling = hs.Model(
        "falling",
        states=[hs.State("x", 1, "-1")],
        monitors=[hs.Monitor("k", "log(x) + 1", direction="down")],
    )
    sol = hs.simulate(falling, (0.0, 3.0), integrator=name)
    assert sol.status == "finished" and sol.y[0, -1] == pytest.approx(-2.0)
    assert sol.events[0].t == pytest.approx(1.0 - np.exp(-1.0), rel=1e-12)
    assert any("monitor k is not a number during a part of the run" in text for text in sol.warnings)


@pytest.mark.parametrize("guard", ["1/x", "tan(2*t + 0.1) + 5"])
def test_a_guard_with_a_pole(guard: str) -> None:
    sol = hs.simulate(model(guard=guard), (0.0, 2.0), integrator="taylor")
    assert sol.status == "step-failure" and "guard g in mode down" in sol.message and "pole" in sol.message


@pytest.mark.parametrize("name", ["dop853", "taylor", "scipy-rk45"])
def test_a_rate_with_a_pole(name: str) -> None:
    """dx/dt = -1/x reaches zero at t = x0**2/2."""
    sol = hs.simulate(model(rate="-1/x"), (0.0, 2.0), integrator=name)
    assert sol.status == "step-failure" and sol.t_end == pytest.approx(0.5, abs=1e-8)
    assert "x = " in sol.message and "there may be a pole" in sol.message


def test_a_state_that_cannot_be_squared() -> None:
    sol = hs.simulate("dfcs", (0.0, 2.0), x0={"x": 1e300})
    assert sol.status == "step-failure" and "x = 1e+300 is too large to be squared" in sol.message


@pytest.mark.parametrize(
    ("name", "given", "what"),
    [("dop853", {"max_step": 1e-300}, "max_step"), ("moreau", {"step": 1e-20}, "step")],
)
def test_steps_without_end_are_refused(name: str, given: dict[str, float], what: str) -> None:
    with pytest.raises(
        hs.UsageError, match=rf"^`{what}` is 1e-\d+: a run from 0 to 1 would take 1e\+\d+ steps"
    ):
        hs.simulate("dfcs", (0.0, 1.0), integrator=name, **given)


@pytest.mark.parametrize("name", ["cvode-bdf", "cvode-adams"])
def test_a_fall_to_rest_is_no_pole(name: str) -> None:
    """Among the last bounces gap and speed are next to zero, and nothing grows: the ball lies on the floor."""
    ball = hs.Model(
        "ball",
        states=[hs.State("h", 1.25, "w"), hs.State("w", 0, "-10 + p")],
        impacts=[hs.Impact("p", gap="h", restitution=0.5)],
    )
    sol = hs.simulate(ball, (0.0, 3.0), integrator=name)
    assert sol.success, sol.message
    assert sol.events[-1].t == pytest.approx(1.5, abs=1e-5)
    assert sol.modes["p"][-1].mode == "closed" and sol.y[:, -1].tolist() == [0.0, 0.0]


def test_what_a_rate_divides_by_is_named() -> None:
    body = hs.Model(
        "body",
        parameters={"m": 1.0},
        states=[hs.State("x", 1, "v"), hs.State("v", 0, "(-x - v)/m")],
    )
    for name in ("exact", "dop853", "scipy-rk45"):
        sol = hs.simulate(body, (0.0, 1.0), params={"m": 0}, integrator=name)
        assert sol.status == "step-failure" and "it divides by m, which is 0" in sol.message


@pytest.mark.parametrize("name", [one.name for one in hs.list_integrators()])
@pytest.mark.parametrize(
    ("rate", "why"), [("(-k*x - f)/m", ": it divides by m, which is 0"), ("(-k*x - f)*sqrt(-1 - m)", "")]
)
def test_a_rate_where_a_stick_would_begin(name: str, rate: str, why: str) -> None:
    """Both directions of slip have an infinite or no rate: that they are two is no reason to speak of many motions."""
    block = hs.Model(
        "block",
        parameters={"m": 0, "k": 1},
        states=[hs.State("x", 2, "v"), hs.State("v", 0, rate)],
        contacts=[hs.Contact("f", velocity="v", normal="1", law="coulomb", arguments={"mu": 0.5})],
    )
    has_fixed_step = name in ("rk4-dichotomy", "rk4-sign", "moreau")
    sol = hs.simulate(block, (0.0, 1.0), integrator=name, **({"step": 0.01} if has_fixed_step else {}))
    assert sol.status == "step-failure" and sol.t_end == 0.0
    if not has_fixed_step:  # they see a state that is no number after their first step
        assert f"the rate of v is not a number (at x = 2, v = 0, f slip+){why}" in sol.message


def test_a_rate_where_a_stick_has_begun() -> None:
    """What holds the block divides by zero, and that is what its limits are compared with."""
    block = hs.Model(
        "block",
        parameters={"q": 0},
        states=[hs.State("v", 0, "1/q - f")],
        contacts=[hs.Contact("f", velocity="v", normal="1", law="coulomb", arguments={"mu": 0.5})],
    )
    sol = hs.simulate(block, (0.0, 1.0), integrator="dop853")
    assert sol.status == "step-failure" and "it divides by q, which is 0" in sol.message


@pytest.mark.parametrize("rate", ["(-a - 2*b)/q", "(-a - 2*b)*sqrt(-1 - q)"])
def test_a_rate_where_two_surfaces_meet(rate: str) -> None:
    pair = hs.Model(
        "pair",
        parameters={"q": 0},
        states=[hs.State("x", 0, rate), hs.State("y", 0, "-b + 2*a")],
        surfaces=[hs.SwitchingSurface("a", "x"), hs.SwitchingSurface("b", "y")],
    )
    sol = hs.simulate(pair, (0.0, 1.0), integrator="dop853")
    assert sol.status == "step-failure" and "is not a number" in sol.message


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5", "scipy-dop853", "cvode-adams"])
@pytest.mark.parametrize("level", [0.7, 0.0, -3.0])
def test_a_monitor_crosses_nothing_where_it_has_no_value(integrator: str, level: float) -> None:
    """The logarithm of a negative number is none, though its slope is one: x + 2 = exp(level) twice a turn."""
    model = hs.Model(
        "swing",
        states=[hs.State("x", 0.5, "v"), hs.State("v", 0.0, "-4*(x + 0.75)*(1 + 0.1*sin(x))")],
        monitors=[
            hs.Monitor("level", f"log(2 + x) - ({level})"),
            hs.Monitor("place", f"2 + x - exp({level})"),
        ],
    )
    sol = hs.simulate(model, (0, 6), integrator=integrator)
    assert len(sol.event_times("place")) == 4
    assert sol.event_times("level") == pytest.approx(sol.event_times("place"), abs=1e-8)


@pytest.mark.parametrize(
    "integrator",
    ["taylor", "dop853", pytest.param("tsit5", marks=pytest.mark.slow), "rodas5p", "scipy-dop853"],
)
def test_a_run_into_a_singularity_comes_to_an_end(integrator: str) -> None:
    """Where log(0.3 + x) has no value any more steps of some units in the last place move nothing."""
    rate = "-0.05*t - 0.89*x - 0.17*v + 0.05*log(0.3 + x) + 0.3"
    model = hs.Model("into-a-logarithm", [hs.State("x", -0.2884, "v"), hs.State("v", -0.12, rate)])
    sol = hs.simulate(model, (0, 10), integrator=integrator)
    assert sol.status == "step-failure" and "the rate of v is not a number" in sol.message
    assert sol.t_end == pytest.approx(0.1144536582, abs=1e-9)
    assert sol(sol.t_end)[0] == pytest.approx(-0.3, abs=1e-8)
