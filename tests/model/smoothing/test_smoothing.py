"""What becomes of corners and jumps: components, sides that modes imply, or what they were."""

from __future__ import annotations

import pytest

import hybridsim as hs
from hybridsim.model.parts.component import Corner
from hybridsim.model.smoothing.explicit_corners import MOST, smoothed, smoothing_of
from hybridsim.model.smoothing.nonsmooth import COMPONENT, MODE, POWER, SURFACE, UNCHANGED, Primitive


def moving(rate: str, **more: object) -> hs.Model:
    states = [hs.State("x", 1, der="v"), hs.State("v", 0, der=rate)]
    return hs.Model("m", states=states, parameters={"k": 2, "g": 0.5}, **more)


def accounts(model: hs.Model) -> dict[str, Primitive]:
    return {one.text: one for one in smoothing_of(model).primitives}


def corners(model: hs.Model) -> list[Corner]:
    return [one for one in smoothed(model).components if isinstance(one, Corner)]


def test_a_smooth_model_is_left_alone() -> None:
    model = moving("-k*x - v**3")
    assert smoothed(model) is model
    assert smoothing_of(model).primitives == ()


def test_a_corner_becomes_two_modes() -> None:
    (corner,) = corners(moving("-k*max(x - g, 0)"))
    plus, minus = corner.modes
    assert (corner.name, plus.name, minus.name) == ("max(x - g, 0)", "+", "-")
    assert [mode.guards[0].expr.text for mode in corner.modes] == ["x - g", "-(x - g)"]
    assert [value.text for mode in corner.modes for value in mode.set.values()] == ["x - g", "0"]
    assert [mode.guards[0].then[0].to for mode in corner.modes] == ["-", "+"]


def test_one_argument_is_one_component() -> None:
    rate = "-max(x - g, 0) + abs(2*g - 2*x) + min(x, g) + (g if x > g else x) + abs(x + v)"
    assert [corner.name for corner in corners(moving(rate))] == ["max(x - g, 0)", "abs(x + v)"]


def test_nested_primitives_are_a_component_each() -> None:
    outer, inner = (corner.modes[0].guards[0].expr for corner in corners(moving("min(max(x, -1), 1)"))[::-1])
    assert inner.text == "x + 1"
    assert outer.names < {name for one in corners(moving("min(max(x, -1), 1)")) for name in one.variables}


def test_definitions_are_seen_through() -> None:
    model = moving("-abs(gap) - max(x - g, 0)", definitions={"gap": "g - x"})
    assert len(corners(model)) == 1


@pytest.mark.parametrize(
    ("text", "became"),
    [
        ("0 if x < g else k*(x - g)", COMPONENT),
        ("sin(x - g) if x - g >= 0 else (x - g)**3", COMPONENT),
        ("-1 if x < -1 else 1 if x > 1 else x", COMPONENT),
        ("1 if x > 0 else 0", SURFACE),
        ("k if x > g else -k", SURFACE),
        ("1 if t > g else 0", SURFACE),
        ("sign(x)", SURFACE),
        ("sign(v)*v**2", COMPONENT),
        ("sqrt(x) if x > 0 else 0", UNCHANGED),
    ],
)
def test_a_conditional_is_a_corner_where_its_branches_agree(text: str, became: str) -> None:
    assert accounts(moving(text))[text].became == became


@pytest.mark.parametrize("text", ["abs(k)*x", "max(k, 3) - x", "x if k > 1 else -x"])
def test_what_depends_on_parameters_alone_is_no_corner(text: str) -> None:
    assert smoothing_of(moving(text)).primitives == ()


def test_a_law_is_read_at_positive_speed_and_the_flow_follows_the_contact() -> None:
    law = hs.FrictionLaw("drag", parameters={"c": 1}, slip="N + c*abs(v)*v", stick="N")
    contact = hs.Contact("f", "v", "1", law)
    model = moving("-x - f - abs(v)*v + sign(v)", contacts=[contact])
    assert corners(model) == []
    above, below, hold = smoothed(model).components[0].modes
    assert "abs" not in above.set["f"].text + below.set["f"].text
    implied = [name for name in above.set if name != "f"]
    assert [[mode.set[name].text for name in implied] for mode in (above, below, hold)] == [
        ["v", "1"],
        ["-v", "-1"],
        ["v", "0"],
    ]


def test_the_guards_of_a_mode_imply_a_side() -> None:
    modes = (
        hs.Mode("up", (hs.Guard("g", "x", ("down",)),), set={"u": "abs(x)"}),
        hs.Mode("down", (hs.Guard("g", "-x", ("up",)),), set={"u": "abs(x) + max(v, x)"}),
    )
    model = moving("-x - u", components=[hs.Component("c", modes, initial="up")])
    up, down = smoothed(model).components[0].modes
    assert up.set["u"].text == "x"
    assert down.set["u"].text.startswith("-x + ")
    assert [corner.name for corner in corners(model)] == ["max(v, x)"]


def test_what_only_touches_zero_never_fires() -> None:
    """A guard that is never negative is taken out: a series past its corner would cross. A monitor may come to rest."""
    modes = (
        hs.Mode("a", (hs.Guard("g", "abs(x)", ("b",)), hs.Guard("h", "1 + abs(x) - v", ("b",)))),
        hs.Mode("b"),
    )
    model = moving(
        "-x",
        components=[hs.Component("c", modes, initial="a")],
        monitors=[hs.Monitor("touch", "max(v, 0)"), hs.Monitor("below", "-abs(v)")],
    )
    result = smoothed(model)
    assert [guard.name for guard in result.components[0].modes[0].guards] == ["h"]
    assert {text.strip("-")[:9] for text in (m.expr.text for m in result.monitors)} == {"__corner_"}


def test_what_waits_for_a_force_is_kept() -> None:
    contact = hs.Contact("f", "v", "1", "coulomb", {"mu": 0.5})
    states = [hs.State("v", 1, der="1 - f"), hs.State("heat", 0, der="abs(f)")]
    account = accounts(hs.Model("m", states=states, contacts=[contact]))["abs(f)"]
    assert account.became == UNCHANGED
    assert "f, which the solver computes in a mode" in account.remark


def test_more_corners_than_are_worth_it_are_kept() -> None:
    def model(count: int) -> hs.Model:
        return hs.Model("m", states=[hs.State(f"x{i}", 1, der=f"-abs(x{i})") for i in range(count)])

    assert len(corners(model(MOST))) == MOST
    many = model(MOST + 1)
    assert smoothed(many) is many
    assert {one.became for one in accounts(many).values()} == {UNCHANGED}


def test_fractional_powers_are_flagged() -> None:
    found = accounts(moving("sqrt(1 + v**2) - abs(x)**0.5 + x**k"))
    assert found["abs(x)**0.5"].became == POWER
    assert found["abs(x)"].became == UNCHANGED
    assert "sqrt(1 + v**2)" not in found
    assert "x**k" not in found  # k is 2
    raised = moving("abs(x)**k").with_(k=1.5)
    assert accounts(raised)["abs(x)**k"].remark == "the power has no Taylor series where abs(x) = 0"


def test_names_do_not_clash() -> None:
    modes = (hs.Mode("a", set={"u": "1"}),)
    model = moving("-abs(x)*u", components=[hs.Component("abs(x)", modes)])
    assert [corner.name for corner in corners(model)] == ["abs(x)'"]


def test_mode_remarks_name_the_component() -> None:
    contact = hs.Contact("f", "v", "1", "coulomb", {"mu": 0.5})
    account = accounts(moving("-x - f - abs(v)", contacts=[contact]))["abs(v)"]
    assert (account.became, account.where) == (MODE, ("state v",))
    assert account.remark == "the mode of f selects the branch"
