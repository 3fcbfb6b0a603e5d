"""Time stepping of impacts against closed forms and against methods that locate every one of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from integrators.fixed_step.impact_models import G, ball, balls, pendulum, shaken

import hybridsim as hs

STEPS = 4  # neighbouring steps, over which an error is averaged: where in a step an impact falls is chance


def order(errors: list[float], ratio: float) -> float:
    """The exponent with which errors fall with the step."""
    return -float(np.polyfit(np.arange(len(errors)), np.log(errors), 1)[0]) / math.log(ratio)


SCENES = {
    "vibrating-table": ("vibrating-table", 1.0, 1000),
    "thrown-block": ("thrown-block", 2.0, 1000),
    "balls": (balls, 0.9, 1000),
    "pendulum": (pendulum, 3.0, 1000),
    "shaken": (shaken, 10.0, 1000),
}


@pytest.mark.parametrize("scene", SCENES)
def test_the_error_falls_in_proportion_to_the_step(scene: str) -> None:
    """In the mean over the time (L1), of positions and of velocities, which jump."""
    made, end, steps = SCENES[scene]
    model = made if isinstance(made, str) else made()
    reference = hs.simulate(model, (0, end), integrator="taylor", rtol=1e-11)
    assert any(e.source == "open" for e in reference.events)
    # finer than the steps: a velocity that jumps late differs between two of them
    times = np.linspace(0, end, 32001)
    truth = reference(times)
    scale = np.abs(truth).max(axis=1)[:, None]
    errors = np.zeros((3, len(truth)))
    for level in range(len(errors)):
        for k in range(STEPS):
            step = end / (steps * 4**level * (1 + k / STEPS))
            sol = hs.simulate(model, (0, end), integrator="moreau", step=step)
            assert (sol.status, sol.warnings) == ("finished", ())
            errors[level] += (np.abs(sol(times) - truth) / scale).mean(axis=1) / STEPS
    assert errors[-1].max() < 2e-3
    for of_one in errors.T:
        assert order(of_one.tolist(), 4.0) > 0.8


@pytest.mark.parametrize("e", [0.0, 0.3, 0.7, 0.9])
def test_a_ball_comes_to_rest_at_the_limit_of_its_bounces_and_stays(e: float) -> None:
    limit = math.sqrt(2 / G) * (1 + e) / (1 - e)
    late = []
    for step in (1e-3, 2.5e-4, 6.25e-5):
        sol = hs.simulate(ball(e=e), (0, 12), integrator="moreau", step=step)
        (event,) = sol.events  # bounces are none: the mode does not change
        assert (event.source, event.target) == ("open", "closed")
        at_rest = sol.y[:, sol.t >= event.t + 1.5 * step]  # the mode counts from where the step begins
        assert (at_rest == 0.0).all()
        assert sol.output("p", 12.0) == 2 * G
        late.append(abs(event.t - limit))
    # what is left of the bounces when one takes less than a step: 2 g h/(g (1 - e)), and half a step for each before
    assert max(late[i] / (1e-3 * 4.0**-i) for i in range(3)) < 2 / (1 - e) + 15


def test_bounces_by_their_closed_form() -> None:
    e, first = 0.8, math.sqrt(2 / G)
    times = np.linspace(0, 2.0, 64001)
    truth = np.where(times < first, [1 - G * times**2 / 2, -G * times], 0.0)
    start, speed = first, e * G * first
    for _ in range(3):
        s = times - start
        on = (s >= 0) & (s < 2 * speed / G)
        truth += np.where(on, [speed * s - G * s**2 / 2, speed - G * s], 0.0)
        start, speed = start + 2 * speed / G, e * speed
    assert start > 2.0
    errors = []
    for level in range(3):
        found = [
            hs.simulate(ball(e=e), (0, 2.0), integrator="moreau", step=1e-3 / (4**level * (1 + k / STEPS)))
            for k in range(STEPS)
        ]
        errors.append(np.mean([np.abs(sol(times) - truth).mean(axis=1) for sol in found], axis=0))
    for of_one in np.array(errors).T:
        assert order(of_one.tolist(), 4.0) > 0.8
    # the first impact is at most one step late, which moves a jump of (1 + e) times the speed by one step, and each
    # flight after it shifts by up to two steps more: in the mean over 2 s
    jumps = [(1 + e) * G * first * e**k * (1 + 2 * k) for k in range(3)]
    assert errors[-1][1] < sum(jumps) / 2 * 1e-3 / 16


def test_balls_that_fall_together_hit_the_ground_as_one_problem() -> None:
    """0 <= P, u+ >= e max(-u-, 0): the ground sends the lower back, and the upper, which lies on it, along."""
    sol = hs.simulate(balls(), (0, 0.46), integrator="moreau", step=1e-5, x0={"y": 1, "v": 0})
    fall = math.sqrt(2 * G)
    up = 0.5 * fall - G * (0.46 - fall / G)
    assert sol.y[1::2, -1] == pytest.approx([up, up], abs=5e-4)


def test_friction_takes_its_share_of_an_impact() -> None:
    """A block thrown flat: each bounce takes mu (1 + e) times the speed of approach, all together mu (1+e)/(1-e)."""
    model = hs.load("thrown-block")
    p = model.parameter_values()
    fall = math.sqrt(2 * p["g"] * p["h0"])
    landed = fall / p["g"] * (1 + p["e"]) / (1 - p["e"])
    left = p["u0"] - p["mu"] * fall * (1 + p["e"]) / (1 - p["e"])
    sol = hs.simulate(model, (0, 2), integrator="moreau", step=2e-5)
    assert sol(landed + 0.01)[1] == pytest.approx(left - p["mu"] * p["g"] * 0.01, abs=1e-3)
    assert sol(1.9)[1:].tolist() == [0.0, 0.0, 0.0]
    dead = hs.simulate(model, (0, 2), integrator="moreau", step=2e-5, params={"e": 0, "mu": 3})
    # 3 times the speed of approach is more than u0
    struck = next(i for i in dead.modes["f"] if i.mode == "stick")
    assert struck.t0 == pytest.approx(fall / p["g"], abs=2.1e-5)


def test_a_table_throws_its_load_off_where_it_falls_away_faster() -> None:
    model = hs.load("vibrating-table")
    p = model.parameter_values()
    sol = hs.simulate(model, (0, 1), integrator="moreau", step=1e-5)
    phase = math.asin(p["g"] / (p["A"] * p["omega"] ** 2))
    thrown = [e for e in sol.events if e.source == "closed"]
    assert len(thrown) >= 4
    for event in thrown:
        turns = (event.t * p["omega"] - phase) / (2 * math.pi)
        assert abs(turns - round(turns)) <= 2e-5 * p["omega"] / (2 * math.pi)
    rest = next(i for i in sol.modes["p"] if i.mode == "closed")
    inside = sol.t[(sol.t > rest.t0 + 1.5e-5) & (sol.t < rest.t1)]
    assert len(inside) > 1000
    assert np.abs(sol.output("gap", inside)).max() < 1e-15


def test_restitution_that_depends_on_the_speed_of_approach() -> None:
    model = hs.Model(
        "soft",
        states=[hs.State("h", 1, der="w"), hs.State("w", 0, der="-g + p")],
        parameters={"g": G},
        impacts=[hs.Impact("p", gap="h", restitution="0.9*exp(-speed/10)")],
    )
    speed, first = math.sqrt(2 * G), math.sqrt(2 / G)
    sol = hs.simulate(model, (0, 0.6), integrator="moreau", step=1e-5)
    up = speed * 0.9 * math.exp(-speed / 10)
    assert sol(0.6)[1] == pytest.approx(up - G * (0.6 - first), abs=5e-4)


def test_what_starts_on_the_ground_rests_or_hits_it_and_what_is_below_is_refused() -> None:
    run = {"integrator": "moreau", "step": 1e-3}
    assert (hs.simulate(ball(), (0, 1), x0={"h": 0, "w": 0}, **run).y == 0.0).all()
    hits = hs.simulate(ball(), (0, 0.1), x0={"h": 0, "w": -1}, **run)
    assert hits.y[1, 1] == pytest.approx(0.7, rel=1e-12)
    below = hs.simulate(ball(), (0, 1), x0={"h": -0.1}, **run)
    assert below.status == "inconsistent" and "the gap of p is below zero" in below.message


def test_a_restitution_above_one_ends_the_run() -> None:
    sol = hs.simulate(ball("0.4 + 0.2*speed"), (0, 1), integrator="moreau", step=1e-3)
    assert sol.status == "inconsistent" and "between 0 and 1" in sol.message
    assert sol.t[-1] == pytest.approx(math.sqrt(2 / G), abs=2e-3)


def dropped(low: float) -> hs.Model:
    """A ball on a table whose height jumps at t = 1."""
    return hs.Model(
        "dropped",
        states=[hs.State("h", 0, der="w", nominal=1), hs.State("w", 0, der="-g + p", nominal=1)],
        parameters={"g": G},
        inputs=[hs.Input("table", "wave", shape="square", period=4, amplitude=low, phase=0)],
        impacts=[hs.Impact("p", gap="h - table", restitution=0)],
    )


def test_a_table_that_drops_lets_its_load_fall() -> None:
    model = dropped(0.1)  # from 0.1 to -0.1 at t = 2
    sol = hs.simulate(model, (0, 3), x0={"h": 0.1}, integrator="moreau", step=1e-4)
    assert sol.status == "finished"
    opens, closes = [e for e in sol.events if e.t > 1]
    assert opens.t == pytest.approx(2, abs=1.1e-4)
    assert closes.t == pytest.approx(2 + math.sqrt(2 * 0.2 / G), abs=3e-4)
    assert sol.y[:, -1].tolist() == [-0.1, 0.0]
    risen = hs.simulate(dropped(-0.1), (0, 3), x0={"h": -0.1}, integrator="moreau", step=1e-4)
    assert risen.status == "inconsistent"
    assert risen.t[-1] == pytest.approx(2)


def test_theta_one_half_keeps_the_energy_of_an_impact_without_loss() -> None:
    """A free body between two stops, e = 1: nothing takes speed from it."""
    model = hs.Model(
        "rattle",
        states=[hs.State("x", 0, der="v", nominal=1), hs.State("v", 1, der="p - q", nominal=1)],
        parameters={"d": 1, "e": 1},
        impacts=[hs.Impact("p", gap="x + d", restitution="e"), hs.Impact("q", gap="d - x", restitution="e")],
    )
    sol = hs.simulate(model, (0, 100), integrator="moreau", step=1e-2)
    assert np.abs(sol.y[1]) == pytest.approx(1.0, rel=1e-13)
    assert np.abs(sol.y[0]).max() <= 1 + 1e-2
