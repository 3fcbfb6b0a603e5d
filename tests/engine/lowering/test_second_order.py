"""Sliding of second order: two relays that hold a function and its rate, entered, kept and left; by closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import pytest

import hybridsim as hs

ALL = ["exact", "taylor", "dop853", "tsit5"]


def stage(acceleration: str, *, x: float = 1.0, v: float = 0.0, u: str = "x", w: str = "v") -> hs.Model:
    """x'' = acceleration, with the relays u and w."""
    return hs.Model(
        "stage",
        states=[hs.State("x", x, "v"), hs.State("v", v, acceleration)],
        surfaces=[hs.SwitchingSurface("u", u), hs.SwitchingSurface("w", w)],
    )


def limit_of(push: Fraction, r1: Fraction, r2: Fraction) -> float:
    """When x'' = push - r1 sign(x) - r2 sign(v) from x = 1 at rest comes to rest for good: a sum over its turns."""
    t, x = 0.0, 1.0
    while abs(x) > 1e-40:
        s = 1 if x > 0 else -1
        towards, back = r1 - s * push - r2, r1 + s * push + r2  # sizes of the acceleration, on either side
        speed = math.sqrt(2 * float(towards) * abs(x))
        t += speed / float(towards) + speed / float(back)
        x = -s * speed**2 / (2 * float(back))
    return t


@pytest.mark.parametrize("integrator", [*ALL, "rodas5p", "scipy-rk45"])
@pytest.mark.parametrize(
    ("push", "r1", "r2"), [(0.0, 2.0, 1.0), (0.5, 2.0, 1.0), (-0.25, 3.0, 2.5), (0.75, 4.0, 0.5)]
)
def test_the_limit_of_the_turns_is_the_beginning_of_rest(
    integrator: str, push: float, r1: float, r2: float
) -> None:
    """With a push the turns to either side differ: four intervals in each, none in step with the one before."""
    sol = hs.simulate(stage(f"{push} - {r1}*u - {r2}*w"), (0, 20), integrator=integrator)
    assert sol.status == "finished"
    last = [event for event in sol.events if event.target == "sliding"]
    assert sorted(event.component for event in last) == ["u", "w"]
    limit = limit_of(*map(Fraction, (push, r1, r2)))
    assert [event.t for event in last] == pytest.approx([limit, limit], rel=1e-9)
    assert (sol(19.0) == 0.0).all()
    assert len(sol.events) < 600


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize(("w", "sign"), [("v", "-"), ("-v", "+"), ("3*v", "-")])
def test_it_is_left_where_the_push_is_more_than_both_give(integrator: str, w: str, sign: str) -> None:
    """x'' = t/2 - 2 u - w holds x = 0 up to t/2 = 3, and x = (t - 6)^3/12 after that."""
    model = stage(f"t/2 - 2*u {sign} w", x=0.0, w=w)
    sol = hs.simulate(model, (0, 8), integrator=integrator, rtol=1e-11)
    assert (sol(5.9) == 0.0).all()
    leaving = [event for event in sol.events if event.source == "sliding"]
    assert [event.t for event in leaving] == pytest.approx([6.0, 6.0], abs=1e-9)
    assert sol(8.0) == pytest.approx([8 / 12, 1.0], abs=1e-8)


@pytest.mark.parametrize("integrator", ALL)
def test_a_moving_mark_is_kept(integrator: str) -> None:
    """The function x - sin(t) and its rate v - cos(t): held exactly, by 2 u + w = sin(t).

    What is left is the rounding of the angle: of the time since the last event, and of its sum with the angle there.
    """
    model = stage("-2*u - w", x=0.25, v=0.5, u="x - sin(t)", w="v - cos(t)")
    sol = hs.simulate(model, (0, 12), integrator=integrator)
    assert sol.modes["u"][-1].mode == sol.modes["w"][-1].mode == "sliding"
    for t in (9.0, 10.5, 12.0):
        assert sol(t).tolist() == pytest.approx([math.sin(t), math.cos(t)], abs=math.ulp(t))


def test_relays_that_drive_away_do_not_hold() -> None:
    sol = hs.simulate(stage("2*u - w", x=0.0), (0, 1), integrator="exact")
    assert sol.status == "nonunique"


def test_a_third_derivative_is_not_held() -> None:
    """x''' = -2 sign(x) - sign(x'): neither relay acts on the rate of its function."""
    model = hs.Model(
        "jerk",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "a"), hs.State("a", 0, "-2*u - w")],
        surfaces=[hs.SwitchingSurface("u", "x"), hs.SwitchingSurface("w", "v")],
    )
    sol = hs.simulate(model, (0, 1), integrator="exact")
    assert sol.status == "inconsistent"
    assert "higher order" in sol.message


@pytest.mark.parametrize("integrator", ALL)
def test_a_jump_onto_it_is_held(integrator: str) -> None:
    model = replace(
        stage("0.5 - 2*u - w"), schedules=[hs.Schedule("put", times=[0.5], reset={"x": 0, "v": 0})]
    )
    sol = hs.simulate(model, (0, 3), integrator=integrator)
    assert sol.status == "finished"
    assert {e.component for e in sol.events if e.target == "sliding"} == {"u", "w"}
    assert sol(3.0).tolist() == [0.0, 0.0]


def test_the_choice_of_an_integrator_looks_at_what_both_hold() -> None:
    """A gain that depends on time is linear alone, and a quotient where both hold: up to t = 10, where it is zero."""
    sol = hs.simulate(stage("0.5 - (2 - 0.2*t)*u - w", x=0.1), (0, 9))
    assert sol.status == "finished"
    assert (sol(8.0) == 0.0).all()


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_derivatives_through_the_limit(integrator: str) -> None:
    """z' = r u + w, so that z = d T - v(T) + v0 with v(T) = 0, whatever r."""
    model = hs.Model(
        "stage",
        parameters={"d": 0.5, "r": 2.0},
        states=[hs.State("x", 1, "v"), hs.State("v", 0, "d - r*u - w"), hs.State("z", 0, "r*u + w")],
        surfaces=[hs.SwitchingSurface("u", "x"), hs.SwitchingSurface("w", "v")],
    )
    found = hs.sensitivities(hs.simulate(model, (0, 7), integrator=integrator))
    assert found.by_parameter[2] == pytest.approx([7, 0], abs=1e-9)
    assert found.by_start[2] == pytest.approx([0, 1, 1], abs=1e-9)
