"""A law in a file of its own and tables of laws from CSV files: closed forms, and errors with their lines."""

from __future__ import annotations

import os
from math import log
from pathlib import Path

import pytest

import hybridsim as hs

BLOCK = """schema = 1
[states]
x = { start = 0, der = "v" }
v = { start = 3, der = "-f" }
[contacts.f]
velocity = "v"
normal = 10
law = { file = "pads/pad.toml", scale = 1 }
"""
PAD = """schema = 1
look = "how it falls"
[laws.pad]
parameters = ["scale"]
slip = "scale*mu*N"
stick = "scale*mu*N"
tables.mu = { file = "mu.csv", columns = ["v", "mu"], interpolation = "linear" }
"""
POINTS = "mu,v\n0.5,0\n0.4,1\n0.1,4\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pads").mkdir()
    for name, text in (("block.toml", BLOCK), ("pads/pad.toml", PAD), ("pads/mu.csv", POINTS)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def stop(model: hs.Model, integrator: str = "auto") -> float:
    return float(hs.simulate(model, (0, 3), integrator=integrator, rtol=1e-10).event_times("f")[0])


@pytest.mark.parametrize("integrator", ["exact", "taylor", "dop853"])
def test_a_table_on_a_straight_line(folder: Path, integrator: str) -> None:
    """mu = 0.5 - v/10 and N = 10: v' = v - 5, so that v = 5 - 2*exp(t) is zero at log(5/2)."""
    model = hs.load("block.toml")
    assert stop(model, integrator) == pytest.approx(log(2.5), rel=1e-9)
    assert hs.Model.from_toml(model.to_toml()) == model


def test_the_kink_of_a_table(folder: Path) -> None:
    """mu = 0.4 from v = 1 on: 3 falls to 1 in 2/4, and then v = 5 - 4*exp(t) to zero in log(5/4)."""
    (folder / "pads/mu.csv").write_text("v;mu\n0;0.5\n1;0.4\n9;0.4\n", encoding="utf-8")
    assert stop(hs.load("block.toml"), "exact") == pytest.approx(0.5 + log(1.25), rel=1e-12)


def test_a_file_that_changes_is_read_again(folder: Path) -> None:
    """Also if all files are too old for a change in the last moment."""
    for name, old, new in (
        ("pads/mu.csv", "0.5", "0.6"),
        ("pads/pad.toml", '"scale*mu*N"', '"0.5*scale*mu*N"'),
    ):
        for file in folder.rglob("*.*"):
            os.utime(file, (1e9, 1e9))
        before = hs.load("block.toml")
        assert hs.load("block.toml") == before
        path = folder / name
        path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
        assert hs.load("block.toml") != before


def test_one_file_for_all_ways_to_a_law(folder: Path) -> None:
    law = hs.load("block.toml").contacts[0].law
    assert hs.load_law("pads/pad.toml") == hs.load_law(Path("pads/pad.toml")) == law
    assert hs.Contact("f", "v", 1, "pads/pad.toml").law == law
    assert hs.load("dfcs").with_law("f", "pads/pad.toml", scale=2).contacts[0].law == law


@pytest.mark.parametrize(
    ("file", "old", "new", "place", "message"),
    [
        ("block.toml", "pad.toml", "pod.toml", "block.toml:8", "pod.toml: the file does not exist"),
        ("block.toml", '"pads/pad.toml"', "3", "block.toml:8", "'file' cannot be a number (3)"),
        ("block.toml", "scale = 1", "scal = 1", "block.toml:8", "no parameter 'scal'"),
        ("block.toml", "scale = 1", 'name = "pad"', "block.toml:8", "'name' and 'file' cannot be combined"),
        ("block.toml", "scale = 1", 'slip = "N"', "block.toml:8", "'slip' and 'file' cannot be combined"),
        ("pads/pad.toml", "scale*mu*N", "scale*nu*N", "pads/pad.toml:5", "unknown name 'nu'"),
        ("pads/pad.toml", "scale*mu*N", "scale*mu*(", "pads/pad.toml:5", "invalid expression"),
        ("pads/pad.toml", "stick", "stack", "pads/pad.toml:6", "unknown key 'stack'"),
        ("pads/pad.toml", "[laws.pad]", "[laws.pad", "pads/pad.toml:3", "invalid TOML"),
        ("pads/pad.toml", "look", "state", "pads/pad.toml:2", "unknown key 'state'"),
        ("pads/pad.toml", "[laws.pad]", "[laws.a]\nforce = 'v'\n[laws.b]", "pads/pad.toml", "declares 2 laws: a, b"),
        ("pads/pad.toml", "mu.csv", "nu.csv", "pads/pad.toml:7", "the file pads/nu.csv does not exist"),
        ("pads/pad.toml", '"v", "mu"', '"v", "m"', "pads/pad.toml:7", "mu.csv:1: column 'm' does not exist"),
        ("pads/pad.toml", '["v", "mu"]', "[0]", "pads/pad.toml:7", "'columns' cannot be [0]"),
        ("pads/pad.toml", "columns", "at = [0], columns", "pads/pad.toml:7", "'file' and 'at'"),
        ("pads/pad.toml", "linear", "lin", "pads/pad.toml:7", "`interpolation` cannot be 'lin'"),
        ("pads/mu.csv", "4\n", "0.5\n", "pads/pad.toml:7", "mu.csv:4: the arguments decrease from 1.0 to 0.5"),
        ("pads/mu.csv", "0.4,", "a,", "pads/pad.toml:7", "mu.csv:3: 'a' is not a number"),
        ("pads/mu.csv", ",4", ",1", "pads/pad.toml:7", "`at` is not ascending: 1 follows 1"),
    ],
)  # fmt: skip
def test_errors_name_the_file_and_the_line(
    folder: Path, file: str, old: str, new: str, place: str, message: str
) -> None:
    path = folder / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(hs.ModelError) as caught:
        hs.load("block.toml")
    places = [str(error).partition(": ")[0] for error in caught.value.errors]
    assert place in places and message in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "first", "remedy", "count"),
    [
        # the misspelt name is told, and not that the parameter which it means is unused
        ({"mu*N*exp(-v/v_s)": "mu*N*exp(-v/vz)"}, "pad.toml:3: law pad, slip: unknown name 'vz'", "'v_s'?", 1),
        # the misspelt key is told, and not that the key which it means is missing
        ({"stick": "stuck"}, "pad.toml:4: law pad: unknown key 'stuck'", "did you mean 'stick'?", 1),
        ({"v_s = 0.1": "v_s = 0.1, v_d = 1"}, "car.toml:7: contact f: the law 'pad' has no parameter", "'v_s'?", 1),
        # the line above the keys
        ({"[laws.pad]\n": ""}, "pad.toml:1: the file of a law: unknown 'parameters', ", "write the line [laws", 1),
        # both errors give the same remedy: correct the list of parameters
        (
            {'["mu", "v_s"]': '["mue", "v_s"]'},
            "pad.toml:3: law pad, slip: unknown name 'mu'",
            "add 'mu' to the `parameters` of the law",
            3,
        ),
        ({'"mu*N"': '"mu*N*v"'}, "pad.toml:4: law pad, stick: 'v' cannot be used here", "allowed here: N, mu, v_s", 1),
        # the law file comes first, because its errors may cause those of the model
        (
            {"-v/v_s": "-w/v_s", '"-f"': '"-f - k"'},
            "pad.toml:3: law pad, slip: unknown name 'w'",
            "to pass another quantity, add 'w' to the `parameters` of the law",
            2,
        ),
        ({"mu = 0.3, v_s = 0.1": "mu = 0.3"}, "car.toml:4: contact f: the law 'pad' needs a value for", "add v_s", 1),
    ],
)  # fmt: skip
def test_the_first_error_is_the_one_to_mend(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    changes: dict[str, str],
    first: str,
    remedy: str,
    count: int,
) -> None:
    monkeypatch.chdir(tmp_path)
    files = {
        "car.toml": '[states]\nx = { start = 0, der = "v" }\nv = { start = 1, der = "-f" }\n[contacts.f]\n'
        'velocity = "v"\nnormal = 10\nlaw = { file = "pad.toml", mu = 0.3, v_s = 0.1 }\n',
        "pad.toml": '[laws.pad]\nparameters = ["mu", "v_s"]\nslip = "mu*N*exp(-v/v_s)"\nstick = "mu*N"\n',
    }
    assert all(any(old in text for text in files.values()) for old in changes)
    for name, text in files.items():
        for old, new in changes.items():
            text = text.replace(old, new)
        Path(name).write_text(text, encoding="utf-8")
    with pytest.raises(hs.ModelError) as caught:
        hs.load("car.toml")
    assert str(caught.value.errors[0]).startswith(first)
    assert remedy in str(caught.value.errors[0].remedy)
    assert len(caught.value.errors) == count
