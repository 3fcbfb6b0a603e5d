"""Bounces end where they should, when rounding hides the last of them: limits, momenta and friction in closed form.

A ball dropped from 0.2 onto a floor, at g = 10, falls for 0.2 and rests at 0.2 (1 + e)/(1 - e).
"""

from __future__ import annotations

import pytest

import hybridsim as hs

METHODS = ["exact", "taylor", "dop853", "tsit5", "scipy-dop853"]


def limit(e: float) -> float:
    """When the ball rests."""
    return 0.2 * (1 + e) / (1 - e)


def dropped(floor: str, e: float, start: float, speed: float = 0.0) -> hs.Model:
    """A ball above a floor, by the law of impacts."""
    states = [hs.State("h", start, "w"), hs.State("w", speed, "-10 + p")]
    return hs.Model("ball", states=states, impacts=[hs.Impact("p", gap=f"h - {floor}", restitution=e)])


def closing(sol: hs.Solution, target: str = "closed") -> float:
    """The time of the one event that leads there."""
    assert sol.status == "finished", sol.message
    (time,) = [event.t for event in sol.events if event.target == target]
    return time


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("e", [0.02, 0.3, 0.5, 0.9])
@pytest.mark.parametrize(("floor", "start", "speed"), [("1", 1.2, 0.0), ("100", 100.2, 0.0), ("t", 0.2, 1.0)])
def test_a_floor_need_not_be_at_zero(
    integrator: str, e: float, floor: str, start: float, speed: float
) -> None:
    sol = hs.simulate(dropped(floor, e, start, speed), (0, 2 * limit(e)), integrator=integrator)
    assert closing(sol) == pytest.approx(limit(e), rel=1e-11)


@pytest.mark.parametrize("integrator", ["exact", "dop853"])
def test_a_ball_that_loses_little_rests_as_well(integrator: str) -> None:
    sol = hs.simulate(dropped("1", 0.99, 1.2), (0, 1.1 * limit(0.99)), integrator=integrator)
    assert closing(sol) == pytest.approx(limit(0.99), rel=1e-11)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("e", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("first", ["base", "ball"])
def test_momentum_is_that_of_the_forces(integrator: str, e: float, first: str) -> None:
    """A ball of mass 1 on a free base of mass 3: the weight of the ball is all that acts from outside."""
    base = [hs.State("b", 1, "u"), hs.State("u", 0, "-p/3")]
    ball = [hs.State("h", 1.2, "w"), hs.State("w", 0, "-10 + p")]
    states = base + ball if first == "base" else ball + base
    model = hs.Model("two", states=states, impacts=[hs.Impact("p", gap="h - b", restitution=e)])
    end = 2 * limit(e)
    sol = hs.simulate(model, (0, end), integrator=integrator)
    assert closing(sol) == pytest.approx(limit(e), rel=1e-11)
    last = dict(zip([state.name for state in states], sol(end), strict=True))
    assert 3 * last["u"] + last["w"] == pytest.approx(-10 * end, rel=1e-13)
    assert (3 * last["b"] + last["h"]) / 4 == pytest.approx(1.05 - 10 * end**2 / 8, rel=1e-12)


@pytest.mark.parametrize("integrator", METHODS)
def test_friction_loses_what_the_weight_lets_it(integrator: str) -> None:
    """Through bounces and rest alike: mu g t of the sliding speed in the mean, which is exact once it rests."""
    contact = hs.Contact("f", velocity="v", law="coulomb", arguments={"mu": 0.1}, normal="p")
    model = dropped("1", 0.5, 1.2)
    sliding = [*model.states, hs.State("x", 0, "v"), hs.State("v", 9, "-f")]
    model = hs.Model("slides", states=sliding, contacts=[contact], impacts=model.impacts)
    sol = hs.simulate(model, (0, 1.2), integrator=integrator)
    assert sol(1.2)[3] == pytest.approx(9 - 0.1 * 10 * 1.2, rel=1e-13)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("floor", ["0", "1"])
def test_friction_comes_to_rest_with_the_bounces_that_load_it(integrator: str, floor: str) -> None:
    """A pull of 1 slides the ball in each flight from rest, each impact stops it, the weight holds it in the end."""
    e, fall = 0.5, 0.2
    contact = hs.Contact("f", velocity="v", law="coulomb", arguments={"mu": 0.3}, normal="p")
    ball = dropped(floor, e, 0.2 + float(floor))
    states = [*ball.states, hs.State("x", 0, "v"), hs.State("v", 0, "1 - f")]
    model = hs.Model("pulled", states=states, contacts=[contact], impacts=ball.impacts)
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    assert closing(sol) == pytest.approx(limit(e), rel=1e-11)
    assert sol.modes["f"][-1].mode == "stick"
    assert sol(2.0)[3] == 0.0
    assert sol(2.0)[2] == pytest.approx(fall**2 / 2 * (1 + 4 * e**2 / (1 - e**2)), rel=1e-13)


def by_transitions(e: float, floor: float, name: str = "ball", start: float = 0.2) -> hs.Component:
    """The ball as an automaton, with a limit."""
    back = {f"h_{name}": floor, f"w_{name}": f"-{e}*w_{name}"}
    stop = hs.Choice("rest", reset={f"h_{name}": floor, f"w_{name}": 0})
    guard = hs.Guard("floor", f"h_{name} - {floor}", hs.Choice("flight", reset=back))
    modes = [hs.Mode("flight", guard, set={f"g_{name}": 10}), hs.Mode("rest", set={f"g_{name}": 0})]
    return hs.Component(name, modes, initial="flight", limit=stop)


def falling(components: dict[hs.Component, float]) -> hs.Model:
    """Balls by transitions, from these heights."""
    states = []
    for component, height in components.items():
        name = component.name
        states += [hs.State(f"h_{name}", height, f"w_{name}"), hs.State(f"w_{name}", 0, f"-g_{name}")]
    return hs.Model("balls", states=states, components=list(components))


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize(("e", "floor"), [(0.01, 1), (0.3, 1), (0.3, 100), (0.5, 100), (0.8, 100), (0.95, 1)])
def test_resets_on_a_floor_that_is_not_at_zero_end(integrator: str, e: float, floor: int) -> None:
    sol = hs.simulate(
        falling({by_transitions(e, floor): floor + 0.2}), (0, 2 * limit(e)), integrator=integrator
    )
    assert closing(sol, "rest") == pytest.approx(limit(e), rel=1e-9)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("pair", [(0.5, 0.5), (0.5, 0.25), (0.5, 0.7), (0.6, 0.9)])
def test_series_that_end_at_one_instant(integrator: str, pair: tuple[float, float]) -> None:
    """From heights of 5 (L (1 - e)/(1 + e))**2 both rest at L."""
    end = 0.6
    heights = {
        by_transitions(e, 0, name): 5 * (end * (1 - e) / (1 + e)) ** 2
        for e, name in zip(pair, ("a", "b"), strict=True)
    }
    sol = hs.simulate(falling(heights), (0, 2), integrator=integrator)
    assert sol.status == "finished", sol.message
    times = {event.component: event.t for event in sol.events if event.target == "rest"}
    assert times == {"a": pytest.approx(end, rel=1e-11), "b": pytest.approx(end, rel=1e-11)}


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_two_balls_have_a_limit_each(integrator: str) -> None:
    states = [hs.State("a", 1.2, "u"), hs.State("u", 0, "-10 + p")]
    states += [hs.State("b", 1.2, "w"), hs.State("w", 0, "-10 + q")]
    impacts = [hs.Impact("p", gap="a - 1", restitution=0.5), hs.Impact("q", gap="b - 1", restitution=0.8)]
    sol = hs.simulate(hs.Model("two", states=states, impacts=impacts), (0, 3), integrator=integrator)
    times = {event.component: event.t for event in sol.events if event.target == "closed"}
    assert times == {"p": pytest.approx(limit(0.5), rel=1e-11), "q": pytest.approx(limit(0.8), rel=1e-11)}


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize("before", [1e-9, 1e-8, 1e-7])
def test_what_happens_among_the_hidden_bounces_is_not_missed(integrator: str, before: float) -> None:
    due = limit(0.9) - before
    relay = hs.Component(
        "relay", [hs.Mode("off", hs.Guard("due", f"{due!r} - y", "on")), hs.Mode("on")], initial="off"
    )
    ball = dropped("1", 0.9, 1.2)
    model = hs.Model(
        "both", states=[*ball.states, hs.State("y", 0, 1)], components=[relay], impacts=ball.impacts
    )
    assert closing(hs.simulate(model, (0, 8), integrator=integrator), "on") == pytest.approx(due, rel=1e-14)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
@pytest.mark.parametrize(("floor", "before"), [("1", 1e-7), ("10000", 1e-5), ("1000000", 2e-4)])
def test_a_body_that_turns_among_the_hidden_bounces_turns_when_it_does(
    integrator: str, floor: str, before: float
) -> None:
    """Beside the ball a body slides with -5 - 1 until it turns, then with -5 + 1."""
    turn = limit(0.9) - before
    ball = dropped(floor, 0.9, float(floor) + 0.2)
    contact = hs.Contact("f", velocity="v", law="coulomb", arguments={"mu": 0.1}, normal="10")
    states = [*ball.states, hs.State("v", 6 * turn, "-5 - f")]
    model = hs.Model("both", states=states, contacts=[contact], impacts=ball.impacts)
    sol = hs.simulate(model, (0, 4), integrator=integrator)
    assert closing(sol, "slip-") == pytest.approx(turn, rel=1e-12)
    assert sol(4.0)[2] == pytest.approx(-4 * (4 - turn), rel=1e-11)


@pytest.mark.parametrize("integrator", ["taylor", "dop853"])
def test_a_short_dip_among_the_hidden_bounces_is_not_missed(integrator: str) -> None:
    due = limit(0.9) - 1e-4
    guard = hs.Guard("due", f"((y - {due!r})/1e-5)**2 - 1", "on")
    relay = hs.Component("relay", [hs.Mode("off", guard), hs.Mode("on")], initial="off")
    ball = dropped("1000000", 0.9, 1000000.2)
    model = hs.Model(
        "both", states=[*ball.states, hs.State("y", 0, 1)], components=[relay], impacts=ball.impacts
    )
    sol = hs.simulate(model, (0, 4), integrator=integrator)
    assert closing(sol, "on") == pytest.approx(due - 1e-5, rel=1e-12)


@pytest.mark.parametrize("integrator", ["exact", "taylor"])
def test_a_fast_oscillator_beside_hidden_bounces_keeps_its_size(integrator: str) -> None:
    ball = dropped("1", 0.9, 1 + 2e-5)
    states = [*ball.states, hs.State("x", 1, "1e6*y"), hs.State("y", 0, "-1e6*x")]
    model = hs.Model("both", states=states, impacts=ball.impacts)
    sol = hs.simulate(model, (0, 0.0399), integrator=integrator, rtol=1e-12, keep="events")
    assert sol.events[-1].target == "closed"
    x, y = sol.y[2:, -1]
    assert x**2 + y**2 == pytest.approx(1, abs=1e-9)


def test_without_a_limit_the_run_ends_there() -> None:
    model = falling({by_transitions(0.5, 100): 100.2})
    component = model.components[0]
    endless = hs.Component(component.name, component.modes, initial="flight")
    sol = hs.simulate(hs.Model("ball", states=model.states, components=[endless]), (0, 5))
    assert sol.status == "accumulation"
    assert "events of ball accumulate" in sol.message
    assert sol.t_end == pytest.approx(limit(0.5), abs=1e-6)


@pytest.mark.parametrize("integrator", METHODS)
@pytest.mark.parametrize("save", ["nothing", "events", 0.01])
def test_what_is_kept_does_not_change_where_they_end(integrator: str, save: str | float) -> None:
    """A clock that runs in flight alone stops at the limit."""
    ball = by_transitions(0.5, 100)
    falls = falling({ball: 100.2})
    model = hs.Model("clock", states=[*falls.states, hs.State("c", 0, "g_ball/10")], components=[ball])
    kept = hs.simulate(model, (0, 2), integrator=integrator, keep=save)
    assert kept.y[2, -1] == pytest.approx(limit(0.5), rel=1e-11)
    assert (kept.y[:, -1] == hs.simulate(model, (0, 2), integrator=integrator).y[:, -1]).all()


@pytest.mark.parametrize("integrator", ["exact", "scipy-dop853"])
def test_a_series_that_breaks_off_leaves_no_trace(integrator: str) -> None:
    """Five transitions at ever shorter intervals, none after: a restart at each, and one where the sixth would be."""
    zeros = "(t - 1)*(t - 1.5)*(t - 1.75)*(t - 1.875)*(t - 1.9375)"
    one = hs.Mode("one", hs.Guard("down", f"-({zeros})", "two"), set={"k": 1})
    two = hs.Mode("two", hs.Guard("up", zeros, "one"), set={"k": 1})
    states = [hs.State("x", 0, "v"), hs.State("v", 1, "-k*x")]
    switch = hs.Component("switch", [one, two], initial="one")
    model = hs.Model("breaks", states=states, components=[switch], monitors=[hs.Monitor("far", "x - 2")])
    sol = hs.simulate(model, (0, 1000), integrator=integrator)
    assert [event.t for event in sol.events] == pytest.approx([1, 1.5, 1.75, 1.875, 1.9375])
    assert sol.stats["restarts"] <= 1 + 5 + 1


def test_a_series_that_breaks_off_leaves_no_trace_backward_in_time() -> None:
    """Two relays, crossed ever faster into the past, until an input of 50 ends that: few restarts beside the events."""
    states = [hs.State("x", 1, "v"), hs.State("v", 0, "-2*u + w + F")]
    relays = [hs.SwitchingSurface("u", "x"), hs.SwitchingSurface("w", "v")]

    def run(rises: float) -> hs.Solution:
        push = hs.Input(
            "F", "table", times=[-1e6, rises - 1e-8, rises, 1], values=[50, 50, 0, 0], interpolation="linear"
        )
        model = hs.Model("relays", states=states, surfaces=relays, inputs=[push])
        return hs.simulate(model, (0, -20), integrator="dop853")

    series = run(-1000.0).events
    times = [event.t for event in series[34:37]]
    sol = run(0.3 * times[1] + 0.7 * times[2])
    assert (sol.status, sol.t_end) == ("finished", -20.0)
    assert 30 < len(sol.events) < 45
    assert sol.stats["restarts"] <= len(sol.events) + 8


@pytest.mark.parametrize(
    ("integrator", "restitution"), [("cvode-bdf", 0.46), ("cvode-adams", 0.6), ("scipy-bdf", 0.6)]
)
def test_bounces_that_accumulate_are_not_reported_as_near_grazings_as_well(
    integrator: str, restitution: float
):
    states = [hs.State("h", 0.64, "w"), hs.State("w", 0.1, "b - 4")]
    floor = hs.Input("floor", "table", times=[-1.0, 0.9, 6.0], values=[0.0, 0.1, -0.2])
    ball = hs.Model(
        "ball",
        states=states,
        inputs=[floor],
        impacts=[hs.Impact("b", gap="h - floor", restitution=restitution)],
    )
    sol = hs.simulate(ball, (0, 5), integrator=integrator)
    assert sol.status == "finished"
    assert any("accumulation" in text for text in sol.warnings)
    assert {event.kind for event in sol.events} == {"transition"}
