"""Models in Python: short to write, frozen, copied with changes, compared and hashed by content."""

from __future__ import annotations

import dataclasses
import math
import pickle
from collections.abc import Callable

import pytest
from model.samples import block, everything

import hybridsim as hs
from hybridsim.errors import UsageError


def test_a_model_and_a_law_in_under_twenty_lines() -> None:
    law = hs.FrictionLaw("wet", slip="N*mu/(1 + v/v_w)", stick="N*mu", parameters={"mu": 0.3, "v_w": 0.5})
    model = hs.Model(
        "wet-block",
        states=[hs.State("x", 0, der="v"), hs.State("v", 0, der="(F0*sin(omega*t) - k*x - f)/m")],
        parameters={"m": 1, "k": 100, "F0": 5, "omega": "0.7*sqrt(k/m)"},
        contacts=[hs.Contact("f", velocity="v", normal="9.81*m", law=law)],
        outputs={"f": "f"},
    )
    model.validate()
    assert model.parameter_values()["omega"] == 0.7 * math.sqrt(100)
    assert hs.Model.from_toml(model.to_toml()) == model


def test_values() -> None:
    model = everything().validate()
    assert model.parameter_values()["bottom"] == 19.5
    assert model.start_values() == {"x": 1e-3, "v": 0, "w": 0.5, "T": 15}
    assert model.discrete_values() == {"n": 0, "scale": 1}


def test_changed_copies() -> None:
    model = block()
    changed = model.with_(N=40, k="9*m").with_start(x="2*mu")
    assert changed.parameter_values() == {"m": 1, "k": 9, "mu": 0.3, "N": 40}
    assert changed.start_values() == {"x": 0.6, "v": 0}
    assert model.parameter_values()["N"] == 2 and model.start_values()["x"] == 1
    assert changed != model and model.with_() == model
    assert changed.all_components()[0].mode("stick").guards[0].expr.text == "mu*N - f"


@pytest.mark.parametrize(
    ("change", "near"),
    [
        (lambda model: model.with_(n=1), "did you mean 'N'?"),
        (lambda model: model.with_(omega=1), "known parameters: N, k, m, mu"),
        (lambda model: model.with_(x=1), "'x' is a state; set its initial value, with --x0 x=VALUE"),
        (lambda model: model.with_start(N=1), "'N' is a parameter; set it with -p N=VALUE"),
        (lambda model: model.with_start(X=1), "did you mean 'x'?"),
        (lambda model: model.with_start(f=1), "known states, in this order: x, v"),
    ],
)
def test_changing_what_is_not_there(change: Callable[[hs.Model], hs.Model], near: str) -> None:
    with pytest.raises(hs.UsageError) as caught:
        change(block())
    assert near in str(caught.value)
    assert "block" in caught.value.message


def test_bad_values_are_refused_at_once_or_by_validation() -> None:
    with pytest.raises(hs.ExpressionError, match="nan is not finite"):
        block().with_(N=math.nan)
    with pytest.raises(hs.ModelError, match="the normal load cannot be -3"):
        block().with_(N=-3).validate()
    with pytest.raises(hs.ModelError, match="cyclic dependency among parameters: m -> k -> m"):
        block().with_(m="k").parameter_values()


@pytest.mark.parametrize("make", [block, everything])
def test_equal_by_content_hashed_and_carried(make: Callable[[], hs.Model]) -> None:
    model, other = make(), make()
    assert model == other and hash(model) == hash(other)
    assert pickle.loads(pickle.dumps(model)) == model
    assert dataclasses.replace(model, title="x") != model
    assert dataclasses.replace(model, path="elsewhere.toml") == model
    assert (model == 3) is False


def test_nothing_can_be_changed_in_place() -> None:
    model = block()
    with pytest.raises(dataclasses.FrozenInstanceError):
        model.name = "y"
    with pytest.raises(TypeError):
        model.all_components()[0].modes[0].set["f"] = 0
    given = {"f": "1"}
    mode = hs.Mode("a", set=given)
    given["f"] = "2"
    assert mode.set["f"].text == "1"


def test_shorthands_of_the_constructors() -> None:
    assert hs.Guard("g", "x", "off").then == (hs.Choice("off"),)
    assert hs.Schedule("s", times=3).times[0].text == "3"
    assert hs.Schedule("s", period=2).start == hs.Schedule("s", start=0, period=2).start
    assert hs.Contact("f", "v", 1, "coulomb", {"mu": 1}).law == hs.load_law("coulomb")
    assert hs.Component("c", [hs.Mode("only")]).initial == "only"
    assert hs.Component("c", [hs.Mode("a"), hs.Mode("b")]).initial is None
    with pytest.raises(KeyError):
        hs.Component("c", [hs.Mode("a")]).mode("b")


def test_what_a_model_says_of_itself() -> None:
    assert repr(block()) == "<Model block: states x, v; components f>"
    assert block().variables().keys() == {"f"}


# What structure() must not see, and what it must.
SAME = {
    "parameter": lambda m: m.with_(P=0.5, top="30 + q"),
    "start": lambda m: m.with_start(x=3, n=2),
    "text": lambda m: dataclasses.replace(m, title="", source="y", look="z", description="", path="p"),
    "name": lambda m: dataclasses.replace(m, name="other"),
    "units": lambda m: dataclasses.replace(
        m, states=[dataclasses.replace(s, unit="u", nominal=3.0) for s in m.states]
    ),
    "table": lambda m: dataclasses.replace(
        m, inputs=[dataclasses.replace(m.inputs[0], times=(0, 9), values=(1, 2)), *m.inputs[1:]]
    ),
    "order of a reset": lambda m: dataclasses.replace(
        m,
        monitors=[dataclasses.replace(x, reset=dict(reversed(list(x.reset.items())))) for x in m.monitors],
    ),
}
OTHER = {
    "der": lambda m: dataclasses.replace(m, states=[*m.states[:3], hs.State("T", 15, "heat - T")]),
    "order of states": lambda m: dataclasses.replace(m, states=m.states[::-1]),
    "a parameter more": lambda m: dataclasses.replace(m, parameters=[*m.parameters, hs.Parameter("p", 1)]),
    "definition": lambda m: dataclasses.replace(m, definitions={"load": "depth", "depth": "x"}),
    "monitor": lambda m: dataclasses.replace(m, monitors=m.monitors[1:]),
    "argument of a law": lambda m: dataclasses.replace(
        m, contacts=[m.contacts[0], dataclasses.replace(m.contacts[1], arguments={"mu": 0.2})]
    ),
    "surface": lambda m: dataclasses.replace(
        m,
        components=[
            m.components[0],
            dataclasses.replace(
                m.components[1], surface=dataclasses.replace(m.components[1].surface, jump_above=0)
            ),
        ],
    ),
    "wave": lambda m: dataclasses.replace(
        m, inputs=[*m.inputs[:2], dataclasses.replace(m.inputs[2], shape="sine"), m.inputs[3]]
    ),
    "output": lambda m: dataclasses.replace(m, outputs=m.outputs[:1]),
    "order of an output's modes": lambda m: dataclasses.replace(
        m,
        outputs=[
            m.outputs[0],
            dataclasses.replace(m.outputs[1], modes=dict(reversed(list(m.outputs[1].modes.items())))),
        ],
    ),
}


@pytest.mark.parametrize("change", SAME)
def test_structure_is_blind_to_what_code_does_not_depend_on(change: str) -> None:
    model = everything()
    changed = SAME[change](model)
    assert changed.structure() == model.structure()


@pytest.mark.parametrize("change", OTHER)
def test_structure_sees_what_code_depends_on(change: str) -> None:
    model = everything()
    assert OTHER[change](model).structure() != model.structure()


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("0.3", r"with the value 0.3; declare a parameter, mu = 0.3 under \[parameters\], and write"),
        ("friction", "contact f has 'mu = friction'; change 'friction'"),
    ],
)
def test_an_argument_of_a_law_is_no_parameter_and_how_it_becomes_one(argument: str, words: str) -> None:
    states = [hs.State("x", 1, "v"), hs.State("v", 0, "-x - f")]
    contact = hs.Contact("f", "v", "1", "coulomb", {"mu": argument})
    model = hs.Model("m", states, {"friction": 0.3}, contacts=[contact])
    with pytest.raises(UsageError, match=words if argument == "friction" else "value 0.3; write f.mu"):
        model.with_(mu=0.4)
    for ask in (
        lambda: hs.sweep(model, {"mu": [0.3, 0.4]}, "final", t_span=(0, 1)),
        lambda: hs.continuation(model, "mu", (0.2, 0.4)),
    ):
        with pytest.raises(UsageError, match=words):
            ask()
