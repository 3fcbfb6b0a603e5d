"""Guards with a direction: what they become, when they fire, and where they are refused."""

from __future__ import annotations

from math import pi

import pytest

import hybridsim as hs
from hybridsim.errors import ModelError

SWING = """
schema = 1
name = "swing"
[states]
x = {{ start = {x}, der = "v" }}
v = {{ start = {v}, der = "-x" }}
[discrete]
n = 0
[components.count.modes.on]
guards.zero = {{ expr = "x", direction = "{way}", then = [{{ to = "on", reset = {{ n = "+= 1"{more} }} }}] }}
"""


def times(model: hs.Model, end: float = 10.0) -> list[float]:
    return [event.t for event in hs.simulate(model, (0, end)).events if event.component == "count"]


@pytest.mark.parametrize(
    ("x", "v", "way", "due"),
    [
        (0, 1, "up", [2 * pi]),  # the zero at the start does not count
        (0, 1, "down", [pi, 3 * pi]),
        (0, -1, "both", [pi, 2 * pi, 3 * pi]),
        (
            -1,
            0,
            "down",
            [3 * pi / 2],
        ),  # negative at the start, where a guard without a direction fires at once
        (1, 0, "up", [3 * pi / 2]),
        (1, 0, "both", [pi / 2, 3 * pi / 2, 5 * pi / 2]),
    ],
)
def test_a_guard_fires_where_it_passes_zero_in_its_direction(
    x: int, v: int, way: str, due: list[float]
) -> None:
    assert times(hs.Model.from_toml(SWING.format(x=x, v=v, way=way, more=""))) == pytest.approx(due)


def test_a_reset_at_the_crossing_is_no_second_crossing() -> None:
    """Thrown back to the other side at each zero of cos(t), sin(t) and so on: a quarter of a turn later it is there."""
    text = SWING.format(x=1, v=0, way="both", more=', x = "1", v = "0"')
    assert times(hs.Model.from_toml(text)) == pytest.approx([k * pi / 2 for k in range(1, 7)])


def test_a_jump_across_zero_is_a_crossing() -> None:
    guard = hs.Guard("low", "x", hs.Choice("on", reset={"n": "+= 1"}), direction="down")
    model = hs.Model(
        "jumps",
        states=[hs.State("x", 1, 0)],
        discrete=[hs.Discrete("n", 0)],
        components=[hs.Component("count", hs.Mode("on", guard))],
        schedules=[
            hs.Schedule("drop", times=[1, 3], reset={"x": -1}),
            hs.Schedule("lift", times=[2], reset={"x": 1}),
        ],
    )
    assert times(model) == [1.0, 3.0]


def test_the_flat_model_reads_back() -> None:
    model = hs.Model.from_toml(SWING.format(x=0, v=1, way="down", more=""))
    assert [part.name for part in model.components] == ["count", "count_on_zero"]
    assert [name for name, _ in model.definitions] == ["count_on_zero_value"]
    assert hs.Model.from_toml(model.to_toml()) == model


@pytest.mark.parametrize(
    ("line", "what", "remedy"),
    [
        (
            '[modes.on]\nguards.g = { expr = "x", direction = "sideways", then = "on" }',
            "sideways",
            "both, down, up",
        ),
        ('[modes.on]\nguards.g = { expr = "x + q", direction = "up", then = "on" }', "unknown name 'q'", ""),
    ],
)
def test_an_error_names_the_line_of_the_guard(line: str, what: str, remedy: str) -> None:
    with pytest.raises(ModelError, match=what) as caught:
        hs.Model.from_toml(f"schema = 1\n[states]\nx = {{ start = 0, der = 1 }}\n{line}\n")
    (error,) = caught.value.errors
    assert error.place is not None and error.place.line == 5
    assert remedy in str(error)


def test_a_surface_a_function_and_a_law_have_no_direction() -> None:
    up = hs.Guard("g", "x", "on", direction="up")
    surface = hs.Surface("x", "u", "on", None, "held", 0, 0, restitution=0)
    with pytest.raises(ModelError, match="the surface selects the next mode"):
        hs.Model(
            "m",
            states=[hs.State("x", 1, 1)],
            components=[hs.Component("c", [hs.Mode("on", up)], surface=surface)],
        )
    function = hs.Guard("g", lambda t, x, p: x[0], "on", direction="up")
    with pytest.raises(ModelError, match="because it is a Python function"):
        hs.Model(
            "m",
            states={"x": 1},
            flow=lambda t, x, p: (1.0,),
            components=[hs.Component("c", hs.Mode("on", function))],
        )
    law = hs.FrictionLaw(
        "l",
        force="z",
        states=[hs.State("z", 0, "v")],
        modes=[hs.Mode("on", hs.Guard("g", "z", "on", direction="up"))],
    )
    contact = hs.Contact("f", "v", 1, law)
    with pytest.raises(ModelError, match="a guard of a law cannot have a direction"):
        hs.Model("m", states=[hs.State("v", 1, "-f")], contacts=[contact]).validate()
