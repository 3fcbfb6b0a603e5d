"""Time stepping against closed forms and against methods that locate events, which it shares no decision with."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs

# steps over the span, how the error of x falls with them at least, and how small it is with the finest
SCENES = {
    "dfcs": (0.0592, {"F0": 30.0}, 500),
    "free-decay": (20.0, {}, 1000),
    "belt": (50.0, {}, 2000),
    "static-kinetic": (12.0, {}, 2000),
    "square-wave": (24.0, {}, 2000),
    "base-isolation": (10.0, {}, 2000),
}


SLOW = {"square-wave"}


@pytest.mark.parametrize(
    "scene", [pytest.param(s, marks=pytest.mark.slow) if s in SLOW else s for s in SCENES]
)
def test_the_error_falls_in_proportion_to_the_step(scene: str) -> None:
    """In the mean over the time: a stop that comes a step late moves a jump of the rates, not the rest."""
    end, params, steps = SCENES[scene]
    reference = hs.simulate(scene, (0, end), params=params, rtol=1e-11)
    times = np.linspace(0, end, 4001)
    truth = reference(times)
    scale = np.abs(truth).max(axis=1)[:, None]
    errors = []
    for k in range(4):
        sol = hs.simulate(scene, (0, end), params=params, integrator="moreau", step=end / (steps * 4**k))
        assert sol.status == "finished"
        assert sol.warnings == ()
        errors.append(float((np.abs(sol(times) - truth) / scale).mean(axis=1).max()))
    order = np.polyfit(np.log(4.0) * np.arange(4), -np.log(errors), 1)[0]
    assert order > 0.8
    assert errors[-1] < 2e-3


def test_a_body_below_the_limit_does_not_move_at_all() -> None:
    still = hs.simulate("dfcs", (0, 1.0), params={"F0": 19.99}, integrator="moreau", steps_per_period=40.0)
    assert (still.y == 0.0).all()
    assert len(still.t) > 1000
    # at x = -1e-5 the spring adds 1 N: 20.99 N are more than the 20 N of friction
    run = {"params": {"F0": 19.99}, "x0": {"x": -1e-5}, "integrator": "moreau", "steps_per_period": 40.0}
    assert hs.simulate("dfcs", (0, 1.0), **run).y[0].max() > -1e-5


def test_a_body_that_sticks_keeps_its_place_bit_for_bit() -> None:
    sol = hs.simulate("free-decay", (0, 20), integrator="moreau", step=0.01)
    rest = sol.modes["f"][-1]
    assert rest.mode == "stick"
    held = sol.y[:, sol.t >= rest.t0 + 0.01]
    assert held.shape[1] > 100
    assert (held[1] == 0.0).all()
    assert (held[0] == held[0, 0]).all()


def test_theta_one_half_keeps_the_energy_of_a_free_vibration() -> None:
    """The midpoint rule conserves quadratic invariants; theta = 1 takes energy out with every step."""
    run = {"params": {"F0": 0.0, "N": 0.0, "c": 0.0}, "x0": {"x": 1e-4}, "integrator": "moreau", "step": 1e-4}
    sol = hs.simulate("dfcs", (0, 1.0), **run)
    energy = 1e5 * sol.y[0] ** 2 + 0.2 * sol.y[1] ** 2
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-10
    damped = hs.simulate("dfcs", (0, 1.0), theta=1.0, **run)
    last = 1e5 * damped.y[0, -1] ** 2 + 0.2 * damped.y[1, -1] ** 2
    # one step multiplies it by 1/(1 + (h omega)**2)
    assert last / energy[0] == pytest.approx((1.0 + 1e-8 * 5e5) ** -1e4, rel=1e-6)


def test_a_step_may_hold_many_events() -> None:
    """Thirty steps a period, fewer than a method that locates four events would care to take; nothing is missed."""
    period = 2 * math.pi / (0.6 * math.sqrt(5e5))
    exact = hs.simulate("dfcs", (0, 50 * period), integrator="exact", keep=2 * period)
    coarse = hs.simulate(
        "dfcs", (0, 50 * period), integrator="moreau", steps_per_period=30.0, keep=2 * period
    )
    assert np.abs(coarse.y[0]).max() == pytest.approx(np.abs(exact.y[0]).max(), rel=0.02)


def test_contacts_that_act_on_each_other_are_decided_together() -> None:
    """Two plates, the lower one driven: both slip, stick to each other, and to the ground, as by enumeration."""
    reference = hs.simulate("clutches", (0, 2), rtol=1e-11)
    sol = hs.simulate("clutches", (0, 2), integrator="moreau", step=1e-4)
    assert [(e.component, e.target) for e in sol.events] == [
        (e.component, e.target) for e in reference.events
    ]
    assert np.abs(np.array([e.t for e in sol.events]) - [e.t for e in reference.events]).max() <= 2e-4


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"theta": 0.4}, "theta"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"iterations": 1}, "iterations"),
        ({"step": -1.0}, "step"),
        ({"rtol": 1e-6}, "rtol"),
    ],
)
def test_a_bad_option_is_named(options: dict[str, float], named: str) -> None:
    with pytest.raises(hs.HybridsimError, match=named):
        hs.simulate("dfcs", (0, 0.01), integrator="moreau", **options)


def test_steps_that_do_not_converge_are_counted() -> None:
    sol = hs.simulate("dfcs", (0, 0.05), integrator="moreau", iterations=2, tolerance=1e-16)
    assert "did not converge" in sol.warnings[0]


def test_static_friction_in_coupled_contacts_comes_loose_at_its_limit() -> None:
    """What sticks and slips in turns within a step must not stay above its limit (tied-limits, but for a load)."""
    path = Path(hs.__file__).parent / "testing" / "scenes" / "tied-limits.toml"
    model = hs.Model.from_toml(path.read_text("utf-8").replace("normal = 20.0", "normal = 25"), str(path))
    sol = hs.simulate(model, (0, 0.2), integrator="moreau", step=1e-3)
    assert sol.warnings == ()
    assert sol.events[0].component == "b"
    assert sol.events[0].t == pytest.approx(np.arcsin(0.4) / 4, abs=1.1e-3)
    assert np.abs(sol.output("b", sol.t)).max() <= 6.0 + 1e-9
