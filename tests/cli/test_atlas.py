"""`hybridsim atlas`: usage, and a small matrix with its folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from cli.conftest import Outcome

from hybridsim.testing import SCENES, TROUBLES


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("SCI-cubik",), "SCI-cubic"),
        (("--class", "slidding"), "sliding"),
        (("FREE-1", "--class", "stick"), "cannot be combined"),
        (("FREE-1", "--integrators", "rk4-sing"), "rk4-sign"),
        (("FREE-1", "--workers", "0"), "--workers"),
        (("FREE-1", "--workers", "1" + 12 * "0"), "at most 1024"),
    ],
)
def test_bad_usage_names_what_is_near(
    hybridsim: Callable[..., Outcome], words: tuple[str, ...], said: str
) -> None:
    outcome = hybridsim("atlas", *words)
    assert outcome.code == 2
    assert said in outcome.err


def test_a_file_is_no_folder(hybridsim: Callable[..., Outcome], tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    outcome = hybridsim("atlas", "FREE-1", "--out", "taken")
    assert outcome.code == 2
    assert "--out" in outcome.err


def test_a_small_matrix_fills_its_folder(hybridsim: Callable[..., Outcome], tmp_path: Path) -> None:
    words = ("FREE-1", "box-from-the-side", "--integrators", "exact,scipy-rk45", "--workers", "1", "--json")
    outcome = hybridsim("atlas", *words)
    assert outcome.code == 0
    cells = {(cell["scene"], cell["configuration"]): cell for cell in json.loads(outcome.out)["cells"]}
    assert cells["FREE-1", "exact"]["verdict"] == "right"
    assert cells["box-from-the-side", "scipy-rk45 native"]["verdict"] == "wrong mode sequence"
    assert cells["box-from-the-side", "scipy-rk45"]["rows"][0][3] > 0
    written = {str(path.relative_to(tmp_path / "atlas")) for path in (tmp_path / "atlas").rglob("*.*")}
    assert written == {
        "atlas.json", "index.md", "events.md", "stick.md",
        "events/box-from-the-side.png", "stick/FREE-1.png",
    }  # fmt: skip
    assert "wrote atlas/index.md" in outcome.err


def test_list_prints_the_scenes_by_class_and_runs_nothing(
    hybridsim: Callable[..., Outcome], tmp_path: Path
) -> None:
    outcome = hybridsim("atlas", "--list")
    assert (outcome.code, outcome.err) == (0, "")
    blocks = [block.splitlines() for block in outcome.out.split("\n\n")]
    assert [block[0].partition(":")[0] for block in blocks] == list(TROUBLES)
    listed = [line.split(maxsplit=1) for block in blocks for line in block[1:]]
    assert {name: title.strip() for name, title in listed} == {scene.name: scene.title for scene in SCENES}
    assert list(tmp_path.iterdir()) == []


def test_list_of_a_class_as_json(hybridsim: Callable[..., Outcome]) -> None:
    found = json.loads(hybridsim("atlas", "--list", "--class", "sliding", "--json").out)
    assert {one["class"] for one in found} == {"sliding"}
    assert {one["name"] for one in found} == {s.name for s in SCENES if s.trouble == "sliding"}
    assert all(one["title"] and one["cause"] for one in found)
    assert hybridsim("atlas", "--list", "SCI-cubik").code == 2
