"""The solution: both sides of an event, outputs, modes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import hybridsim as hs
from hybridsim import UsageError

G, RESTITUTION = 9.81, 0.7


@pytest.fixture(scope="module")
def ball() -> hs.Solution:
    return hs.simulate("bouncing-ball", (0, 3), rtol=1e-12)


def first_impact(ball: hs.Solution) -> float:
    values = ball.model.parameter_values()
    return math.sqrt(2 * ball.model.start_values()["h"] / values["g"])


def test_an_event_has_two_sides(ball: hs.Solution) -> None:
    event = ball.events[0]
    values = ball.model.parameter_values()
    speed = values["g"] * first_impact(ball)
    assert event.t == pytest.approx(first_impact(ball), abs=1e-11)
    assert event.x_minus[1] == pytest.approx(-speed, abs=1e-10)
    assert event.x_plus[1] == pytest.approx(values["e"] * speed, abs=1e-10)
    assert event.x_plus[0] == 0.0
    assert (ball(event.t) == event.x_plus).all()
    assert ball(event.t, side="-") == pytest.approx(event.x_minus, abs=1e-12)


def test_equal_events_are_equal(ball: hs.Solution) -> None:
    again = hs.simulate("bouncing-ball", (0, 3), rtol=1e-12)
    first, second = ball.events[:2]
    assert first == again.events[0] and ball.events == again.events
    assert first != second and first != "floor"
    assert ball.events.index(second) == 1 and len({*ball.events, *again.events}) == len(ball.events)
    for other in (
        replace(first, t=second.t),
        replace(first, guard="g"),
        replace(first, x_plus=first.x_minus),
        replace(first, x_minus=first.x_minus[:1]),
    ):
        assert first != other
    lost = replace(first, x_plus=np.full(2, np.nan))
    assert lost == replace(first, x_plus=np.full(2, np.nan)) != first


def test_event_times_stand_twice_in_t(ball: hs.Solution) -> None:
    for event in ball.events:
        assert (ball.t == event.t).sum() == 2
    assert ball.y.shape == (2, len(ball.t))
    assert (np.diff(ball.t) >= 0).all()


@pytest.mark.parametrize("name", ["dfcs", "base-isolation"])
def test_event_times_and_modes_meet_to_the_last_bit(name: str) -> None:
    """Whatever the rounding of local times: an event stands twice, a mode ends where the next begins."""
    sol = hs.simulate(name, (0, 1.5), rtol=1e-7)
    assert len(sol.events) > 2
    for event in sol.events:
        assert (sol.t == event.t).sum() == 2
    for intervals in sol.modes.values():
        assert [a.t1 for a in intervals[:-1]] == [b.t0 for b in intervals[1:]]
        assert [b.t0 for b in intervals[1:]] == [e.t for e in sol.events]


def test_dense_output_is_the_parabola(ball: hs.Solution) -> None:
    t = np.linspace(0, first_impact(ball) * 0.999, 50)
    values = ball.model.parameter_values()
    assert ball(t)[0] == pytest.approx(ball.model.start_values()["h"] - 0.5 * values["g"] * t**2, abs=1e-12)


def test_modes_cover_the_run_without_gaps(ball: hs.Solution) -> None:
    intervals = ball.modes["mode"]
    assert intervals[0].t0 == 0.0 and intervals[-1].t1 == 3.0
    assert [a.t1 for a in intervals[:-1]] == [b.t0 for b in intervals[1:]]
    assert [i.mode for i in intervals] == ["flight", "rest"]


@pytest.mark.parametrize("save", ["all", "events"])
def test_modes_of_no_component_are_refused(save: str) -> None:
    modes = hs.simulate("dfcs", (0, 10), keep=save).modes
    with pytest.raises(UsageError, match="no component 'f3'\ndid you mean 'f'"):
        modes["f3"]
    assert modes.get("f3") is None and list(modes) == ["f"]


def test_outside_of_the_run_is_refused(ball: hs.Solution) -> None:
    with pytest.raises(UsageError, match="outside"):
        ball(3.1)
    with pytest.raises(UsageError, match="side"):
        ball(1.0, side="left")


def test_outputs_by_name() -> None:
    sol = hs.simulate("dfcs", (0, 0.1))
    values = sol.model.parameter_values()
    for interval in sol.modes["f"]:
        middle = 0.5 * (interval.t0 + interval.t1)
        force = sol.output("f", middle)
        x, v = sol(middle)
        load = values["F0"] * math.sin(values["omega"] * middle) - values["c"] * v - values["k"] * x
        expected = {"slip+": 20.0, "slip-": -20.0, "stick": load}[interval.mode]
        assert force == pytest.approx(expected, abs=1e-9)
    assert sol.output("x", 0.05) == sol(0.05)[0]
    assert len(sol.output("f")) == len(sol.t)
    with pytest.raises(UsageError, match="'ff'"):
        sol.output("ff")


def test_the_velocity_of_a_contact() -> None:
    """Of a block on a belt to and fro: what is declared, to rounding, nothing in stick, and what arrays give."""
    velocity, law = "v - 0.3*cos(2*t)", {"mu": 2}
    block = hs.Model(
        "block",
        states=[hs.State("x", 1, "v"), hs.State("v", 0, "-4*x - f")],
        contacts=[hs.Contact("f", velocity=velocity, normal="1", law="coulomb", arguments=law)],
    )
    sol = hs.simulate(block, (0, 4))
    t = np.linspace(0.0, 4.0, 401)
    slip, sticks = sol.output("v_rel(f)", t), np.zeros(len(t), dtype=bool)
    assert slip == pytest.approx(sol.output("v", t) - 0.3 * np.cos(2.0 * t), abs=1e-14)
    for interval in sol.modes["f"]:
        if interval.mode == "stick":
            sticks |= (interval.t0 < t) & (t < interval.t1)
    assert sticks.any() and not sticks.all() and np.abs(slip[sticks]).max() <= 1e-16
    assert sol.output("v_rel(f)").shape == sol.t.shape and sol.output("v_rel(f)", 0.0) == -0.3
    system = hs.two_blocks_on_belt()
    name = f"v_rel({system.contacts[0].name})"
    of_arrays, of_model = (hs.simulate(m, (0, 2), rtol=1e-11) for m in (system, system.to_model()))
    assert of_model.output(name, t[:200]) == pytest.approx(of_arrays.output(name, t[:200]), abs=1e-8)


def test_the_velocity_of_a_contact_without_stick() -> None:
    law = hs.FrictionLaw("rubber", force="0.5*N*tanh(10*v)")
    block = hs.Model(
        "block",
        states=[hs.State("v", 1, "-f")],
        contacts=[hs.Contact("f", velocity="v - w*t + belt", normal="1", law=law)],
        parameters={"w": 0.1},
        definitions={"belt": "0.2*v"},
    )
    sol = hs.simulate(block, (0, 1))
    t = np.linspace(0, 1, 11)
    assert sol.output("v_rel(f)", t) == pytest.approx(1.2 * sol.output("v", t) - 0.1 * t, abs=1e-14)
    assert sol.output("v_rel(f)", 0.0) == 1.2
    with pytest.raises(hs.ExpressionError) as fault:
        hs.Output("slip", "v_rel(f)")
    assert (
        fault.value.remedy
        == "v_rel exists only in results; write the velocity of the contact, or a definition of it"
    )


def test_names_of_scipy() -> None:
    model = hs.Model(
        "cannon",
        states=(hs.State("y", 0, "w"), hs.State("w", 10, "-9.81")),
        monitors=(hs.Monitor("apex", "w", "down"), hs.Monitor("ground", "y", "down", "terminate")),
    )
    sol = hs.simulate(model, (0, 100), rtol=1e-12)
    assert sol.success and sol.nfev > 0
    with pytest.raises(AttributeError, match="no njev, because Jacobians are not counted; `stats` has steps"):
        _ = sol.njev
    apex, ground = sol.t_events
    assert apex == pytest.approx([10 / 9.81], abs=1e-11)
    assert ground == pytest.approx([20 / 9.81], abs=1e-11)
    assert sol.y_events[1][0] == pytest.approx([0, -10], abs=1e-9)
    assert (sol.sol(1.0) == sol(1.0)).all()


def test_repr_says_how_it_went(ball: hs.Solution) -> None:
    text = repr(ball)
    for word in ("bouncing-ball", "finished", "transition", "steps"):
        assert word in text


def test_the_velocity_of_a_contact_without_stick_has_no_derivatives() -> None:
    law = hs.FrictionLaw("rubber", force="0.5*N*tanh(10*v)")
    block = hs.Model("m", [hs.State("v", 1, "-f")], contacts=[hs.Contact("f", "2*v", "1", law)])
    with pytest.raises(UsageError, match=r"v_rel\(f\) has no derivatives") as caught:
        hs.sensitivities(hs.simulate(block, (0, 1))).at(0.5, "v_rel(f)")
    assert caught.value.remedy == "declare an output with the value 2*v"
