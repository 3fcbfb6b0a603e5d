"""Explanations of events name what decided them; their figures are those of closed forms."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs
from hybridsim.cli import main
from hybridsim.model.checks.units import rate_of


def verdicts(explanation: hs.Explanation) -> dict[tuple[str, ...], str]:
    return {tuple(candidate.modes.values()): candidate.verdict for candidate in explanation.candidates}


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "scipy-dop853"])
def test_a_release_at_equal_coefficients_is_decided_by_the_second_derivative(integrator: str) -> None:
    model = hs.load("dfcs")
    sol = hs.simulate(model, (0.0, 0.01), integrator=integrator)
    why = sol.explain(0)
    p = model.parameter_values()
    t = math.asin(p["mu"] * p["N"] / p["F0"]) / p["omega"]  # the forcing reaches the limit at x = 0
    assert sol.events[0].t == pytest.approx(t, rel=1e-12)
    jerk = p["F0"] * p["omega"] * math.cos(p["omega"] * t) / p["m"]  # of the released body
    assert [(view.mode, view.guard) for view in why.fired] == [("f stick", "upper")]
    assert why.fired[0].derivatives[1] == pytest.approx(-p["m"] * jerk, rel=1e-9)
    assert verdicts(why) == {
        ("slip+",): "admissible",
        ("slip-",): "not admissible",
        ("stick",): "not admissible",
    }
    released = next(c for c in why.candidates if c.modes == {"f": "slip+"}).guards[0]
    assert (released.decreed, released.order, released.side) == (2, 2, 1)
    assert released.derivatives[2] == pytest.approx(jerk, rel=1e-9)
    assert why.reason == "slip+ is the only mode that is admissible just after"
    assert "g = 0 exactly, g' = 0 exactly, g'' =" in str(why)


def test_a_release_with_a_drop_of_friction_is_decided_by_the_first() -> None:
    why = hs.simulate("static-kinetic", (0.0, 10.0)).explain(0)
    released = next(c for c in why.candidates if c.modes == {"f": "slip+"}).guards[0]
    assert (released.decreed, released.order) == (1, 1)


def test_a_reset_says_what_it_set() -> None:
    sol = hs.simulate("bouncing-ball", (0.0, 1.0))
    why = sol.explain(0)
    v = math.sqrt(2 * 9.81)
    assert why.fired[0].derivatives[1] == pytest.approx(-v) and why.fired[0].derivatives[2] == pytest.approx(
        -9.81
    )
    assert "leads to flight, with" in why.reason and f"to {0.7 * v:.6g}" in why.reason


def test_sliding_is_entered_where_both_sides_lead_to_the_surface() -> None:
    why = hs.simulate("relay-control", (0.0, 3.0)).explain(0)
    assert verdicts(why) == {
        ("above",): "not admissible",
        ("below",): "not admissible",
        ("sliding",): "admissible",
    }
    sides = {c.modes["u"]: c.guards[0] for c in why.candidates}
    # d(lambda x + v)/dt = lambda v + (d sin(omega t) - U u)/m on either side
    sol = hs.simulate("relay-control", (0.0, 3.0))
    t, (_, v) = sol.events[0].t, sol.events[0].x_minus
    rates = {s: v + 0.8 * math.sin(7 * t) - 2 * s for s in (1, -1)}
    assert sides["above"].derivatives[1] == pytest.approx(rates[1], rel=1e-9)
    assert sides["below"].derivatives[1] == pytest.approx(-rates[-1], rel=1e-9)
    assert "attraction of u" in str(why)


def test_coupled_contacts_are_explained_together() -> None:
    model = hs.load("clutches")
    sol = hs.simulate(model, (0.0, 10.0))
    for k, event in enumerate(sol.events):
        why = sol.explain(k)
        if event.kind == "transition" and why.candidates:
            taken = [c for c in why.candidates if c.verdict == "admissible"]
            assert any(c.modes.get(event.component) == event.target for c in taken), str(why)


def test_other_kinds_of_events() -> None:
    sol = hs.simulate("sampled-servo", (0.0, 0.05))
    kinds = {event.kind for event in sol.events}
    assert "scheduled" in kinds
    for k, event in enumerate(sol.events):
        if event.kind == "scheduled":
            assert "a step ended exactly there" in sol.explain(k).reason
    own = hs.simulate("dfcs", (0.0, 0.01), integrator="rk4-dichotomy").explain(0)
    assert "by its own rule" in own.reason and not own.candidates


def test_what_cannot_be_explained() -> None:
    sol = hs.simulate("dfcs", (0.0, 0.01))
    for number in (99, -99, 0.5, True):
        with pytest.raises(hs.UsageError, match="there is no event"):
            sol.explain(number)
    with pytest.raises(hs.UsageError, match="keep='events'"):
        hs.simulate("dfcs", (0.0, 0.01), keep="events").explain(0)


def test_the_command_line_explains(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "dfcs", "--t-end", "0.01", "--explain", "0", "--explain", "-1"]) == 0
    text = capsys.readouterr().out
    assert text.count("modes that could hold just after") == 2 and "is the only mode" in text
    assert main(["run", "dfcs", "--t-end", "0.01", "--explain", "99"]) == 2


def test_numbers_have_their_units_and_the_mode_that_was_taken_is_marked() -> None:
    text = str(hs.simulate("dfcs", (0.0, 0.02)).explain(1))
    assert "just before: x = 0.000146575 m, v = " in text and " m/s\n" in text
    assert "f slip-: not admissible" in text and "f stick: admissible, and taken" in text
    assert "g' = -83.6 m/s^2" in text and "g = 16.7 N" in text
    assert "so: stick is the only mode" in text and "a mode holds while its guards g are >= 0" in text


@pytest.mark.parametrize(
    ("unit", "time", "order", "rate"),
    [
        ("m", "s", 0, "m"),
        ("m", "s", 1, "m/s"),
        ("m/s", "s", 1, "m/s^2"),
        ("m/s^2", "s", 2, "m/s^4"),
        ("N", "s", 2, "N/s^2"),
        ("N/m", "s", 1, "N/m/s"),
        ("", "s", 1, ""),
        ("K", "", 1, "K"),
    ],
)
def test_units_of_rates(unit: str, time: str, order: int, rate: str) -> None:
    assert rate_of(unit, time, order) == rate


def test_a_choice_shows_its_conditions_with_what_they_read() -> None:
    sol = hs.simulate("bouncing-ball", (0.0, 5.0))
    up, down = sol.explain(0), sol.explain(len(sol.events) - 1)
    v = math.sqrt(2 * 9.81)
    (first, second) = up.choices
    assert (
        first
        == f"when -e*w >= v_rest (e = 0.7, v_rest = 0.1 m/s, w = {-v:.6g} m/s): holds, and is taken -> flight"
    )
    assert second == "in all other cases: is not reached -> rest"
    assert "does not hold -> flight" in down.choices[0] and "and is taken -> rest" in down.choices[1]


def test_joint_decisions_and_schedules_are_named() -> None:
    sol = hs.simulate("clutches", (0.0, 10.0))
    texts = [str(sol.explain(k)) for k, event in enumerate(sol.events) if event.kind == "transition"]
    assert any("so: c1 stick, c2 stick, c3 slip+ together" in text for text in texts)
    assert not any("is undecided" in text for text in texts)  # the load of a clutch that is not engaged is 0
    assert not any("changed the mode by its own rule" in text for text in texts)
    assert "the rates at which both sides approach the surface" in str(
        hs.simulate("relay-pair", (0.0, 1.0)).explain(0)
    )


FALLING = """
name = "falling"
[parameters]
e = { value = 0.5 }
[states]
h = { start = 1, der = "w", unit = "m" }
w = { start = 0, der = "-9.81 + p", unit = "m/s" }
x = { start = 0, der = "v" }
v = { start = 0, der = "0.1*sin(t) - x - f" }
y = { start = 0, der = "u" }
u = { start = 1, der = "-g" }
[impacts.p]
gap = "h"
restitution = "e"
[contacts.f]
velocity = "v"
normal = 1
law = { name = "coulomb", mu = 0.3 }
[contacts.g]
velocity = "u"
normal = "p"
law = { name = "coulomb", mu = 0.3 }
"""


def test_an_impact_names_its_restitution_and_both_speeds() -> None:
    model = hs.Model.from_toml(FALLING)
    sol = hs.simulate(model, (0.0, 0.6), integrator="scipy-dop853")
    reason = sol.explain(0).reason
    speed = (2 * 9.81) ** 0.5
    assert (
        f"restitution e = 0.5, the gap closing at {speed:.6g} m/s and opening at {speed / 2:.6g} m/s"
        in reason
    )
    assert f"w from {-speed:.6g} to {speed / 2:.6g}" in reason
    assert "h from" not in reason  # what rounding left of the gap is no change


def test_a_restitution_of_the_speed_has_its_value_at_this_speed() -> None:
    model = hs.Model.from_toml(FALLING.replace('restitution = "e"', 'restitution = "e/(1 + speed)"'))
    sol = hs.simulate(model, (0.0, 0.6), integrator="scipy-dop853")
    value = 0.5 / (1.0 + (2 * 9.81) ** 0.5)
    assert f"restitution e/(1 + speed) = {value:.6g}," in sol.explain(0).reason


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_an_impact_lists_what_it_touches_alone(e: float) -> None:
    sol = hs.simulate(hs.Model.from_toml(FALLING), (0.0, 0.6), params={"e": e}, integrator="scipy-dop853")
    why = sol.explain(next(event for event in sol.events if event.component == "p"))
    assert why.candidates and all("f" not in candidate.modes for candidate in why.candidates)


def test_a_reset_says_its_formula() -> None:
    sol = hs.simulate("impact-oscillator", (0.0, 5.0), integrator="scipy-dop853")
    assert "(= -e*v)" in sol.explain(0).reason


STACK = """
name = "stack"
[states]
u = { start = 0, der = "5*t - f" }
w = { start = 0, der = "f - h" }
[contacts.f]
velocity = "u - w"
normal = 1
law = { name = "coulomb", mu = 0.5 }
[contacts.h]
velocity = "w"
normal = 1
law = { name = "coulomb", mu = 0.5 }
"""


@pytest.mark.parametrize("integrator", ["auto", "dop853", "taylor", "scipy-dop853"])
def test_a_limit_that_is_met_and_kept_is_no_question_of_rounding(integrator: str) -> None:
    """Both forces are 5 t until t = 0.1; then f = 0.5 = h for ever, at the limit of h identically: nothing is open."""
    sol = hs.simulate(hs.Model.from_toml(STACK), (0, 0.5), integrator=integrator)
    why = sol.explain(0)
    assert sol.warnings == () and [view.mode for view in why.fired] == ["f stick", "h stick"]
    (taken,) = (one for one in why.candidates if one.taken)
    assert (taken.modes, taken.verdict) == ({"f": "slip+", "h": "stick"}, "admissible")
    (at_limit,) = (view for view in taken.guards if view.mode == "h stick" and view.guard == "upper")
    assert "stays >= 0: g = 0 exactly and does not change" in str(at_limit)
    assert why.reason.startswith(
        "(f slip+, h slip+) and (f slip+, h stick) are admissible, and (f slip+, h stick) is"
    )


@pytest.mark.parametrize(("normal", "unit"), [("9.81*m", ""), ("W", ""), ("N", " N"), ("-1*-N", " N")])
def test_a_load_with_a_bare_number_gives_a_force_no_unit(normal: str, unit: str) -> None:
    """9.81*m in kg is no load in kg: what the number stands for is not said."""
    model = hs.Model(
        "block",
        parameters=[hs.Parameter("m", 2, "kg"), hs.Parameter("N", 19.62, "N")],
        states=[hs.State("v", 1, "-f/m", unit="m/s")],
        definitions={"W": "m*9.81"},
        contacts=[hs.Contact("f", "v", normal=normal, law="coulomb", arguments={"mu": 0.5})],
    )
    text = str(hs.simulate(model, (0, 1)).explain(0))
    assert f"g = 9.81{unit}\n" in text and "kg" not in text


def test_with_two_contacts_it_is_said_whose_mode_it_is() -> None:
    """Two bodies that do not touch; the first breaks away."""
    model = hs.Model.from_toml(STACK.replace('"f - h"', '"t - h"').replace('"u - w"', '"u"'))
    assert (
        hs.simulate(model, (0, 0.3)).explain(0).reason
        == "f slip+ is the only mode that is admissible just after"
    )


@pytest.mark.parametrize("integrator", ["exact", "scipy-dop853"])
@pytest.mark.parametrize("target", ["0.25", "-5"])
def test_a_guard_that_a_reset_moved_is_not_told_as_located(integrator: str, target: str) -> None:
    first = hs.Guard("g", "x - 0.5", hs.Choice("q", reset={"y": target}))
    second = hs.Guard("h", "y - 0.25", hs.Choice("s", reset={"x": "3"}))
    model = hs.Model(
        "chain",
        states=[hs.State("x", 1, "-1"), hs.State("y", 9, "-1")],
        components=[
            hs.Component("a", [hs.Mode("p", first), hs.Mode("q")], initial="p"),
            hs.Component("b", [hs.Mode("r", second), hs.Mode("s")], initial="r"),
        ],
    )
    sol = hs.simulate(model, (0, 2), integrator=integrator)
    moving, moved = sol.explain(0), sol.explain(1)
    for why in (moving, moved):
        (view,) = why.fired
        assert (view.mode, view.guard) == ("a p", "g") and view.bounds[0] < 1e-14
    assert moving.reason == f"guard g leads to q, with y from 8.5 to {target}"
    assert moved.reason == (
        f"the reset of guard g of a (y from 8.5 to {target}) made the guard negative (it was not at zero before); "
        "guard h leads to s, with x from 0.5 to 3"
    )


def test_a_contact_that_a_reset_sets_moving_is_no_question_of_rounding() -> None:
    guard = hs.Guard("g", "y - 0.5", hs.Choice("q", reset={"v": 2}))
    model = hs.Model(
        "kick",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "-f"), hs.State("y", 1, "-1")],
        contacts=[hs.Contact("f", velocity="v", normal=1, law="coulomb", arguments={"mu": 1})],
        components=[hs.Component("a", [hs.Mode("p", guard), hs.Mode("q")], initial="p")],
    )
    why = hs.simulate(model, (0, 1)).explain(1)
    assert (why.event.component, why.event.target) == ("f", "slip+")
    assert why.reason == (
        "the reset of guard g of a (v from 0 to 2) gave it a velocity, to the side of slip+, which "
        "determines the mode"
    )


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_a_stop_after_the_smallest_slip_is_one_that_was_located(integrator: str) -> None:
    """The force exceeds the limit by 1e-6 for 0.0019 s: the speeds are as small as rounding elsewhere."""
    model = hs.Model(
        "creeper",
        states=[hs.State("x", 0, "v"), hs.State("v", 0, "(5.000001*sin(t) - f)/2")],
        contacts=[hs.Contact("f", velocity="v", normal=10, law="coulomb", arguments={"mu": 0.5})],
    )
    stop = hs.simulate(model, (0.0, 3.0), integrator=integrator).explain(1)
    (fired,) = stop.fired
    # the release is where sin(t) = 5/5.000001, and the stop where the impulse above the limit is used up
    assert (fired.mode, fired.guard, fired.side) == ("f slip+", "velocity", -1)
    assert fired.derivatives[1] == pytest.approx(-1.5e-6, rel=1e-2)
    assert stop.reason == "stick is the only mode that is admissible just after"


def test_a_jump_of_an_input_past_a_guard_is_no_zero_of_it() -> None:
    step = hs.Input("u", "table", times=[0, 1, 1, 3], values=[0, 0, 5, 5])
    automaton = hs.Component("c", [hs.Mode("p", hs.Guard("g", "2 - u", "q")), hs.Mode("q")], initial="p")
    model = hs.Model("jump", states=[hs.State("x", 0, "1")], inputs=[step], components=[automaton])
    why = hs.simulate(model, (0, 2)).explain(0)
    assert not why.fired and "an input has a knot here (u)" in why.reason


def test_a_corner_in_a_load_is_shown_as_what_it_is_on_its_side() -> None:
    model = hs.Model(
        "loaded",
        states=[hs.State("x", 0, "v", nominal=1), hs.State("v", 0, "-x - f", nominal=1)],
        contacts=[hs.Contact("f", "v - 0.3", "10 + abs(x)", "static-kinetic", {"mu_s": 0.5, "mu_k": 0.2})],
    )
    sol = hs.simulate(model, (0, 40))
    released = next(k for k, event in enumerate(sol.events) if event.source == "stick")
    text = str(sol.explain(released))
    assert "10 + x" in text
    assert "__" not in text


def test_a_schedule_and_a_monitor_say_what_they_set() -> None:
    text = (
        'schema = 1\nname = "s"\n[states]\nx = { start = 0, der = "1" }\n[discrete]\nF = 0\n'
        '[schedules.kick]\ntimes = [0.3]\nreset = { F = "0.5 + x" }\n'
        '[monitors.m]\nexpr = "x - 0.6"\naction = "reset"\nreset = { F = "0" }\n'
    )
    sol = hs.simulate(hs.Model.from_toml(text), (0, 1))
    assert "it sets F = 0.5 + x" in str(sol.explain(0))
    assert "it sets F = 0" in str(sol.explain(1))


def test_a_cascade_at_the_start_of_a_run_is_explained() -> None:
    """Both guards are -1 - x at x = 0: each mode is left as it begins."""
    model = hs.Model(
        "to-and-fro",
        states=[hs.State("x", 0, "1")],
        components=[
            hs.Component(
                "c",
                [
                    hs.Mode("one", hs.Guard("g", "-1 - x", "two")),
                    hs.Mode("two", hs.Guard("h", "-1 - x", "one")),
                ],
                initial="one",
            )
        ],
    )
    sol = hs.simulate(model, (0, 1))
    assert sol.status == "cascade" and len(sol.events) > 2
    for number in (0, 1, -1):
        event = sol.events[number]
        assert f"transition c {event.source} -> {event.target} at t = 0" in str(sol.explain(number))
