"""Elements of control loops: what is refused and why, where they begin, and that the flat model reads back."""

from __future__ import annotations

from math import pi

import pytest

import hybridsim as hs
from hybridsim.errors import HybridsimError, ModelError
from hybridsim.testing.measuring import SCENES

FILE = """schema = 1
name = "m"
[parameters]
a = 1
[states]
x = {{ start = 0, der = "v" }}
v = {{ start = 1, der = "-x" }}
[discrete]
n = 0
[clocks.tick]
period = 1
set = {{ n = "{set}" }}
[inputs.w]
kind = "chirp"
f0 = 1
f1 = 2
duration = 1
[elements]
y = {{ {element} }}
"""


@pytest.mark.parametrize(
    ("element", "what", "remedy"),
    [
        ('kind = "rely", input = "x"', "unknown kind 'rely'", "relay"),
        ('kind = "relay", input = "x", on = 1', "'off' is missing", "input, on, off"),
        (
            'kind = "relay", input = "x", on = -1, off = "a"',
            "`off` is 1 and `on` is -1",
            "change the sign of the input",
        ),
        (
            'kind = "relay", input = "x", on = 1, off = 0, initial = "up"',
            "unknown initial mode 'up'",
            "'on' or 'off'",
        ),
        (
            'kind = "saturation", input = "x", lower = 2, upper = "a"',
            "`lower` is 2 and `upper` is 1",
            "not above",
        ),
        ('kind = "deadband", input = "x + q", lower = -1, upper = 1', "unknown name 'q'", ""),
        (
            'kind = "backlash", input = "n", width = 1',
            "depends on 'n', which jumps",
            "component with modes",
        ),
        ('kind = "backlash", input = "x + w", width = 1', "depends on w", ""),
        (
            'kind = "delay", input = "x", time = 0.1',
            "a model does not store past states",
            "`clock` and `ticks`",
        ),
        ('kind = "delay", input = "w", time = 0.1', "'w' cannot be delayed", "'table' and 'wave'"),
        ('kind = "delay", input = "x", clock = "tack", ticks = 2', "unknown clock 'tack'", "tick"),
        (
            'kind = "delay", input = "x", ticks = 2',
            "the delay needs either `time`, or `clock` and `ticks`",
            "`clock` and `ticks`",
        ),
    ],
)
def test_an_error_names_the_line_of_the_element(element: str, what: str, remedy: str) -> None:
    with pytest.raises(ModelError) as caught:
        hs.Model.from_toml(FILE.format(element=element, set="+= 1"))
    (error,) = caught.value.errors
    assert error.place is not None and error.place.line == 19
    assert what in error.message
    assert remedy in str(error)


@pytest.mark.parametrize(
    ("values", "what"),
    [
        ({"L": -1}, ["s: `lower` is 1 and `upper` is -1", "r: `off` is 0.5 and `on` is -1"]),
        ({"L": 0.5}, ["r: `off` is 0.5 and `on` is 0.5"]),
        ({"W": -1}, ["b: `width` is -1", "q: `step` is -1"]),
        ({"W": 0}, ["b: `width` is 0", "q: `step` is 0"]),
    ],
)
def test_changed_parameters_keep_the_order_of_levels(values: dict[str, float], what: list[str]) -> None:
    elements = [
        hs.Element("s", "saturation", "x", lower="-L", upper="L"),
        hs.Element("b", "backlash", "x", width="W"),
        hs.Element("q", "quantizer", "x", step="W"),
        hs.Element("r", "relay", "x", on="L", off=0.5),
    ]
    part = hs.Model("p", parameters={"L": 1, "W": 1}, states=[hs.State("x", 0, "cos(t)")], elements=elements)
    assert hs.simulate(part, (0, 1)).status == "finished"
    with pytest.raises(ModelError) as caught:
        hs.simulate(part, (0, 1), params=values)
    assert [error.message for error in caught.value.errors] == [f"element {text}" for text in what]
    whole = hs.Model("m", parameters={"A": 1}, use=[hs.Use("k", part, dict.fromkeys(values, "A"))])
    (value,) = values.values()
    with pytest.raises(ModelError, match=f"use.k: element k.{what[0][0]}"):
        whole.with_(A=value).validate()


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853", "rodas5p", "cvode-bdf"])
@pytest.mark.parametrize("b", [0.0, 0.25])
def test_limits_may_be_equal(integrator: str, b: float) -> None:
    """x = t - 1 rises. Until x = 0 the dead band d has the integral -(1 - b)^2/2; with the saturation s, d + s = x."""
    elements = [
        hs.Element("d", "deadband", "x", lower="-b", upper="b"),
        hs.Element("s", "saturation", "x", lower="-b", upper="b"),
    ]
    states = [hs.State("x", -1, 1), hs.State("left", 0, "d"), hs.State("sum", 0, "d + s - x")]
    model = hs.Model("m", parameters={"b": 0.5}, states=states, elements=elements)
    sol = hs.simulate(model, (0, 2), params={"b": b}, integrator=integrator, rtol=1e-9, atol=1e-12)
    assert (sol.status, sol.warnings) == ("finished", ())
    half = hs.simulate(model, (0, 1), params={"b": b}, integrator=integrator, rtol=1e-9, atol=1e-12)
    assert half.x_end == pytest.approx([0.0, -((1 - b) ** 2) / 2, 0.0], abs=1e-8)
    assert sol.x_end == pytest.approx([1.0, 0.0, 0.0], abs=1e-8)


@pytest.mark.parametrize("ticks", [0, 1001, 2.5, True])
def test_ticks_are_a_whole_number(ticks: object) -> None:
    with pytest.raises(HybridsimError, match="`ticks` cannot be"):
        hs.Element("y", "delay", "x", clock="c", ticks=ticks)


def test_what_decides_at_events_does_not_read_a_quantizer() -> None:
    with pytest.raises(ModelError, match="schedule tick, reset of n reads the quantizer 'y'") as caught:
        hs.Model.from_toml(FILE.format(element='kind = "quantizer", input = "x", step = 0.1', set="y + 1"))
    assert caught.value.errors[0].place.line == 12  # type: ignore[union-attr]  # it has one


@pytest.mark.parametrize("integrator", ["exact", "dop853", "cvode-bdf"])
def test_a_sample_is_quantized_from_the_start(integrator: str) -> None:
    """Samples x = 3.26 + t/2 at t = 0, 1, ..., and holds the nearest multiple of 1/5; also from another start."""
    model = hs.Model(
        "m",
        states=[hs.State("x", 3.26, 0.5), hs.State("y", 0, "u")],
        schedules=[hs.Schedule("tick", period=1)],
        elements=[
            hs.Element("sample", "delay", "x", clock="tick", ticks=1),
            hs.Element("u", "quantizer", "sample", step=0.2),
        ],
    )
    sol = hs.simulate(model, (0, 3), integrator=integrator)
    assert sol(3.0)[1] == pytest.approx(3.2 + 3.8 + 4.2)  # 3.26, 3.76 and 4.26
    sol = hs.simulate(model, (0, 1), integrator=integrator, x0={"x": -1000.07})
    assert sol(1.0)[1] == pytest.approx(-1000.0)


def test_play_begins_within_reach_of_its_input() -> None:
    """The input is 3 at once, so that the part is moved to 3 - 1 and stays there while the input comes back by 2."""
    model = hs.Model(
        "m",
        states=[hs.State("x", 3, -1)],
        outputs={"position": "y"},
        elements=[hs.Element("y", "backlash", "x", width=2)],
    )
    sol = hs.simulate(model, (0, 5))
    assert [sol.output("position", t) for t in (0.0, 1.9, 3.0, 5.0)] == pytest.approx([2, 2, 1, -1])


def test_a_relay_begins_in_its_initial_mode() -> None:
    """Between the levels it stays as it is declared."""
    for initial, first in (("on", 7 * pi / 6), ("off", pi / 6)):
        relay = hs.Element("u", "relay", "x", on=0.5, off=-0.5, initial=initial)
        states = [hs.State("x", 0, "v"), hs.State("v", 1, "-x"), hs.State("y", 0, "u")]
        sol = hs.simulate(hs.Model("m", states=states, elements=[relay]), (0, 5))
        assert sol.modes["u"][0].mode == initial
        assert sol.events[0].t == pytest.approx(first)


@pytest.mark.parametrize("name", ["elements", "delays", "guard-directions"])
def test_the_flat_model_reads_back(name: str) -> None:
    model = hs.load(str(SCENES / f"{name}.toml"))
    assert model.elements == ()
    assert hs.Model.from_toml(model.to_toml()) == model


def test_floor_and_the_remainder_agree_with_elements() -> None:
    """Integrals over 0 to 3.5 of floor(2 - t), and of t modulo 1.5."""
    model = hs.Model(
        "m",
        states=[hs.State("x", 2, -1), hs.State("y", 0, "whole"), hs.State("z", 0, "rest")]
        + [hs.State("same_y", 0, "floor(x)"), hs.State("same_z", 0, "mod(t, 1.5)")],
        inputs=[hs.Input("rest", "wave", shape="sawtooth", period=1.5, amplitude=0.75, offset=0.75)],
        elements=[hs.Element("whole", "quantizer", "x - 0.5", step=1)],
    )
    sol = hs.simulate(model, (0, 3.5))
    values = [1 + 0 - 1 - 0.5 * 2, 2 * 1.5**2 / 2 + 0.5**2 / 2]
    assert sol.y[1:, -1] == pytest.approx(values * 2)


def test_a_part_may_have_elements() -> None:
    text = """
schema = 1
name = "servo"
[states]
x = { start = 0, der = "limited" }
[inputs.e]
kind = "connected"
[elements]
limited = { kind = "saturation", input = "e + 0", lower = -1, upper = 1 }
u = { kind = "relay", input = "2*x", on = 1, off = 0 }
y = { kind = "backlash", input = "3*x", width = 1 }
"""
    whole = hs.Model("whole", use=[hs.Use("s", hs.Model.from_toml(text), connect={"e": 2})])
    sol = hs.simulate(whole, (0, 1))
    assert [(event.component, event.t) for event in sol.events] == [("s.y", 1 / 6), ("s.u", 0.5)]
    assert sol.output("s.y", 1.0) == pytest.approx(2.5)
