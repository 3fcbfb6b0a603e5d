"""Copies with other values: what was found good once is not looked at again, and a bad value is still refused."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

import hybridsim as hs
from hybridsim.expr import evaluate, parse


def apart(model: hs.Model, changes: dict[str, Any]) -> hs.Model:
    """The model with these values, made anew from all its parts, so that nothing is shared."""
    parameters = tuple(
        hs.Parameter(p.name, parse(changes.get(p.name, p.value)), p.unit, p.title, place=p.place)
        for p in model.parameters
    )
    return dataclasses.replace(model, parameters=parameters)


def refusal(model: hs.Model) -> tuple[str, list[str]]:
    with pytest.raises(hs.ModelError) as caught:
        model.validate()
    return str(caught.value), [str(fault) for fault in getattr(caught.value, "errors", ())]


@pytest.mark.parametrize(
    "changes",
    [
        {"N": -3},
        {"mu": -0.5},
        {"m": 0},
        {"k": "nowhere"},
        {"k": "x"},
        {"k": "m > 1"},
        {"m": "k", "k": "m"},
        {"c": "1/(m - m)"},
        {"c": "t"},
        {"N": -3, "c": "nowhere"},
    ],
    ids=str,
)
def test_a_bad_value_is_refused_in_the_words_of_a_first_check(changes: dict[str, Any]) -> None:
    model = hs.load("dfcs")
    assert model.is_known_to_be_sound  # loading checks
    assert refusal(model.with_(F0=1).with_(**changes)) == refusal(apart(model, changes))
    model.with_(F0=2).validate()


def test_copies_are_checked_against_a_sound_sibling() -> None:
    """The model itself was never checked: its copies have numbers of their own, and are refused as at a first check."""
    model = hs.load("dfcs").with_(omega="0.5*sqrt(k/m)")
    model.with_(F0=1, k=4e4).validate()
    assert model.parameter_values() == apart(model, {}).parameter_values()
    assert model.with_(c=2).parameter_values() == apart(model, {"c": 2}).parameter_values()
    for changes in ({"N": -3}, {"mu": -0.5}, {"m": 0}, {"k": -1}):
        assert refusal(model.with_(**changes)) == refusal(apart(model, changes))
    faulty = model.with_(N=-3)
    faulty.with_(N=2).validate()
    assert "the normal load cannot be -3" in refusal(faulty)[0]


def test_a_number_behind_a_definition_is_checked() -> None:
    contact = hs.Contact("f", velocity="v", normal="2*load + other", law="coulomb", arguments={"mu": 0.5})
    model = hs.Model(
        "m", [hs.State("v", 1, "-f")], parameters={"N": 1, "W": 1}, contacts=[contact],
        definitions={"load": "N - 1", "other": "W"},
    ).validate()  # fmt: skip
    for changes in ({"N": 0.25}, {"W": -1}, {"N": 0.25, "W": 0}):
        assert refusal(model.with_(**changes)) == refusal(apart(model, changes))
    model.with_(N=0.5, W=2).validate()


@pytest.mark.parametrize("start", ["nowhere", "v", "1/(m - m)", "m > 1"])
def test_so_is_a_bad_start(start: str) -> None:
    model = hs.load("dfcs")
    states = tuple(dataclasses.replace(s, start=parse(start)) if s.name == "x" else s for s in model.states)
    assert refusal(model.with_start(x=start)) == refusal(dataclasses.replace(model, states=states))


def test_a_fault_that_is_not_in_the_values_stays() -> None:
    """The copies of a faulty model are as faulty, however often they are looked at, and whatever else is wrong."""
    model = hs.Model("m", [hs.State("x", 1, "-k*y")], parameters={"k": 1})
    for k in (1, 2, 2):
        assert "unknown name 'y'" in refusal(model.with_(k=k))[0]
    assert not model.is_known_to_be_sound


def test_a_model_taken_apart_shares_nothing() -> None:
    """`dataclasses.replace` may change anything: what was known of the old model does not hold for the new one."""
    model = hs.load("dfcs")
    contact = dataclasses.replace(model.contacts[0], velocity="v - V")
    changed = dataclasses.replace(model, contacts=(contact,))
    assert "unknown name 'V'" in refusal(changed)[0]
    assert model.structure() != dataclasses.replace(model, contacts=()).structure()
    assert len(dataclasses.replace(model, contacts=()).all_components()) == 0


def test_values_of_copies_are_their_own() -> None:
    model = hs.load("dfcs")
    copies = [model.with_(m=m) for m in (0.1, 0.4)]
    assert [copy.parameter_values()["omega"] for copy in copies] == [600.0, 300.0]
    copies[0].parameter_values()["m"] = 7.0
    assert copies[0].parameter_values()["m"] == 0.1
    assert copies[0].with_start(x=0.5).start_values() == {"x": 0.5, "v": 0.0}
    assert copies[0].start_values() == {"x": 0.0, "v": 0.0}
    assert copies[0] == copies[1].with_(m=0.1) != copies[1]


def test_corners_of_copies_have_the_values_of_the_copy() -> None:
    """What becomes of a corner does not depend on values; what is run does."""
    model = hs.Model("m", [hs.State("x", "a", "-k*abs(x) - 1")], parameters={"k": 1, "a": 1})
    ends = [
        hs.simulate(copy, (0, 0.5), integrator="exact").y[0, -1]
        for copy in (model.with_(k=2), model.with_(k=1), model.with_(k=2, a=3), model.with_start(x=2))
    ]
    alone = [
        hs.simulate(
            hs.Model("m", [hs.State("x", x, "-k*abs(x) - 1")], parameters={"k": k, "a": 1}),
            (0, 0.5),
            integrator="exact",
        ).y[0, -1]
        for k, x in ((2, 1), (1, 1), (2, 3), (1, 2))
    ]
    assert ends == alone


@pytest.mark.parametrize("number", [0.0, -0.0, 1.5, -2.5e-300, 1e300, 3, -7, 0.1 + 0.2])
def test_a_number_is_the_expression_of_its_text(number: float) -> None:
    given, written = parse(number), parse(repr(number))
    assert given == written and str(given) == str(written)
    assert repr(evaluate(given, {})) == repr(evaluate(written, {}))
    assert given.is_constant and not given.is_boolean
