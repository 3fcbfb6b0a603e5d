"""Models and laws by name and by path, and files that are no models."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.model import library
from hybridsim.model.library import list_laws, models_folder

WANTED = {
    "dfcs", "dfcs-stribeck", "belt", "free-decay", "static-kinetic", "bouncing-ball", "thermostat", "square-wave",
    "sampled-servo", "base-isolation", "feeny-moon", "blade-damper", "drill-string", "pid-servo", "valve-stiction",
    "lugre-presliding", "clutches", "relay-control", "sliding-circle", "relay-spiral", "relay-pair", "chua",
    "twisting-controller",
}  # fmt: skip


def test_all_packaged_models_are_listed_and_load() -> None:
    found = {info.name: info for info in hs.list_models()}
    assert found.keys() >= WANTED
    for name, info in found.items():
        model = hs.load(name)
        assert model.name == name
        assert model.title == info.title


@pytest.mark.parametrize("name", [info.name for info in hs.list_models()])
def test_each_says_what_it_is_where_it_is_from_and_what_to_look_at(name: str) -> None:
    model = hs.load(name)
    assert len(model.title) > 10 and len(model.source) > 10 and len(model.look) > 40
    first = (
        next(info.path for info in hs.list_models() if info.name == name).read_text("utf-8").splitlines()[0]
    )
    assert first.startswith("# ") and first.endswith(".")


@pytest.mark.parametrize("name", list_laws())
def test_laws_load_and_are_sound(name: str) -> None:
    law = hs.load_law(name)
    assert law.name == name and law.title and law.source
    assert set(law.parameters.values()) == {None}, "a value of friction is never assumed"
    given = {"mu": 0.3, "mu_s": 0.5, "mu_k": 0.3, "v_s": 0.1, "n": 3, "share": 0.7}
    contact = hs.Contact("f", "v", 2, law, {p: given.get(p, 1.5) for p in law.parameters})
    hs.Model("m", [hs.State("v", 1, "-f")], contacts=[contact]).validate()


def test_the_reference_system_is_table_1() -> None:
    values = hs.load("dfcs").parameter_values()
    assert values == {
        "m": 0.2, "c": 5.65, "k": 1e5, "mu": 0.5, "N": 40, "F0": 30, "omega": 0.6 * (1e5 / 0.2) ** 0.5,
    }  # fmt: skip
    assert hs.load("dfcs").start_values() == {"x": 0, "v": 0}


def test_unknown_model_names_the_near_ones() -> None:
    with pytest.raises(hs.ModelError) as caught:
        hs.load("dfsc")
    assert "'dfsc'" in str(caught.value) and "'dfcs'" in str(caught.value)
    with pytest.raises(hs.ModelError, match="there is no model 'qqqq'") as caught:
        hs.load("qqqq")
    names = sorted(info.name for info in hs.list_models())
    assert all(name in str(caught.value) for name in names[:12])
    assert f"({len(names)} in all)" in str(caught.value)


def test_unknown_law() -> None:
    with pytest.raises(hs.ModelError, match=r"did you mean 'stribeck'.* your own law pass"):
        hs.load_law("stribek")


@pytest.mark.parametrize("name", ["../pyproject", "laws/coulomb", "", ".", "dfcs\0", "/etc/passwd"])
def test_names_do_not_leave_the_folder(name: str) -> None:
    with pytest.raises(hs.ModelError) as caught:
        hs.load(name)
    assert caught.value.remedy


def write(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "the file is empty"),
        (b" \n\n", "the file is empty"),
        (b"\x7fELF\x02\x01\x01\0\0\xff\xfe", "not a text file"),
        (b"x = 1\ny = '\xe9'\n", "0xe9 at offset 11"),
        (b"\xff\xfex\0", "not a text file"),
        (b"#" * 1_000_001, "1000001 bytes, but at most 1000000 are allowed"),
        (b"states = [", "invalid TOML"),
        (b"a = 1\na = 2\n", "invalid TOML: cannot overwrite a value"),
        (b"a = " + b"[" * 900_000, "nested too deeply"),
        (b"a = " + b"9" * 5000, "invalid TOML"),
        (b"\0", "invalid TOML"),
    ],
)
def test_files_that_are_no_models(data: bytes, message: str, tmp_path: Path) -> None:
    path = write(tmp_path / "scene.toml", data)
    with pytest.raises(hs.ModelError) as caught:
        hs.load(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert caught.value.remedy


def test_a_folder_and_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(hs.ModelError, match="the path is a folder"):
        hs.load(tmp_path)
    write(tmp_path / "scene.toml", b"")
    with pytest.raises(hs.ModelError, match=r"the file does not exist\ndid you mean 'scene.toml'"):
        hs.load(tmp_path / "scen.toml")


def test_inside_a_wheel_the_models_lie_in_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "hybridsim"
    (package / "models").mkdir(parents=True)
    (package / "model").mkdir()
    monkeypatch.setattr(library, "__file__", str(package / "model" / "library.py"))
    assert models_folder() == package / "models"
    (package / "models").rmdir()
    assert models_folder() == tmp_path / "models"
