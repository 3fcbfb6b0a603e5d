"""Packaged scenes of switching surfaces: what is true of each by a closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import hybridsim as hs

LINEAR = ["exact", "taylor", "dop853"]


@pytest.mark.parametrize("integrator", LINEAR)
def test_relay_control_does_not_feel_the_disturbance(integrator: str) -> None:
    model = hs.load("relay-control")
    p = model.parameter_values()
    sol = hs.simulate(model, (0, 6), integrator=integrator, rtol=1e-11)
    m, U, d, w, rate = (p[name] for name in ("m", "U", "d", "omega", "lambda_"))

    def before(t: float) -> tuple[float, float]:
        """With u = 1: v' = (d sin(w t) - U)/m, twice integrated."""
        return (
            1 + (d / w * (t - math.sin(w * t) / w) - U * t**2 / 2) / m,
            (d / w * (1 - math.cos(w * t)) - U * t) / m,
        )

    onto = brentq(lambda t: rate * before(t)[0] + before(t)[1], 0.0, 2.0, xtol=1e-15)
    assert [event.target for event in sol.events] == ["sliding"]
    assert sol.events[0].t == pytest.approx(onto, abs=1e-9)
    t = np.linspace(onto, 6, 101)[1:]
    x, v = sol(t)
    assert x == pytest.approx(before(onto)[0] * np.exp(-rate * (t - onto)), abs=1e-10)
    assert np.abs(rate * x + v).max() <= 1e-15
    assert sol.output("force", t) == pytest.approx(d * np.sin(w * t) - m * rate**2 * x, abs=1e-9)


def test_relay_control_without_enough_force_leaves_the_line_and_comes_back() -> None:
    sol = hs.simulate("relay-control", (0, 6), params={"d": 2.5}, integrator="exact")
    leaving = [event for event in sol.events if event.source == "sliding"]
    assert leaving
    for event in leaving:  # the weight has come to +1 or -1 there
        x = event.x_plus[0]
        assert abs(2.5 * math.sin(7 * event.t) - x) == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "rodas5p"])
def test_onto_a_circle_and_off_it(integrator: str) -> None:
    sol = hs.simulate("sliding-circle", (0, 6), params={"omega": 3}, integrator=integrator, rtol=1e-11)
    onto = 4 - math.sqrt(16 - 8 * math.log(2))
    assert [event.target for event in sol.events] == ["sliding", "above"]
    assert [event.t for event in sol.events] == pytest.approx([onto, 4.0], abs=1e-9)
    t = np.linspace(onto, 4, 201)[1:-1]
    x, y = sol(t)
    assert np.abs(x**2 + y**2 - 1).max() <= 4.5e-16
    assert x == pytest.approx(np.cos(3 * t), abs=1e-9)
    assert sol.output("r", 6.0) == pytest.approx(math.exp(0.5), rel=1e-9)


@pytest.mark.parametrize("integrator", LINEAR)
def test_endlessly_many_crossings_and_rest_in_the_corner(integrator: str) -> None:
    sol = hs.simulate("relay-spiral", (0, 2), integrator=integrator)
    t = np.linspace(0, 1.5, 301)
    assert sol.output("distance", t) == pytest.approx(6 - 4 * t, abs=1e-8)
    assert [(event.component, event.target) for event in sol.events[-2:]] == [
        ("u", "sliding"),
        ("w", "sliding"),
    ]
    assert sol.events[-1].t == pytest.approx(1.5, abs=1e-9)
    assert len(sol.events) < 500
    assert (sol(np.array([1.6, 2.0])) == 0.0).all()


@pytest.mark.parametrize("integrator", LINEAR)
def test_two_relays_meet(integrator: str) -> None:
    sol = hs.simulate("relay-pair", (0, 2.5), integrator=integrator, rtol=1e-11)
    found = [(event.component, event.target) for event in sol.events]
    assert found == [("w", "sliding"), ("u", "sliding"), ("u", "above")]
    assert [event.t for event in sol.events] == pytest.approx([1 / 6, 1.5 - math.sqrt(0.75), 1.5], abs=1e-12)
    t = np.linspace(0.7, 1.4, 8)
    assert sol.output("u", t) == pytest.approx(2 * t / 3, abs=1e-14)
    assert sol.output("w", t) == pytest.approx(t / 3, abs=1e-14)
    assert (sol(t) == 0.0).all()


@pytest.mark.parametrize("integrator", LINEAR)
def test_chua_from_piece_to_piece(integrator: str) -> None:
    """About x = 3/2 up to x = 1, then about the origin: matrix exponentials and a root of their own."""
    model = hs.load("chua")
    p = model.parameter_values()

    def matrix(slope: float) -> np.ndarray:
        return np.array([[-p["alpha"] * (1 + slope), p["alpha"], 0], [1, -1, 1], [0, -p["beta"], 0]])

    rest = np.array([1.5, 0.0, -1.5])
    start = np.array([1.6, 0.0, -1.6])

    def outside(t: float) -> np.ndarray:
        return np.asarray(rest + expm(matrix(p["outer"]) * t) @ (start - rest))

    grid = np.linspace(0, 20, 2001)
    first = next(b for b in grid if outside(b)[0] < 1)
    corner = brentq(lambda t: outside(t)[0] - 1, first - 0.01, first, xtol=1e-15)
    inside = expm(matrix(p["inner"]) * 0.05) @ outside(corner)
    sol = hs.simulate(model, (0, corner + 0.05), integrator=integrator, rtol=1e-11)
    assert not sol.events
    assert [event.t for event in sol.corners][:1] == pytest.approx([corner], abs=1e-9)
    assert sol(corner / 2) == pytest.approx(outside(corner / 2), abs=1e-9)
    assert sol(corner + 0.05) == pytest.approx(inside, abs=1e-9)


@pytest.mark.parametrize("integrator", LINEAR)
def test_a_twisting_controller_comes_to_rest_and_stays_there(integrator: str) -> None:
    """x'' = -2 sign(x) - sign(v): a third of the swing each time, in a time shorter by sqrt(3); then d*sin is held."""
    model = hs.load("twisting-controller")
    sol = hs.simulate(model, (0, 6), params={"d": 0.0}, integrator=integrator)
    swings = [event.t for event in sol.events if event.component == "w"]
    half = 4 * math.sqrt(2) / 3
    expected = [half * sum(3 ** (-k / 2) for k in range(n)) for n in range(1, 16)]
    assert swings[:15] == pytest.approx(expected, abs=1e-9)
    limit = half / (1 - 1 / math.sqrt(3))
    assert [event.t for event in sol.events if event.target == "sliding"] == pytest.approx(
        [limit] * 2, abs=1e-9
    )
    disturbed = hs.simulate(model, (0, 20), integrator=integrator)
    p = model.parameter_values()
    t = np.linspace(6, 20, 101)
    assert (disturbed(t) == 0.0).all()
    assert disturbed.output("control", t) == pytest.approx(p["d"] * np.sin(p["omega"] * t), abs=1e-14)


REST = """
[states]
x = { start = 0, der = "v" }
v = { start = 0, der = "-2*u - f" }

[surfaces]
u = "x + v"

[contacts.f]
velocity = "v"
normal = 1
law = { name = "coulomb", mu = 0.3 }
"""


@pytest.mark.parametrize(
    "integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853", "cvode-adams"]
)
def test_a_body_at_rest_on_a_surface_and_in_friction_stays(integrator: str) -> None:
    """The contact and the relay act on one speed: what each gives cannot be told, and is not asked for."""
    sol = hs.simulate(hs.Model.from_toml(REST), (0, 5), integrator=integrator)
    assert sol.status == "finished"
    assert not sol.events
    assert sol(5.0) == pytest.approx([0.0, 0.0], abs=0.0)


def servo(load: float) -> hs.Model:
    """A servo with dry friction on the line of its sliding mode, under a load of 3 rad/s."""
    v = f"(-1.5*u - 0.01*v - f + {load}*sin(3*t))/0.02"
    return hs.Model(
        "servo",
        states=[hs.State("x", 0.0, "v", nominal=1), hs.State("v", 0.0, v, nominal=10)],
        surfaces=[hs.SwitchingSurface("u", "6*(x - 1) + v")],
        contacts=[hs.Contact("f", "v", normal=1, law="coulomb", arguments={"mu": 0.2})],
    )


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "rodas5p", "scipy-dop853"])
def test_a_servo_with_friction_comes_to_its_target(integrator: str, rtol: float) -> None:
    """The load is less than what the relay and friction can bear together; 1 - x falls by exp(-6) per unit of time."""
    for load in (0.3, 1.0):
        sol = hs.simulate(servo(load), (0, 12), integrator=integrator, rtol=rtol)
        assert sol.status == "finished"
        assert [event.target for event in sol.events if event.component == "u"] == ["sliding"]
        assert sol(12.0) == pytest.approx([1.0, 0.0], abs=10 * rtol + 1e-14)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5", "rodas5p", "scipy-dop853"])
def test_a_load_that_a_relay_and_friction_cannot_bear_moves_the_servo(integrator: str) -> None:
    """1.5 and 0.2 against 1.75: it is carried off in both directions in turn, every time as far."""
    sol = hs.simulate(servo(1.75), (0, 12), integrator=integrator, rtol=1e-10)
    reference = hs.simulate(servo(1.75), (0, 12), integrator="exact")
    assert sol.status == reference.status == "finished"
    assert [(e.component, e.target) for e in sol.events] == [
        (e.component, e.target) for e in reference.events
    ]
    times = np.linspace(0.0, 12.0, 301)
    assert sol(times) == pytest.approx(reference(times), abs=1e-6)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5"])
def test_a_body_that_creeps_to_rest_sticks_in_the_end(integrator: str) -> None:
    """At ki = 200 the carriage of `pid-servo` comes to its target exponentially and does not hunt."""
    sol = hs.simulate("pid-servo", (0, 40), params={"ki": 200}, integrator=integrator)
    assert sol.status == "finished"
    assert sol.events[-1].target == "stick"
    # the integral bears the kinetic friction: e = 0, ki*integral = mu_k*m*g
    assert sol(40.0) == pytest.approx([0.0, 0.0, 0.12 * 9.81 / 200], abs=1e-9)
