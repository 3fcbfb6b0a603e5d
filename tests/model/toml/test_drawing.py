"""Drawings in model files: read, checked, written, and without effect on runs."""

from __future__ import annotations

import pytest

import hybridsim as hs
from hybridsim.model.parts.shape import KINDS

HEAD = """
[parameters]
l = 2
[states]
x = { start = 1, der = "v" }
v = { start = 0, der = "-x" }
[drawing]
"""
FIELDS = {
    "at": '["x", "l*t"]', "ends": '["held", ["x", 1]]', "points": '[[0, 0], ["x", 1], [1, "v"]]', "vector": '[1, "v"]',
    "size": '["l", 1.5]', "length": '"2*l"', "angle": '"x"', "twist": '"v"', "travel": '"0.2*t"', "level": '"x + 1"',
    "offset": "0.1", "mode_of": '"x"', "text": '"m"',
}  # fmt: skip
ALL = HEAD + 'held = { kind = "ball", at = [0, 0], size = 0.5 }\n' + "".join(
    f'a_{kind} = {{ kind = "{kind}", ' + ", ".join(f"{k} = {FIELDS[k]}" for k in (*needed, *others)) + " }\n"
    for kind, (needed, others) in KINDS.items()
)  # fmt: skip


def test_every_kind_is_read_and_written() -> None:
    model = hs.Model.from_toml(ALL)
    assert [shape.kind for shape in model.drawing] == ["ball", *KINDS]
    again = hs.Model.from_toml(model.to_toml())
    assert again == model and again.drawing == model.drawing
    arrow = next(shape for shape in model.drawing if shape.kind == "arrow")
    assert [(where, expr.text) for where, expr in arrow.expressions()] == [
        ("at[0]", "x"), ("at[1]", "l*t"), ("vector[0]", "1"), ("vector[1]", "v"),
    ]  # fmt: skip


def test_the_same_in_python() -> None:
    read = hs.Model.from_toml(
        HEAD + 'b = { kind = "mass", at = ["x", 0], size = 1 }\nr = { kind = "rod", ends = [[0, 1], "b"] }'
    )
    made = [hs.Shape("b", "mass", at=("x", 0), size=1), hs.Shape("r", "rod", ends=[(0, 1), "b"])]
    assert read.drawing == tuple(made)


def test_it_has_no_part_in_runs_and_goes_with_them(tmp_path) -> None:
    drawn = hs.Model.from_toml(ALL)
    bare = hs.Model.from_toml(HEAD.removesuffix("[drawing]\n"), None)
    assert drawn != bare and drawn.structure() == bare.structure()
    assert drawn.with_(l=3).drawing == drawn.drawing
    run = hs.simulate(drawn, (0, 1), params={"l": 3})
    run.save(tmp_path / "run.hsol")
    assert hs.load_solution(tmp_path / "run.hsol").model.drawing == drawn.drawing


def test_a_regularised_model_keeps_its_drawing() -> None:
    assert hs.load("dfcs").regularized("tanh", v0=1e-3).validate().drawing


def test_a_part_brings_its_drawing() -> None:
    part = hs.Model(
        "block",
        [hs.State("x", 0, "v"), hs.State("v", 1, "-f")],
        contacts=[hs.Contact("f", "v", 1, "coulomb", {"mu": 0.2})],
        drawing=[
            hs.Shape("b", "mass", at=("x", 0), mode_of="f", text="m"),
            hs.Shape("s", "rod", ends=("b", (2, "x"))),
        ],
    )
    whole = hs.Model("two", [], use=[hs.Use("left", part), hs.Use("right", part)]).validate()
    assert [shape.name for shape in whole.drawing] == ["left.b", "left.s", "right.b", "right.s"]
    block, rod = whole.drawing[2:]
    assert (block.at[0].text, block.mode_of, block.text) == ("right.x", "right.f", "m")
    assert rod.ends[0] == "right.b" and rod.ends[1][1].text == "right.x"


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('a = { kind = "mas", at = [0, 0] }', r"m.toml:8: shape a: unknown kind 'mas'.*did you mean 'mass'"),
        ("a = { at = [0, 0] }", "shape a: 'kind' is missing"),
        ('a = { kind = "mass" }', "shape a: 'at' is missing.*needs at"),
        ('a = { kind = "mass", at = [0, 0], lenght = 1 }', "unknown key 'lenght'"),
        ('a = { kind = "mass", at = 0 }', r"'at' cannot contain 0.*use a point \[x, y\]"),
        ('a = { kind = "mass", at = [0, 0, 0] }', "'at' cannot contain"),
        ('a = { kind = "mass", at = [0, 0], size = [1, 2, 3] }', "'size' cannot be"),
        ('a = { kind = "mass", at = ["x+", 0] }', "m.toml:8: shape a, at.0: invalid expression"),
        ('a = { kind = "mass", at = ["y", 0] }', r"m.toml:8: shape a, at\[0\]: unknown name 'y'"),
        ('a = { kind = "mass", at = ["x > 1", 0] }', r"'x > 1' is a condition, but a number is needed"),
        ('a = { kind = "mass", at = [0, 0], mode_of = "g" }', "unknown component 'g'"),
        ('a = { kind = "rod", ends = ["b", [0, 0]] }\nb = { kind = "mass", at = [0, 0] }\nc = 1', "shape c cannot be"),
        ('a = { kind = "rod", ends = ["b", [0, 0]] }', "m.toml:8: shape a: nothing can be fixed to 'b'"),
        ('a = { kind = "rod", ends = [[0, 0]] }', "'ends' cannot be"),
        ('a = { kind = "line", points = 3 }', "'points' cannot be 3"),
    ],
)  # fmt: skip
def test_mistakes_are_reported_with_their_line(lines: str, message: str) -> None:
    with pytest.raises(hs.ModelError, match=f"(?s){message}"):
        hs.Model.from_toml(HEAD + lines, "m.toml")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hs.Shape("a", "mass", at=1), r"`at` cannot be 1\nuse points \(x, y\)"),
        (lambda: hs.Shape("a", "rod", ends="b"), r"`ends` cannot be 'b'\nuse two entries"),
        (lambda: hs.Shape("a", "mass", at=(0, 0), size=(1, 2, 3)), "`size` cannot be"),
        (lambda: hs.Shape("a", "mass", at=(0, 0), angle="x+"), "Shape a, angle: invalid expression"),
        (lambda: hs.Shape("a", "mass", at=(0, 0), mode_of=3), "`mode_of` cannot be 3"),
    ],
)
def test_wrong_arguments_in_python(make, message: str) -> None:
    with pytest.raises(hs.HybridsimError, match=message):
        make()


def test_fields_that_a_kind_does_not_have() -> None:
    wheel = hs.Shape("a", "wheel", at=(0, 0), travel="x")
    with pytest.raises(hs.ModelError, match=r"shape a: a wheel has no 'travel'\nit can have at, size"):
        hs.Model("m", [hs.State("x", 1, "-x")], drawing=[wheel]).validate()
    with pytest.raises(hs.ModelError, match="shape a: unknown kind 'well'"):
        hs.Model("m", [hs.State("x", 1, "-x")], drawing=[hs.Shape("a", "well", at=(0, 0))]).validate()
