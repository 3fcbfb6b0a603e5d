"""Explanations where several things happen at one instant; every figure is worked out by hand."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs

ALL = pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-dop853"])
X = hs.State("x", 0, "v", nominal=1)
FROM_0_TO_MINUS_5 = hs.Input("F", "table", times=[0, 1, 1, 3], values=[0, 0, -5, -5])
PUSH = hs.Schedule("push", times=[1.0], reset={"F": -5})


def rubbing(name: str = "f", velocity: str = "v", normal: float | str = 10) -> hs.Contact:
    return hs.Contact(name, velocity=velocity, normal=normal, law="coulomb", arguments={"mu": 0.3})


def why(sol: hs.Solution, component: str, target: str) -> hs.Explanation:
    (found,) = (e for e in sol.events if (e.component, e.target, e.kind) == (component, target, "transition"))
    return sol.explain(found)


def seen(explanation: hs.Explanation) -> dict[tuple[str, ...], tuple[str, bool]]:
    return {tuple(one.modes.values()): (one.verdict, one.taken) for one in explanation.candidates}


def values(explanation: hs.Explanation) -> dict[tuple[str, str], float]:
    """Of each guard of each candidate the value or rate that decides."""
    views = (view for one in explanation.candidates for view in one.guards)
    return {(view.mode, view.guard): view.derivatives[view.order] for view in views}


NO, TAKEN = ("not admissible", False), ("admissible", True)


def sliding(start: float, by: str) -> hs.Model:
    """dv/dt = F - f with |f| <= 3, where F comes to be -5 at t = 1; from v = 3 it stops at t = 1 as well."""
    states = [X, hs.State("v", start, "-f + F", nominal=1)]
    if by == "schedule":
        return hs.Model(
            "m", states=states, discrete=[hs.Discrete("F", 0)], contacts=[rubbing()], schedules=[PUSH]
        )
    return hs.Model("m", states=states, inputs=[FROM_0_TO_MINUS_5], contacts=[rubbing()])


@ALL
@pytest.mark.parametrize("by", ["schedule", "input"])
@pytest.mark.parametrize("start", [0, 3])
def test_what_is_due_is_judged_with_the_values_after_it(integrator: str, by: str, start: int) -> None:
    sol = hs.simulate(sliding(start, by), (0, 2), integrator=integrator)
    assert sol.modes["f"][-1].mode == "slip-" and sol.modes["f"][-1].t0 == pytest.approx(1.0, rel=1e-14)
    pushed = why(sol, "f", "slip-")
    is_met = by == "input" and start == 3  # a stop at a knot is settled on the piece that begins there
    assert [(view.mode, view.guard) for view in pushed.fired] == [("f slip+", "velocity")] * is_met
    assert [event.source for event in sol.events if event.target == "slip-"] == [
        "slip+" if is_met else "stick"
    ]
    assert seen(pushed) == {("slip+",): NO, ("slip-",): TAKEN, ("stick",): NO}
    assert values(pushed) == pytest.approx(
        {
            ("f slip+", "velocity"): -8.0,
            ("f slip-", "velocity"): 2.0,  # of -v
            ("f stick", "upper"): 3.0 + 5.0,
            ("f stick", "lower"): 3.0 - 5.0,
        }
    )
    due = {
        "schedule": "push was due at this instant and set F from 0 to -5: ",
        "input": "an input has a knot here (F), where F jumps from 0 to -5: ",
    }
    assert pushed.reason == due[by] + "slip- is the only mode that is admissible just after"
    if is_met:
        assert len(sol.events) == 1
        assert pushed.fired[0].derivatives[1] == pytest.approx(-8.0)
    elif start:
        stopped = why(sol, "f", "stick")
        assert [(view.mode, view.guard) for view in stopped.fired] == [("f slip+", "velocity")]
        assert seen(stopped) == {("slip+",): NO, ("slip-",): NO, ("stick",): TAKEN}
        assert values(stopped)["f stick", "lower"] == pytest.approx(3.0)
        assert stopped.reason == "stick is the only mode that is admissible just after"


@ALL
def test_a_load_that_drops_shows_both_limits_after_it(integrator: str) -> None:
    load = hs.Input("L", "table", times=[0, 1, 1, 3], values=[10, 10, 5, 5])
    states = [X, hs.State("v", 0, "2 - f", nominal=1)]
    model = hs.Model("m", states=states, inputs=[load], contacts=[rubbing(normal="L")])
    slips = why(hs.simulate(model, (0, 2), integrator=integrator), "f", "slip+")
    assert seen(slips) == {("slip+",): TAKEN, ("slip-",): NO, ("stick",): NO}
    found = values(slips)
    assert found["f slip+", "velocity"] == pytest.approx(2 - 0.3 * 5)
    assert found["f stick", "upper"] == pytest.approx(0.3 * 5 - 2)
    assert "(L), where L jumps from 10 to 5: slip+ is the only mode" in slips.reason


@ALL
def test_a_plastic_impact_and_a_lift_at_one_instant(integrator: str) -> None:
    model = hs.Model(
        "m",
        states=[hs.State("h", 5, "w", nominal=1), hs.State("w", 0, "-10 + F + p", nominal=1)],
        discrete=[hs.Discrete("F", 0)],
        impacts=[hs.Impact("p", gap="h", restitution=0)],
        schedules=[hs.Schedule("lift", times=[1.0], reset={"F": 20})],
    )
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    closed, open_ = why(sol, "p", "closed"), why(sol, "p", "open")
    assert "an impact with restitution 0, the gap closing at 10 and opening at 0" in closed.reason
    assert closed.reason.endswith("w from -10 to 0; closed just after")
    assert seen(open_) == {("open",): TAKEN, ("closed",): NO}
    assert values(open_) == pytest.approx({("p open", "gap"): 10.0, ("p closed", "force"): -10.0})
    decided = "open is the only mode that is admissible just after"
    # by a rounding the lift comes first, and the impact leads to no rest
    if sol.events[0].kind == "scheduled":
        assert not closed.candidates and open_.reason == decided
        return
    assert seen(closed) == {("open",): NO, ("closed",): TAKEN}
    assert values(closed) == pytest.approx({("p open", "gap"): -10.0, ("p closed", "force"): 10.0})
    assert open_.reason == f"lift was due at this instant and set F from 0 to 20: {decided}"


def switch(guard: str) -> hs.Component:
    off = hs.Mode("off", hs.Guard("on", guard, hs.Choice("on")), set={"B": 0})
    return hs.Component("sw", [off, hs.Mode("on", set={"B": 5})], initial="off")


@ALL
def test_a_stop_and_the_guard_of_an_automaton_at_one_instant(integrator: str) -> None:
    """At t = 1 the switch brings 5 against the motion: it turns round, as if it had never stuck."""
    states = [X, hs.State("v", 3, "-f - B", nominal=1), hs.State("c", 0, "1", nominal=1)]
    model = hs.Model("m", states=states, contacts=[rubbing()], components=[switch("1 - c")])
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    switched, turned = why(sol, "sw", "on"), why(sol, "f", "slip-")
    assert switched.reason == "guard on leads to on" and not switched.candidates
    assert values(turned)["f stick", "lower"] == pytest.approx(-2.0)
    if len(sol.events) == 2:  # not a rounding apart
        assert turned.reason == (
            "guard on of sw led to on: f slip- is the only mode that is admissible just after"
        )


@ALL
def test_a_decision_that_leads_to_another_one_at_its_instant(integrator: str) -> None:
    """The stop takes the friction from 3 to 0, which throws the switch, which sets off the body."""
    states = [X, hs.State("v", 3, "-f - B", nominal=1)]
    model = hs.Model("m", states=states, contacts=[rubbing()], components=[switch("f - 1")])
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    stopped, switched, turned = (sol.explain(k) for k in range(3))
    assert [one.event.target for one in (stopped, switched, turned)] == ["stick", "on", "slip-"]
    assert seen(stopped)["stick",] == TAKEN and seen(turned)["stick",] == NO
    assert values(stopped)["f stick", "lower"] == pytest.approx(3.0)
    assert values(turned)["f stick", "lower"] == pytest.approx(3.0 - 5.0)
    assert stopped.reason == "f stick is the only mode that is admissible just after"
    assert "made the guard negative (it was not at zero before); guard on leads to on" in switched.reason
    assert turned.reason.startswith("guard on of sw led to on: f slip- is the only mode")


@pytest.mark.parametrize("name", ["reset", "impact", "gap"])
def test_a_guard_may_have_the_name_of_what_an_impact_does(name: str) -> None:
    modes = [hs.Mode("off", hs.Guard(name, "0.5 - x", hs.Choice("on"))), hs.Mode("on")]
    component = hs.Component("sw", modes, initial="off")
    sol = hs.simulate(hs.Model("m", states=[hs.State("x", 0, "1")], components=[component]), (0, 1))
    assert sol.explain(0).reason == f"guard {name} leads to on"


def test_a_guard_that_a_schedule_moved() -> None:
    model = hs.Model(
        "m",
        states=[hs.State("x", 0, "1")],
        discrete=[hs.Discrete("F", 0)],
        components=[switch("F + 1")],
        schedules=[PUSH],
    )
    moved = why(hs.simulate(model, (0, 2)), "sw", "on")
    assert not moved.fired and moved.reason == (
        "push was due at this instant and set F from 0 to -5, which made the guard negative (it was not at zero "
        "before); guard on leads to on"
    )


@pytest.mark.parametrize("by", ["schedule", "monitor"])
def test_a_contact_that_is_set_moving_names_what_did_it(by: str) -> None:
    states = [X, hs.State("v", 0, "-f", nominal=1), hs.State("y", 1, "-1")]
    kick = hs.Schedule("kick", times=[1.0], reset={"v": 2})
    low = hs.Monitor("low", "y - 0.5", action="reset", reset={"v": 2})
    given = {"schedules": [kick]} if by == "schedule" else {"monitors": [low]}
    moved = why(
        hs.simulate(hs.Model("m", states=states, contacts=[rubbing()], **given), (0, 2)), "f", "slip+"
    )
    what = "kick was due at this instant" if by == "schedule" else "low crossed zero"
    assert moved.reason == (
        f"{what} and set v from 0 to 2, which gave it a velocity, to the side of slip+, which determines "
        "the mode"
    )


@ALL
def test_a_belt_that_jumps_away_gives_a_contact_its_velocity(integrator: str) -> None:
    belt = hs.Input("b", "table", times=[0, 1, 1, 3], values=[0, 0, 2, 2])
    model = hs.Model(
        "m", states=[hs.State("v", 0, "-f")], inputs=[belt], contacts=[rubbing(velocity="v - b")]
    )
    left = why(hs.simulate(model, (0, 1.5), integrator=integrator), "f", "slip-")
    assert left.reason == (
        "an input has a knot here (b), where b jumps from 0 to 2, which gave it a velocity, to the side "
        "of slip-, "
        "which determines the mode"
    )


@ALL
def test_two_inputs_with_a_knot_at_one_instant_name_the_one_that_jumps(integrator: str) -> None:
    ramp = hs.Input("r", "table", times=[0, 1, 3], values=[0, 0, 2])
    states = [X, hs.State("v", 0, "-f + F + r", nominal=1)]
    model = hs.Model("m", states=states, inputs=[ramp, FROM_0_TO_MINUS_5], contacts=[rubbing()])
    pushed = why(hs.simulate(model, (0, 1.2), integrator=integrator), "f", "slip-")
    assert pushed.reason.startswith("an input has a knot here (r, F), where F jumps from 0 to -5: slip- is")


# -- impacts ------------------------------------------------------------------------------------------------------


def skidding(start: float, restitution: float) -> hs.Model:
    """It falls from 0.2 onto what rubs with 0.3 of the load."""
    return hs.Model(
        "m",
        states=[
            hs.State("x", 0, "u", nominal=1),
            hs.State("u", start, "-f", nominal=1),
            hs.State("h", 0.2, "w", nominal=1),
            hs.State("w", 0, "-9.81 + p", nominal=1),
        ],
        impacts=[hs.Impact("p", gap="h", restitution=restitution)],
        contacts=[rubbing(velocity="u", normal="p")],
    )


FALL = math.sqrt(2 * 9.81 * 0.2)


@ALL
def test_friction_in_a_blow_is_at_its_limit_or_stops_the_body(integrator: str) -> None:
    fast = hs.simulate(skidding(3, 0.3), (0, 0.25), integrator=integrator).explain(0)
    push = 1.3 * FALL
    assert f"u from 3 to {3 - 0.3 * push:.6g}" in fast.reason
    assert (
        f"the impulse of f is at its limit, 0.3*{push:.6g} = {0.3 * push:.6g}; open just after" in fast.reason
    )
    slow = hs.simulate(skidding(0.5, 0), (0, 0.25), integrator=integrator)
    for target, component in (("closed", "p"), ("stick", "f")):
        explained = why(slow, component, target)
        assert seen(explained)["stick", "closed"] == TAKEN
    said = f"the impulse of f, 0.5, stops it within its limit 0.3*{FALL:.6g} = {0.3 * FALL:.6g}; closed"
    assert said in why(slow, "p", "closed").reason
    assert why(slow, "f", "stick").reason == (
        f"after the impact of p (u from 0.5 to 0, w from {-FALL:.6g} to 0): f stick, p closed together: the "
        "only admissible one of all combinations of the coupled components"
    )


def test_of_several_admissible_modes_the_rule_is_given() -> None:
    """Without a load slip+, slip- and stick are one motion."""
    blow = hs.simulate(skidding(0.5, 0.3), (0, 0.25)).explain(0)
    assert seen(blow) == {
        ("slip+", "open"): TAKEN,
        ("slip-", "open"): ("admissible", False),
        ("stick", "open"): ("admissible", False),
    }
    assert blow.reason.endswith(
        "(f slip+, p open) and (f slip-, p open) and (f stick, p open) are admissible, and (f slip+, p open) is "
        "taken: fewer changes of mode are preferred, then holding before slipping; they are the same "
        "motion to rounding"
    )


@ALL
def test_an_impact_that_sets_off_another_contact_is_named(integrator: str) -> None:
    """1 meets 1/2 at 2: with e = 1/2 and the effects 1/2 and 1 the impulse is 3/1.5 = 2."""
    model = hs.Model(
        "m",
        states=[
            X,
            hs.State("v", 0, "p/2 - f", nominal=1),
            hs.State("y", -1, "w", nominal=1),
            hs.State("w", 2, "-p", nominal=1),
        ],
        impacts=[hs.Impact("p", gap="x - y", restitution=0.5)],
        contacts=[rubbing()],
    )
    thrown = why(hs.simulate(model, (0, 0.7), integrator=integrator), "f", "slip+")
    assert thrown.reason == (
        "the impact of p (v from 0 to 1, w from 2 to 0) gave it a velocity, to the side of slip+, which "
        "determines "
        "the mode"
    )


@ALL
def test_an_impact_that_throws_another_contact_open_is_named(integrator: str) -> None:
    """The gap y + h closes at 10 with the effect 2 of its impulse: 15/2 throws h up."""
    model = hs.Model(
        "m",
        states=[
            hs.State("h", 0, "w", nominal=1),
            hs.State("w", 0, "-1 + p + q", nominal=1),
            hs.State("y", 5, "u", nominal=1),
            hs.State("u", 0, "-10 + q", nominal=1),
        ],
        impacts=[hs.Impact("p", gap="h", restitution=0), hs.Impact("q", gap="y + h", restitution=0.5)],
    )
    sol = hs.simulate(model, (0, 1.01), integrator=integrator)
    thrown = why(sol, "p", "open")
    assert thrown.reason == (
        "the impact of q (w from 0 to 7.5, u from -10 to -2.5) made its gap open, which determines the mode"
    )


# -- what rounding leaves open --------------------------------------------------------------------------------------


@ALL
def test_never_the_only_one_where_another_is_open(integrator: str) -> None:
    """At t = 1.5 f breaks away while q is at its limit and stays there: both bodies go on with t - 1.5."""
    states = [X, hs.State("v", 0, "t - f - q", nominal=1), hs.State("w", 0, "t + q", nominal=1)]
    model = hs.Model("m", states=states, contacts=[rubbing(), rubbing("q", "v - w", 5)])
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    assert sol.events[0].t == pytest.approx(1.5)
    released = sol.explain(0)
    if seen(released).get(("slip+", "slip-")) == ("a question of rounding", False):
        assert released.reason == (
            "f slip+, q stick together: taken, because it is certainly admissible; (f slip+, q slip-) is a question of "
            "rounding: the same motion to rounding"
        )
    else:
        assert "only admissible one" not in released.reason


@pytest.mark.parametrize("integrator", ["exact", "dop853"])
def test_a_near_grazing_has_its_numbers(integrator: str) -> None:
    """It rises to 0.2, which is where the gap ends."""
    model = hs.Model(
        "m",
        states=[hs.State("h", 0, "w", nominal=1), hs.State("w", 2, "-10 - p", nominal=1)],
        impacts=[hs.Impact("p", gap="0.20000000000000007 - h", restitution=0.5)],
    )
    sol = hs.simulate(model, (0, 0.4), integrator=integrator)
    near = sol.explain(0)
    assert near.event.kind == "near-grazing" and near.event.t == pytest.approx(0.2)
    (view,) = near.fired
    assert abs(view.derivatives[0]) < 1e-14 and abs(view.derivatives[1]) < 1e-6
    assert view.derivatives[2] == pytest.approx(10.0) and 0.0 < view.bounds[0] < 1e-14
    text = str(near)
    assert "there: h = 0.2, w = " in text and "came near zero:" in text and "g'' = 10" in text
