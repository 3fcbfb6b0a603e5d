"""A model's own duration: an expression of parameters, checked, kept in its file form, used where no end is given."""

from __future__ import annotations

import pytest

import hybridsim as hs
from hybridsim.errors import ModelError

TEXT = (
    'schema = 1\nname = "m"\nduration = {}\n[parameters]\nk = 4\n[states]\nx = {{ start = 0, der = "k" }}\n'
)


@pytest.mark.parametrize(("written", "value"), [("5", 5.0), ('"6/k"', 1.5)])
def test_it_is_an_expression_of_parameters(written: str, value: float) -> None:
    model = hs.Model.from_toml(TEXT.format(written))
    assert model.duration_value() == value
    assert hs.Model.from_toml(model.to_toml()) == model
    assert hs.Model.from_toml(TEXT.format(7)) != model


def test_it_follows_the_parameters() -> None:
    model = hs.Model("m", [hs.State("x", 0, "k")], {"k": 4}, duration="6/k")
    assert model.with_(k=2).duration_value() == 3.0


def test_without_one_there_is_none() -> None:
    assert hs.load("dfcs").duration_value() is None


@pytest.mark.parametrize(
    ("written", "says"),
    [
        ("0", "'duration' cannot be 0"),
        ('"1 - k"', "'duration' cannot be -3"),
        ('"x"', "state 'x'"),
        ('"t"', "time 't'"),
        ("true", "is a condition, but a number is needed"),
    ],
)
def test_what_is_no_duration_is_told_with_its_line(written: str, says: str) -> None:
    with pytest.raises(ModelError, match=says) as caught:
        hs.Model.from_toml(TEXT.format(written), path="m.toml")
    assert str(caught.value).startswith("m.toml:3: ")


def test_a_comparison_runs_for_it() -> None:
    model = hs.load("bouncing-ball")
    comparison = hs.compare(model, integrators=["dop853"], rtols=[1e-6], repeat=1)
    assert comparison.t_span == (0.0, model.duration_value())


@pytest.mark.parametrize(
    ("name", "events"),
    [
        ("belt", [("f", "stick")] * 3),
        ("free-decay", [("f", "stick")]),
        ("static-kinetic", [("f", "stick")] * 4),
        ("bouncing-ball", [("mode", "rest")]),
        ("thermostat", [("heater", "on")] * 6),
        ("sampled-servo", [("f", "stick")] * 4),
    ],
)
def test_the_packaged_scenes_last_until_their_point_is_seen(name: str, events: list[tuple[str, str]]) -> None:
    """What `look` speaks of happens, several times where it repeats."""
    model = hs.load(name)
    duration = model.duration_value()
    assert duration is not None
    seen = [
        (e.component, e.target) for e in hs.simulate(model, (0, duration)).events if e.kind == "transition"
    ]
    assert seen.count(events[0]) >= len(events)
