"""Parts built in Python from what they cannot be built from: a UsageError names the part and the argument."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import hybridsim as hs
from hybridsim.errors import UsageError

X = hs.State("x", 0, "1")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: hs.Model("a", states={"x": "v"}), "Model a: the state 'x' has no rate"),
        (lambda: hs.Model("a", states=5), "Model a: `states` contains 5"),
        (lambda: hs.Model("a", states=None), "Model a: `states` contains None"),
        (lambda: hs.Model(5, states=[X]), "Model: `name` cannot be 5"),
        (lambda: hs.Model("a", [X], parameters=["k"]), "Model a: `parameters` contains 'k'"),
        (lambda: hs.Model("a", [X], parameters={"k": None}), "Parameter k: `value` cannot be None"),
        (lambda: hs.Model("a", [X], contacts=[X]), "Model a: `contacts` contains State"),
        (lambda: hs.Model("a", [X], components=[hs.Mode("m")]), "Model a: `components` contains Mode"),
        (lambda: hs.Model("a", [X], definitions=5), "Model a: `definitions` cannot be 5"),
        (lambda: hs.Model("a", [X], definitions=[5]), r"Model a: `definitions` cannot be \[5\]"),
        (lambda: hs.Model("a", [X], outputs={"y": None}), "Output y: `expr` cannot be None"),
        (
            lambda: hs.State("x", 0, "1", units="m"),
            r"State\(\) has no argument 'units'\ndid you mean 'unit'?",
        ),  # type: ignore[call-arg]  # the slip meant
        (lambda: hs.Contact(mu=0.3), r"Contact\(\) has no argument 'mu'\narguments: name, velocity, normal"),  # type: ignore[call-arg]  # the slip meant
        (lambda: hs.State("x"), r"State\(\): missing a required argument: 'start'\narguments: name, start"),  # type: ignore[call-arg]  # the slip meant
        (lambda: hs.State(["x"], 0, "1"), r"State: `name` cannot be \['x'\]"),
        (lambda: hs.State("x", None, "1"), "State x: `start` cannot be None"),
        (lambda: hs.State("x", 0, "1", unit=3), "State x: `unit` cannot be 3\nuse a string"),  # type: ignore[arg-type]  # the slip meant
        (lambda: hs.Parameter("k", 4, unit=3), "Parameter k: `unit` cannot be 3"),  # type: ignore[arg-type]  # the slip meant
        (lambda: hs.Output("y", "x", unit=["m"]), r"Output y: `unit` cannot be \['m'\]"),  # type: ignore[arg-type]  # the slip meant
        (
            lambda: hs.Monitor("z", "x", direction=-1),
            "Monitor z: `direction` cannot be -1\nuse 'up' or 'down' or 'both'",
        ),  # type: ignore[arg-type]  # SciPy's way
        (lambda: hs.Model("a", [X], title=3), "Model a: `title` cannot be 3"),  # type: ignore[arg-type]  # the slip meant
        (lambda: hs.State("x", 0, "1", nominal="a"), "State x: `nominal` cannot be 'a'"),
        (lambda: hs.Mode("m", guards={"g": "x"}), "Mode m: `guards` contains {'g': 'x'}"),
        (lambda: hs.Mode("m", der=5), "Mode m: `der` cannot be 5"),
        (lambda: hs.Mode("m", set=["u"]), r"Mode m: `set` cannot be \['u'\]"),
        (lambda: hs.Guard("g", "x", then=5), "Guard g: `then` contains 5"),
        (lambda: hs.Choice("b", reset="x"), "Choice: `reset` cannot be 'x'"),
        (lambda: hs.Component("c", modes="m"), "Component c: `modes` contains 'm'"),
        (
            lambda: hs.Component("c", hs.Mode("on"), hs.Mode("off")),  # type: ignore[arg-type]  # the slip meant
            "Component c: `initial` cannot be the mode object 'off'\npass several modes as a list",
        ),
        (lambda: hs.Component("c", [hs.Mode("m")], surface="x"), "Component c: `surface` cannot be 'x'"),
        (lambda: hs.Contact("f", "v", "N", 5), "Contact f: `law` cannot be 5"),
        (lambda: hs.Contact("f", None, "N", "coulomb"), "Contact f: `velocity` cannot be None"),
        (lambda: hs.Contact("f", "v", "N", "coulomb", arguments=5), "Contact f: `arguments` cannot be 5"),
        (lambda: hs.FrictionLaw("l", "N", "N", parameters=5), "FrictionLaw l: `parameters` cannot be"),
        (lambda: hs.Input("u", "table", times="a", values=[1]), "Input u: `times` cannot be 'a'"),
        (lambda: hs.Input("u", "table", times=[0], values=["b"]), r"Input u: `values` cannot be \['b'\]"),
        (lambda: hs.Input("u", 5), "Input u: `kind` cannot be 5"),
        (lambda: hs.Monitor("m", "x", direction=5), "Monitor m: `direction` cannot be 5"),
        (lambda: hs.Monitor("m", "x", reset=5), "Monitor m: `reset` cannot be 5"),
        (lambda: hs.Schedule("s", times=1, reset=3), "Schedule s: `reset` cannot be 3"),
        (lambda: hs.Output("o", "x", modes=5), "Output o: `modes` cannot be 5"),
        (lambda: hs.load("dfcs").with_(N=None), "parameter N cannot be None"),
        (lambda: hs.load("dfcs").with_start(x=[1]), r"state x cannot be \[1\]"),
        (lambda: hs.load(5), "model cannot be 5"),
        (lambda: hs.load_law(5), "law cannot be 5"),
        (lambda: hs.Model.from_toml(5), "text of the model cannot be 5"),
    ],
)
def test_what_cannot_be_is_named(make: Callable[[], object], says: str) -> None:
    with pytest.raises(UsageError, match=says) as caught:
        make()
    assert caught.value.remedy


def test_a_component_without_a_start_mode_is_told_the_remedy_of_its_language() -> None:
    modes = [hs.Mode("on"), hs.Mode("off")]
    model = hs.Model("m", [hs.State("x", 0.0, "1")], components=[hs.Component("relay", modes)])
    with pytest.raises(hs.ModelError) as caught:
        hs.simulate(model, (0.0, 1.0))
    assert "pass initial='on' to hs.Component" in str(caught.value)
    assert "initial = true" not in str(caught.value)
