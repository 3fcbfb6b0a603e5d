"""Parts of models: what a flat model contains, in files and in Python, and how errors name their place."""

from __future__ import annotations

import gc
import json
import time
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.cli import main
from hybridsim.model.toml import read

EXAMPLES = Path(__file__).parents[3] / "docs" / "examples" / "parts"
SPRING = """
[parameters]
k = { value = 2, unit = "N/m" }
[inputs]
u = { kind = "connected" }
[states]
x = { start = 0, unit = "m", der = "k*(u - x)" }
[outputs]
pull = { expr = "k*(u - x)", unit = "N" }
"""


def written(folder: Path, **files: str) -> None:
    for name, text in files.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    written(tmp_path, spring=SPRING)
    return tmp_path


def loaded(folder: Path, text: str) -> hs.Model:
    written(folder, whole=text)
    return hs.load(folder / "whole.toml")


def refused(folder: Path, text: str) -> hs.ModelError:
    with pytest.raises(hs.ModelError) as caught:
        loaded(folder, text)
    return caught.value


# ------------------------------------------------------------------------------------------ the flat model


def test_a_part_becomes_declarations_with_dotted_names(folder: Path) -> None:
    model = loaded(
        folder,
        """
        [parameters]
        k0 = 3
        [use.left]
        model = "spring.toml"
        parameters = { k = "2*k0" }
        start = { x = "k0/4" }
        connect = { u = "sin(t)" }
        [use.right]
        model = "spring.toml"
        connect = { u = "left.pull - left.x" }
        """,
    )
    assert model.use == ()
    assert model.parameter_values() == {"k0": 3.0, "left.k": 6.0, "right.k": 2.0}
    assert model.start_values() == {"left.x": 0.75, "right.x": 0.0}
    assert [state.der.text for state in model.states] == [
        "left.k*(left.u - left.x)",
        "right.k*(right.u - right.x)",
    ]
    definitions = {name: expr.text for name, expr in model.definitions}
    # an output is a definition if another part uses it
    assert definitions == {
        "left.u": "sin(t)", "right.u": "left.pull - left.x", "left.pull": "left.k*(left.u - left.x)",
    }  # fmt: skip
    outputs = {output.name: (output.expr.text, output.unit) for output in model.outputs}
    assert outputs == {"left.pull": ("left.pull", "N"), "right.pull": ("right.k*(right.u - right.x)", "N")}
    assert model.with_(**{"left.k": 1}).parameter_values()["left.k"] == 1.0
    assert model.with_start(**{"right.x": 5}).start_values()["right.x"] == 5.0


def test_the_flat_text_loads_again_and_gives_the_same_model(folder: Path) -> None:
    for name in ("vehicle", "chain"):
        model = hs.load(EXAMPLES / f"{name}.toml")
        again = hs.Model.from_toml(model.to_toml())
        assert again == model
        assert again.structure() == model.structure()
        assert again.to_toml() == model.to_toml()


def test_the_same_parts_in_python_are_the_same_model(folder: Path) -> None:
    block = hs.load(EXAMPLES / "block.toml")
    chain = hs.Model(
        "chain",
        use=[
            hs.Use(
                "block", block, repeat=20, start={"x": "0.5*sin(7*i)"},
                connect={
                    "left": "block[i-1].x if i > 1 else block[i].x",
                    "right": "block[i+1].x if i < 20 else block[i].x",
                },
            )
        ],
    ).validate()  # fmt: skip
    assert chain == hs.load(EXAMPLES / "chain.toml")
    lines = [
        line for name in ("block", "chain") for line in (EXAMPLES / f"{name}.toml").read_text().splitlines()
    ]
    assert len([line for line in lines if line.strip() and not line.startswith("#")]) <= 25


def every_kind_of_part() -> hs.Model:
    """A part with one declaration of each kind, also with law states, resets and an automaton."""
    from model.samples import everything

    return everything()


def test_every_kind_of_declaration_can_be_in_a_part() -> None:
    part = every_kind_of_part()
    whole = hs.Model("whole", use=[hs.Use("one", part), hs.Use("two", part)]).validate()
    for kind in ("states", "parameters", "discrete", "inputs", "contacts", "surfaces", "impacts", "components",
                 "monitors", "schedules", "outputs", "drawing"):  # fmt: skip
        own = [declared.name for declared in getattr(part, kind)]
        expected = {f"{use}.{name}" for use in ("one", "two") for name in own}
        assert {declared.name for declared in getattr(whole, kind)} == expected
    assert hs.Model.from_toml(whole.to_toml()) == whole
    # apart from the prefix, the generated code comes from the same text
    renamed = "\n".join(
        line.replace("one.", "") for line in whole.structure().splitlines() if "two." not in line
    )
    assert set(part.structure().splitlines()) <= set(renamed.splitlines())


def test_start_values_reach_the_states_of_friction_laws() -> None:
    contact = hs.Contact("f", "v", 10, "dahl", {"mu": 0.5, "sigma": 1e4})
    part = hs.Model("m", states=[hs.State("v", 1, "-f")], contacts=[contact]).validate()
    whole = hs.Model("whole", use=[hs.Use("a", part, start={"f_z": 1e-5})]).validate()
    assert whole.start_values() == {"a.v": 1.0, "a.f_z": 1e-5}


def test_a_part_is_read_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = []
    real = read.open_text

    def noted(text: str, path: str | None, kind: str) -> object:
        opened.append(Path(path or "").name)
        return real(text, path, kind)

    monkeypatch.setattr(read, "open_text", noted)
    text = "".join(f"[use.a{k}]\nmodel = 'spring.toml'\nconnect.u = {k}\n" for k in range(4))
    assert len(loaded(folder, text).states) == 4
    assert opened == ["whole.toml", "spring.toml"]


def test_a_change_of_a_part_is_seen(folder: Path) -> None:
    text = "[use.a]\nmodel = 'spring.toml'\nconnect.u = 1\n"
    assert loaded(folder, text).parameter_values() == {"a.k": 2.0}
    time.sleep(0.25)  # older files are kept in memory
    assert hs.load(folder / "whole.toml").parameter_values() == {"a.k": 2.0}
    written(folder, spring=SPRING.replace("value = 2", "value = 3"))
    assert hs.load(folder / "whole.toml").parameter_values() == {"a.k": 3.0}


# ------------------------------------------------------------------------------------------ repeated parts


def test_lists_and_conditions_give_each_copy_its_value(folder: Path) -> None:
    model = loaded(
        folder,
        """
        [use.a]
        model = "spring.toml"
        repeat = 4
        parameters.k = [1, 2, "1 + 2", 4]
        start.x = "10 if i == 1 else (i if i < 4 else -1)"
        connect.u = "a[i-1 if i > 1 else 4].x + (1 if t > i else 0)"
        """,
    )
    assert list(model.parameter_values().values()) == [1.0, 2.0, 3.0, 4.0]
    assert list(model.start_values().values()) == [10.0, 2.0, 3.0, -1.0]
    texts = [expr.text for name, expr in model.definitions]
    assert texts[:2] == ["a4.x + (1 if t > 1 else 0)", "a1.x + (1 if t > 2 else 0)"]


def test_a_single_part_may_use_a_numbered_one(folder: Path) -> None:
    model = loaded(
        folder,
        """
        [use.a]
        model = "spring.toml"
        repeat = 3
        connect.u = 0
        [use.last]
        model = "spring.toml"
        connect.u = "a[3].pull + a1.x"
        """,
    )
    assert dict(model.definitions)["last.u"].text == "a3.pull + a1.x"


# ------------------------------------------------------------------------------------------ errors

AXLE = """
[states]
z = { start = 0, der = "hub.x" }
[use.hub]
model = "hub.toml"
connect.u = "z"
"""


def test_an_error_in_an_inner_part_names_its_line_and_the_path(folder: Path) -> None:
    written(folder, hub=SPRING.replace('k*(u - x)" }\n[out', 'k*(u - y)" }\n[out'), axle=AXLE)
    fault = refused(folder, "[use.left]\nmodel = 'axle.toml'\n[use.right]\nmodel = 'axle.toml'\n")
    assert fault.place is not None and fault.place.file == str(folder / "hub.toml")
    assert (fault.place.line, fault.place.within) == (7, "use.left > use.hub")
    assert str(fault).startswith(
        f"{folder / 'hub.toml'}:7, use.left > use.hub: state x, der: unknown name 'y'"
    )
    assert len(fault.errors) == 1  # not again for the second use


def test_a_part_in_a_part_in_a_part_has_three_names_in_values_and_errors(folder: Path) -> None:
    whole = "[use.train]\nmodel = 'bogie.toml'\nstart.left.hub.x = 3\n"
    written(
        folder,
        hub=SPRING,
        axle=AXLE,
        bogie="[use.left]\nmodel = 'axle.toml'\n[use.right]\nmodel = 'axle.toml'\n",
    )
    model = loaded(folder, whole)
    assert model.start_values()["train.left.hub.x"] == 3.0
    assert model.start_values()["train.right.hub.x"] == 0.0
    written(folder, hub=SPRING.replace('k*(u - x)" }\n[out', 'k*(u - y)" }\n[out'))
    fault = refused(folder, whole)
    assert str(fault).startswith(
        f"{folder / 'hub.toml'}:7, use.train > use.left > use.hub: state x, der: unknown name 'y'"
    )
    assert len(fault.errors) == 1


def test_an_error_of_a_value_names_the_copy(folder: Path) -> None:
    written(
        folder, axle=AXLE.replace("hub.toml", "spring.toml") + 'parameters.k = "1/c"\n[parameters]\nc = 1\n'
    )
    fault = refused(folder, "[use.a]\nmodel = 'axle.toml'\nrepeat = 2\nparameters.c = [1, 0]\n")
    assert "'1/a2.c' has no finite real value" in fault.message
    assert fault.place is not None and fault.place.within == "use.a[2]"
    assert fault.place.line == 7


@pytest.mark.parametrize(
    ("text", "message", "line"),
    [
        ("[use.a]\nmodel = 'spring.toml'\n", "the input 'u' of model 'spring' is not connected", 1),
        ("[use.a]\nmodel = 'spring.toml'\nconnect = { u = 'b.x' }", "unknown name 'b.x'", 3),
        ("[use.a]\nmodel = 'spring.toml'\nconnect = { u = 1, w = 2 }", "no connected input 'w'", 3),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = 1\nparameters.c = 1", "no parameter 'c'", 4),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = 1\nstart.k = 1", "no state 'k'", 4),
        (
            "[use.a]\nmodel = 'spring.toml'\nconnect.u = 1\nstart.x = 'a.x'",
            "the state 'a.x' cannot be used in this expression",
            4,
        ),
        ("[use.a]\nmodel = 'sprung.toml'", "the file does not exist", 2),
        ("[use.a]\nmodel = 'dfsc'", "there is no model 'dfsc'", 2),
        ("[use.a]\nmodel = 3", "'model' cannot be a number (3)", 2),
        ("[use.a]\nconnect.u = 1", "'model' is missing", 1),
        ("[use.a]\nmodel = 'spring.toml'\nfirst.u = 1", "unknown key 'first'", 3),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = 1\nrepeat = 0", "'repeat' cannot be 0", 4),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = 1\nrepeat = 1000000000", "'repeat' cannot be", 4),
        ("[use.a]\nmodel = 'spring.toml'\nrepeat = 3\nconnect.u = [1, 2]", "2 values for 3 copies", 4),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = [1, 2]", "2 values for one copy", 3),
        ("[use.a]\nmodel = 'spring.toml'\nrepeat = 3\nconnect.u = 'a[i-1].x'", "a[0] does not exist", 4),
        ("[use.a]\nmodel = 'spring.toml'\nrepeat = 3\nconnect.u = 'a[i/2].x'", "the index of 'a' is 0.5", 4),
        ("[use.a]\nmodel = 'spring.toml'\nrepeat = 3\nconnect.u = 'a[1/(i-1)].x'", "division by zero", 4),
        ("[use.a]\nmodel = 'spring.toml'\nrepeat = 3\nconnect.u = 'a[k].x'", "'k' cannot be used in an index", 4),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = 'a[1].x'", "there is no repeated part 'a'", 3),
        ("[use.a]\nmodel = 'spring.toml'\nrepeat = 2\nconnect.u = 'a[1]'", "'a[1]' is a part and has no value", 4),
        ("[use.a]\nmodel = 'spring.toml'\nrepeat = 2\nconnect.u = 'a.b[1].x'", "can follow only the name of a part", 4),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = '(1).real'", "access to attributes", 3),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = 't.__class__'", "reserved word 't'", 3),
        ("[use.a]\nmodel = 'spring.toml'\nconnect.u = 'a.__class__'", "is not allowed", 3),
        ("[use.'a b']\nmodel = 'spring.toml'\nconnect.u = 1", "use 'a b': not a valid name", 1),
        ("[use.sin]\nmodel = 'spring.toml'\nconnect.u = 1", "use 'sin': the name is reserved", 1),
        (
            "[use.a1]\nmodel = 'spring.toml'\nconnect.u = 1\n[use.a]\nmodel = 'spring.toml'\nconnect.u = 1\nrepeat=2",
            "two parts with the name 'a1'", 4,
        ),
        (
            "[parameters]\ni = 3\n[use.a]\nmodel = 'spring.toml'\nconnect.u = 1\nrepeat=2",
            "'i' is the index of the repeated part 'a'", 3,
        ),
        ("[use.a]\nmodel = 'whole.toml'", "a circle of parts", 2),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_its_line(folder: Path, text: str, message: str, line: int) -> None:
    fault = refused(folder, text)
    assert message in fault.message
    assert fault.place is not None and fault.place.file == str(folder / "whole.toml")
    assert fault.place.line == line
    assert fault.remedy


def test_a_circle_of_parts_is_named(folder: Path) -> None:
    written(folder, inner="[use.out]\nmodel = 'whole.toml'\n")
    fault = refused(folder, "[use.inner]\nmodel = 'inner.toml'\n")
    circle = [folder / name for name in ("whole.toml", "inner.toml", "whole.toml")]
    assert fault.message == f"use out: a circle of parts: {' > '.join(map(str, circle))}"
    assert fault.place is not None and fault.place.within == "use.inner"


def test_an_algebraic_loop_is_named(folder: Path) -> None:
    fault = refused(
        folder,
        "[use.a]\nmodel = 'spring.toml'\nconnect.u = 'b.pull'\n"
        "[use.b]\nmodel = 'spring.toml'\nconnect.u = 'a.pull'\n",
    )
    assert fault.message == "algebraic loop through parts: a.u -> b.pull -> b.u -> a.pull -> a.u"
    own = refused(folder, "[use.a]\nmodel = 'spring.toml'\nconnect.u = 'a.pull'\n")
    assert own.message == "algebraic loop through parts: a.u -> a.pull -> a.u"


def test_a_loop_through_a_state_is_none(folder: Path) -> None:
    text = "[use.a]\nmodel = 'spring.toml'\nconnect.u = 'b.x'\n[use.b]\nmodel = 'spring.toml'\nconnect.u = 'a.x'\n"
    assert len(loaded(folder, text).states) == 2


def test_nested_repeats_are_bounded(folder: Path) -> None:
    written(folder, many="[use.s]\nmodel = 'spring.toml'\nrepeat = 1000\nconnect.u = 1\n")
    fault = refused(folder, "[use.a]\nmodel = 'many.toml'\nrepeat = 1000\n")
    assert "4000000 declarations" in fault.message


def test_an_output_that_depends_on_the_mode_cannot_be_used() -> None:
    part = hs.Model(
        "m",
        states=[hs.State("x", 1, "-x")],
        components=[hs.Component("c", [hs.Mode("one")])],
        outputs=[hs.Output("y", "x", modes={"c.one": "2*x"})],
    )
    with pytest.raises(hs.ModelError, match=r"the output 'a\.y' depends on the mode"):
        hs.Model("whole", states=[hs.State("z", 0, "a.y")], use=[hs.Use("a", part)])
    assert hs.Model("whole", use=[hs.Use("a", part)]).validate().outputs[0].modes.keys() == {"a.c.one"}


def test_wrong_arguments_of_a_use() -> None:
    part = hs.Model("m", states=[hs.State("x", 1, "-x")])
    for arguments, message in (
        ({"repeat": True}, "`repeat` cannot be True"),
        ({"repeat": 2.0}, "`repeat` cannot be 2.0"),
        ({"start": {"x": [1, 2]}, "repeat": 3}, "has 2 values for 3 copies"),
        ({"connect": 3}, "`connect` cannot be 3"),
        ({"start": {"x": "1 +"}}, "start['x']: invalid expression"),
    ):
        with pytest.raises(hs.HybridsimError) as caught:
            hs.Use("a", part, **arguments)  # type: ignore[arg-type]
        assert message in caught.value.message
    with pytest.raises(hs.UsageError, match="The model cannot be 3"):
        hs.Use("a", 3)  # type: ignore[arg-type]
    functions = hs.Model("m", states={"x": 1.0}, flow=lambda t, x, p: (-x[0],))
    with pytest.raises(hs.ModelError, match="are Python functions"):
        hs.Model("whole", use=[hs.Use("a", functions)])


# ------------------------------------------------------------------------------------------ the command line


def test_check_flat_prints_the_flat_model(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--flat", str(EXAMPLES / "vehicle.toml")]) == 0
    assert hs.Model.from_toml(capfd.readouterr().out) == hs.load(EXAMPLES / "vehicle.toml")


def test_a_part_can_be_checked_alone_but_not_run(capfd: pytest.CaptureFixture[str]) -> None:
    part = str(EXAMPLES / "axle.toml")
    assert main(["check", part]) == 0
    assert "road: connected by the model that uses this one as a part" in capfd.readouterr().out
    assert main(["check", part, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["engine"] is None
    assert main(["run", part, "--t-end", "1"]) == 3
    assert "nothing is connected to the input 'body' of model axle" in capfd.readouterr().err


def test_two_hundred_parts_load_in_proportion_to_twenty(tmp_path: Path) -> None:
    """Ten times the parts take about ten times as long; a time in proportion to the square would be a hundred.

    Each time is the shortest of some. It leaves out what is loaded or compiled once, collections of garbage and the
    work of other threads.
    """
    seconds: dict[int, list[float]] = {20: [], 200: []}
    gc.disable()
    try:
        for count in (20, 20, 20, 200, 200):
            chain = (EXAMPLES / "chain.toml").read_text().replace("20", str(count))
            written(tmp_path, block=(EXAMPLES / "block.toml").read_text(), chain=chain)
            began = time.thread_time()
            model = hs.load(tmp_path / "chain.toml")
            seconds[count].append(time.thread_time() - began)
    finally:
        gc.enable()
    assert min(seconds[200]) < 30.0 * min(seconds[20])
    assert len(model.contacts) == 200
