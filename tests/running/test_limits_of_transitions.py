"""Automata whose transitions accumulate go on in the limit that is declared for them: times by closed forms."""

from __future__ import annotations

import re
from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.events import resolve

ALL = ["exact", "taylor", "dop853", "tsit5", "scipy-rk45"]

TANKS = hs.load("water-tanks").with_(left=0.0)


def ball(limit: str | hs.Choice | None) -> hs.Model:
    """A ball that bounces with e = 1/2, by a guard and a reset."""
    floor = hs.Guard("floor", "h", hs.Choice("flight", reset={"h": 0, "w": "-w/2"}))
    modes = [hs.Mode("flight", [floor], set={"g": 10}), hs.Mode("rest", set={"g": 0})]
    return hs.Model(
        "ball",
        states=[hs.State("h", 1, "w"), hs.State("w", 0, "-g"), hs.State("age", 0, 1)],
        components=[hs.Component("ball", modes, initial="flight", limit=limit)],
    )


@pytest.mark.parametrize("integrator", ALL)
def test_a_ball_comes_to_the_rest_that_is_declared(integrator: str) -> None:
    """Falls of sqrt(1/5), and flights of 1, 1/2, 1/4, ... times that: three in all."""
    sol = hs.simulate(ball(hs.Choice("rest", reset={"h": 0, "w": 0})), (0, 5), integrator=integrator)
    assert sol.status == "finished"
    last = sol.events[-1]
    assert (last.source, last.target, last.guard) == ("flight", "rest", "limit")
    assert last.t == pytest.approx(3 * sqrt(0.2), rel=1e-9)
    assert sol(5.0)[:2].tolist() == [0.0, 0.0]
    assert sol(5.0)[2] == pytest.approx(5.0, abs=1e-9)
    assert sol.modes["ball"][-1].mode == "rest"


def test_without_one_it_ends_there_and_says_what_to_declare() -> None:
    sol = hs.simulate(ball(None), (0, 5), integrator="exact")
    assert sol.status == "accumulation"
    assert "declare the mode after this time" in sol.message


def test_it_is_written_and_read_and_in_the_structure() -> None:
    plain, limited = ball(None), ball(hs.Choice("rest", reset={"h": 0, "w": 0}))
    assert hs.Model.from_toml(limited.to_toml()).components == limited.components
    assert plain.structure() != limited.structure()
    assert ball("rest").components[0].limit == hs.Choice("rest")


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        (hs.Choice("stand"), "unknown mode 'stand'"),
        (hs.Choice("rest", when="h > 0"), "the limit has a condition"),
        (hs.Choice("rest", reset={"z": 1}), "resets 'z', which is not a state"),
    ],
)
def test_faults_of_a_limit_are_named(limit: hs.Choice, words: str) -> None:
    with pytest.raises(hs.ModelError, match=words):
        ball(limit).validate()


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_tanks_and_rocking_blocks_go_on_behind_their_limits(integrator: str) -> None:
    """The tanks are dry at t = 4; the block rests after swings whose lengths are known (its q of each turn)."""
    sol = hs.simulate(TANKS, (0, 5), integrator=integrator)
    assert sol.status == "finished"
    assert sol.events[-1].target == "off"
    assert sol.events[-1].t == pytest.approx(4.0, rel=1e-9)
    block = hs.load("rocking-block").with_(w_rest=0.0, e=0.5)
    p = block.parameter_values()
    sizes = 0.75 * p["e"] ** (2 * np.arange(60))
    limit = (2 * np.arctanh(np.sqrt(sizes)).sum() - np.arctanh(sqrt(0.75))) / p["p"]
    sol = hs.simulate(block, (0, 10), integrator=integrator)
    assert sol.status == "finished"
    assert sol.events[-1].t == pytest.approx(limit, rel=1e-9)
    assert sol(10.0).tolist() == [0.0, 0.0]


def test_the_event_is_explained_by_the_series_before_it() -> None:
    sol = hs.simulate(TANKS, (0, 5), integrator="exact")
    said = str(sol.explain(len(sol.events) - 1))
    assert (
        "each shorter by the factor 0.5; the event times converge to t = 4.0, and mode off begins there"
        in said
    )
    twisting = hs.simulate("twisting-controller", (0, 7), integrator="exact")
    said = str(twisting.explain(len(twisting.events) - 1))
    assert "every 4 of them shorter by the factor" in said
    assert "mode sliding begins there" in said


def test_a_run_that_is_stopped_in_the_series_goes_on_to_the_same_limit() -> None:
    whole = hs.simulate("twisting-controller", (0, 7), integrator="exact")
    part = hs.simulate("twisting-controller", (0, 7), integrator="exact", limits={"steps": 40})
    assert part.status == "limit"
    on = part.resume()
    assert [e.t for e in on.events] == [e.t for e in whole.events]


@pytest.mark.parametrize("integrator", ALL)
def test_what_is_due_at_the_limit_happens(integrator: str) -> None:
    """Tanks that are dry at t = 4 beside a clock that ticks at 1, 2, 3, 4, 5, and a monitor that passes t = 4."""
    watched = replace(
        TANKS,
        states=[*TANKS.states, hs.State("ticks", 0, 0), hs.State("age", 0, 1)],
        schedules=[hs.Schedule("clock", period=1, start=1, reset={"ticks": "ticks + 1"})],
        monitors=[hs.Monitor("four", "age - 4", action="record")],
    )
    sol = hs.simulate(watched, (0, 5.5), integrator=integrator)
    assert [e.t for e in sol.events if e.kind == "scheduled"] == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert sol(5.5)[2] == 5.0
    assert [e.t for e in sol.events if e.kind == "monitor"] == pytest.approx([4.0], abs=1e-9)
    assert sol.events[-1].component == "clock"
    assert [e.t for e in sol.events if e.target == "off"] == pytest.approx([4.0], abs=4e-9)


@pytest.mark.parametrize("integrator", ALL)
def test_a_limit_that_nothing_holds_in_ends_the_run_there(integrator: str) -> None:
    fault = hs.Component(
        "ball",
        [
            hs.Mode("flight", hs.Guard("floor", "h", hs.Choice("flight", reset={"h": 0, "w": "-w/2"}))),
            hs.Mode("rest", hs.Guard("never", "-1 - t", "flight")),
        ],
        initial="flight",
        limit=hs.Choice("rest", reset={"h": 0, "w": 0}),
    )
    back = replace(fault, limit="flight")
    for component, status in ((fault, "cascade"), (back, "accumulation")):
        model = hs.Model(
            "ball", states=[hs.State("h", 1, "w"), hs.State("w", 0, -10)], components=[component]
        )
        sol = hs.simulate(model, (0, 3), integrator=integrator, limits={"events": 1000})
        assert sol.status == status
        assert sol.t_end == pytest.approx(3 * sqrt(0.2), rel=1e-9)


def test_derivatives_are_carried_through_a_reset_at_a_limit() -> None:
    plain = hs.sensitivities(hs.simulate(ball(hs.Choice("rest", reset={"h": 0, "w": 0})), (0, 5)))
    assert plain.by_start[:2, :2] == pytest.approx(np.zeros((2, 2)), abs=1e-9)
    aged = ball(hs.Choice("rest", reset={"h": 0, "w": 0, "age": "2*age"}))
    doubled = hs.sensitivities(hs.simulate(aged, (0, 5)))
    assert doubled.by_start[2, 2] == pytest.approx(
        2.0, abs=1e-9
    )  # the time of the limit does not depend on age


def test_a_cascade_beside_a_body_at_rest_is_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rounds in which automata leave before the contact is decided are rounds of the instant as well."""
    model = hs.Model(
        "to-and-fro",
        states=[hs.State("v", 0, "-f"), hs.State("x", 0, 1)],
        contacts=[hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 1})],
        components=[
            hs.Component(
                "c",
                [
                    hs.Mode("wait", hs.Guard("g", "1 - x", "one")),
                    hs.Mode("one", hs.Guard("h", "-1 - x", "two")),
                    hs.Mode("two", hs.Guard("k", "-1 - x", "one")),
                ],
                initial="wait",
            )
        ],
    )
    rounds = []
    transitions = resolve.EventResolution._transitions
    monkeypatch.setattr(
        resolve.EventResolution, "_transitions", lambda *args: rounds.append(1) or transitions(*args)
    )
    sol = hs.simulate(model, (0, 2))
    assert sol.status == "cascade" and sol.t_end == pytest.approx(1.0)
    said = int(re.search(r"(\d+) rounds \(modes", sol.message)[1])
    assert len(rounds) <= said + 10
