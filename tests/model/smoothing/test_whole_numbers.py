"""Floor, mod and round in models: closed forms, starts at jumps, refusals, and names that models may use."""

from __future__ import annotations

import math

import pytest

import hybridsim as hs
from hybridsim.errors import HybridsimError, ModelError, UsageError
from hybridsim.expr import evaluate, parse


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("floor(-0.5)", -1.0),
        ("floor(2)", 2.0),
        ("round(2.5)", 3.0),
        ("round(-2.5)", -2.0),
        ("round(0.49999999999999994)", 0.0),  # x + 1/2 is 1 in doubles
        ("mod(7, 3)", 1.0),
        ("mod(-7, 3)", 2.0),
        ("mod(7, -3)", -2.0),
    ],
)
def test_values_of_numbers(text: str, value: float) -> None:
    assert evaluate(parse(text), {}) == value
    model = hs.Model("m", states=[hs.State("x", 0, text)])
    assert hs.simulate(model, (0, 1)).y[0, -1] == pytest.approx(value)


def test_a_parameter_may_be_computed_by_them() -> None:
    model = hs.Model("m", parameters={"p": "mod(7.5, 2)"}, states=[hs.State("x", "floor(p)", 0)])
    assert model.parameter_values() == {"p": 1.5}
    assert hs.simulate(model, (0, 1)).y[0, 0] == 1.0


def test_their_names_may_be_names_of_a_model() -> None:
    """Also inside a part, where the names of quantities get a prefix and those of functions do not."""
    part = hs.Model("part", parameters={"floor": 2}, states=[hs.State("mod", 0.5, "floor*floor(mod)")])
    sol = hs.simulate(
        hs.Model("whole", use=[hs.Use("a", part), hs.Use("b", part, start={"mod": 1.5})]), (0, 1)
    )
    # from 1.5 to 2, and on to 3, 4, 5, 6 and 7 at the rates 2, 4, 6, 8, 10 and 12, and then at 14
    end = 7 + 14 * (1 - (1 / 4 + 1 / 4 + 1 / 6 + 1 / 8 + 1 / 10 + 1 / 12))
    assert sol.y[:, -1] == pytest.approx([0.5, end])
    assert hs.Model.from_toml(part.to_toml()) == part


@pytest.mark.parametrize("rate", [1, -1, 0])
@pytest.mark.parametrize(("start", "step", "whole"), [(2, 1, 2), (0.3, 0.1, 3), (-7, 1, -7), (1e6, 1, 1e6)])
def test_a_start_at_a_jump_belongs_to_the_side_that_the_motion_enters(
    rate: int, start: float, step: float, whole: float
) -> None:
    """Although 0.3/0.1 is below 3 in doubles."""
    states = [hs.State("x", start, rate), hs.State("y", 0, f"floor(x/{step})")]
    model = hs.Model("m", states=states, outputs={"whole": f"floor(x/{step})"})
    sol = hs.simulate(model, (0, 0.05))
    side = whole if rate >= 0 else whole - 1
    assert sol.y[1, -1] == pytest.approx(0.05 * side)
    assert sol.output("whole", 0.0) == side


def test_a_number_does_not_depend_on_the_number_before() -> None:
    """At x = 1 the motion rests with floor(x) = 1, although it would fall with floor(x) = 0."""
    resting = hs.Model("m", states=[hs.State("x", 1, "floor(x) - 1")])
    assert hs.simulate(resting, (0, 1)).y[0, -1] == 1.0
    from_below = hs.Schedule("up", times=[0.25], reset={"x": 1})
    assert hs.simulate(resting.with_start(x=0.5), (0, 0.25)).y[0, -1] == pytest.approx(0.25)
    moved = hs.Model("m", states=[hs.State("x", 0.5, "floor(x) - 1")], schedules=[from_below])
    assert hs.simulate(moved, (0, 2)).y[0, -1] == 1.0


def test_a_motion_that_can_begin_on_both_sides_is_not_unique() -> None:
    sol = hs.simulate(hs.Model("m", states=[hs.State("x", 1, "floor(x) - 0.5")]), (0, 1))
    assert sol.status == "nonunique"
    assert "floor(x) = 1, rising, and with 0, falling" in sol.message


def test_a_motion_that_would_slide_along_a_jump_ends_with_a_remedy() -> None:
    sol = hs.simulate(hs.Model("m", states=[hs.State("x", 0.5, "0.5 - floor(x)")]), (0, 3))
    assert sol.status == "cascade"
    assert sol.t_end == pytest.approx(1.0)
    assert "would slide along it" in sol.message
    assert "sign(...)" in sol.message


@pytest.mark.parametrize(
    ("integrator", "options"), [("dop853", {}), ("exact", {}), ("rk4-dichotomy", {"step": 0.01})]
)
def test_a_motion_falls_to_a_jump_and_rests(integrator: str, options: dict[str, float]) -> None:
    """A controller with steps of 1/2: the last step ends at x = 1/4, where round(x/q) becomes 0."""
    states, outputs = [hs.State("x", 0.6, "-q*round(x/q)")], {"n": "round(x/q)"}
    model = hs.Model("m", states=states, parameters={"q": 0.5}, outputs=outputs)
    sol = hs.simulate(model, (0, 2), integrator=integrator, **options)
    assert sol.status == "finished"
    assert sol.y[0, -1] == pytest.approx(0.25, abs=1e-6)
    assert sol.output("n", 2.0) == 0.0


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p", "cvode-bdf"])
def test_a_body_that_stops_at_a_whole_value_has_this_number(integrator: str) -> None:
    """A block stops at t = 2 and a ball that does not bounce lands at t = 1; then floor(0) is 0, and mod(0, 1) is 0."""
    contact = hs.Contact("f", "v", "1", "coulomb", arguments={"mu": 1})
    states = [hs.State("v", 2, "-f"), hs.State("y", 0, "floor(v)"), hs.State("z", 0, "mod(v, 1)")]
    sol = hs.simulate(hs.Model("m", states=states, contacts=[contact]), (0, 4), integrator=integrator)
    assert sol.y[:, -1] == pytest.approx([0.0, 1.0, 1.0], abs=1e-8)
    states = [hs.State("h", 1, "w"), hs.State("w", 0, "-2 + p"), hs.State("y", 0, "floor(h)")]
    sol = hs.simulate(
        hs.Model("m", states=states, impacts=[hs.Impact("p", "h", restitution=0)]),
        (0, 3),
        integrator=integrator,
    )
    assert sol.y[:, -1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-8)


@pytest.mark.parametrize("integrator", ["dop853", "exact"])
def test_everything_at_one_instant_reads_the_new_number(integrator: str) -> None:
    """A tick counts whole turns at t = 1, where x = 2 exactly; the output and a monitor jump there."""
    model = hs.Model(
        "m",
        states=[hs.State("x", 0, 2)],
        discrete=[hs.Discrete("n", 0), hs.Discrete("rest", 9)],
        schedules=[hs.Schedule("tick", times=[1], reset={"n": "floor(x)", "rest": "mod(x, 2)"})],
        monitors=[hs.Monitor("half", "mod(x, 2) - 1", direction="down")],
        outputs={"saw": "mod(x, 2)"},
    )
    sol = hs.simulate(model, (0, 1.25), integrator=integrator)
    assert [sol.output(name, 1.25) for name in ("n", "rest", "saw")] == pytest.approx([2, 0, 0.5], abs=1e-15)
    assert [(event.component, event.t) for event in sol.events if event.kind == "monitor"] == [("half", 1.0)]
    assert sol.output("saw", 1.0, side="-") == pytest.approx(2.0)
    assert sol.output("saw", 1.0) == pytest.approx(0.0, abs=1e-15)


def test_a_jump_at_the_end_of_a_run_has_happened() -> None:
    model = hs.Model("m", states=[hs.State("x", 0.5, 1)], outputs={"n": "floor(x)"})
    sol = hs.simulate(model, (0, 0.5))
    assert [sol.output("n", 0.5, side="-"), sol.output("n", 0.5)] == [0.0, 1.0]


def test_a_run_backward_passes_jumps() -> None:
    model = hs.Model("m", states=[hs.State("x", 0.5, 1), hs.State("y", 0, "floor(x)")])
    assert hs.simulate(model, (0, -2)).y[:, -1] == pytest.approx([-1.5, 0.5 * 0 + 1 + 2 * 0.5])


def test_jumps_in_a_bounce() -> None:
    """A ball from h = 1: the steps of 4 h are 3, 2, 1 and 0, above h = 3/4, 1/2, 1/4 and 0."""
    states = [hs.State("h", 1, "w"), hs.State("w", 0, "p - 9.81"), hs.State("y", 0, "floor(4*h)")]
    model = hs.Model("m", states=states, impacts=[hs.Impact("p", "h", 1)])
    above = [math.sqrt(2 * (1 - k / 4) / 9.81) for k in (1, 2, 3)]
    sol = hs.simulate(model, (0, 4 * math.sqrt(2 / 9.81)), rtol=1e-10)
    assert sol.y[2, -1] == pytest.approx(4 * math.fsum(above))


def test_a_condition_reads_a_whole_number() -> None:
    states = [hs.State("x", 0.5, 1), hs.State("y", 0, "1 if mod(floor(x), 2) > 0.5 and x < 3.25 else -1")]
    assert hs.simulate(hs.Model("m", states=states), (0, 4)).y[1, -1] == pytest.approx(
        -0.5 + 1 - 1 + 0.25 - 1.25
    )


def test_inputs_and_divisors_of_parameters() -> None:
    """The table rises from 0.5 to 2.5 and jumps to 7; the divisor is swept, also to a negative value."""
    table = hs.Input("u", "table", times=[0, 1, 1, 2], values=[0.5, 2.5, 7, 7])
    model = hs.Model(
        "m",
        parameters={"d": 1},
        states=[hs.State("y", 0, "floor(u)"), hs.State("z", 0, "mod(t, d)")],
        inputs=[table],
    )
    expected = {1.0: 1.0, 0.5: 0.5, -1.0: -1.0, 4.0: 2.0}
    swept = hs.sweep(model, {"d": list(expected)}, lambda m: float(hs.simulate(m, (0, 2)).y[1, -1]))
    assert list(swept["value"]) == pytest.approx(list(expected.values()))
    assert hs.simulate(model, (0, 2)).y[0, -1] == pytest.approx(0.5 + 2 * 0.25 + 7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mod(x, v)", "the divisor of 'mod\\(x, v\\)' is not constant"),
        ("mod(x, p - 1)", "the divisor 'p - 1' of mod is 0"),
        ("floor(f)", "'floor\\(f\\)' depends on 'f'"),
    ],
)
def test_wrong_arguments_are_refused(text: str, message: str) -> None:
    friction = hs.Contact("f", "v", 1, "coulomb", {"mu": 0.5})
    states = [hs.State("x", 0, "v"), hs.State("v", 0, f"{text} - f")]
    with pytest.raises(ModelError, match=message):
        hs.Model("m", parameters={"p": 1}, states=states, contacts=[friction]).validate()


def test_a_divisor_that_becomes_zero_is_refused() -> None:
    model = hs.Model("m", parameters={"d": 1}, states=[hs.State("x", 0, "mod(t, d)")]).validate()
    with pytest.raises(ModelError, match="the divisor 'd' of mod is 0"):
        hs.simulate(model, (0, 1), params={"d": 0})


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"contacts": [hs.Contact("f", "v - b", 1, "coulomb", {"mu": 1})]},
            "the velocity contains 'floor\\(x\\)'",
        ),
        ({"surfaces": [hs.SwitchingSurface("u", "x - b")]}, "the switching function contains 'floor\\(x\\)'"),
        ({"elements": [hs.Element("y", "backlash", "b", width=1)]}, "the input of a backlash contains"),
        ({"inputs": [hs.Input("u", "wave", shape="sine", period="floor(2.5)")]}, "'period' contains 'floor"),
    ],
)
def test_what_must_be_continuous_refuses_them(parts: dict[str, object], message: str) -> None:
    states = [hs.State("x", 0, "v"), hs.State("v", 0, "-x")]
    with pytest.raises(HybridsimError, match=message):
        hs.Model("m", states=states, definitions={"b": "floor(x)"}, **parts).validate()  # type: ignore[arg-type]


def test_other_questions_refuse_them_by_name() -> None:
    states = [hs.State("x", 1.2, "a - x + floor(x)")]
    model = hs.Model("m", parameters=[hs.Parameter("a", 0.5)], states=states)
    for ask in (
        lambda: hs.to_ivp(model, {}),
        lambda: hs.equilibria(model),
        lambda: hs.sensitivities(hs.simulate(model, (0, 1)), ["a"]),
        lambda: hs.steady_state(model, period=1.0),
        lambda: hs.lyapunov_exponents(model, 10.0),
    ):
        with pytest.raises(UsageError, match="contains floor, mod or round"):
            ask()


def test_the_hidden_numbers_are_no_quantities_of_a_solution() -> None:
    sol = hs.simulate(hs.Model("m", states=[hs.State("x", 0.5, 1), hs.State("y", 0, "floor(x)")]), (0, 2))
    assert sol.events == ()
    assert sol.modes == {}
    assert [(corner.component, corner.t) for corner in sol.corners] == [("floor(x)", 0.5), ("floor(x)", 1.5)]
    with pytest.raises(HybridsimError):
        sol.output("whole_1", 1.0)


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "tsit5", "rodas5p", "cvode-bdf"])
@pytest.mark.parametrize(("g", "e"), [(2.0, 0.5), (9.81, 0.7)])
def test_an_impact_moves_an_argument_by_several_whole_values(integrator: str, g: float, e: float) -> None:
    """A ball falls from h = 1 and bounces until it rests; floor(w) is summed over the unit intervals of its speed."""
    states = [hs.State("h", 1, "w"), hs.State("w", 0, f"p - {g}"), hs.State("y", 0, "floor(w)")]
    model = hs.Model(
        "m",
        states=states,
        impacts=[hs.Impact("p", "h", restitution=e)],
        outputs=[hs.Output("n", "mod(w, 1)")],
    )
    sol = hs.simulate(model, (0, 6), integrator=integrator)
    assert sol.status == "finished"

    def primitive(w: float) -> float:
        """Return the integral of floor from 0 to w."""
        k = math.floor(w)
        return k * (k - 1) / 2 + k * (w - k)

    hit = math.sqrt(2 * g)
    total = (primitive(0.0) - primitive(-hit)) / g
    while hit > 1e-13:
        hit *= e
        total += (primitive(hit) - primitive(-hit)) / g
    assert sol.y[2, -1] == pytest.approx(total, abs=1e-6)
    assert sol.output("n", 6.0) == 0.0
