"""Small matrices: verdicts that are known, limits, an integrator of one's own, JSON and pages."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import ClassVar

import pytest
from integrators.tsitouras import Tsitouras

import hybridsim as hs
from hybridsim.errors import UsageError
from hybridsim.plot.atlas import scene as picture
from hybridsim.testing import SCENES, clock, conformance_failures, measuring, outcome
from hybridsim.testing import suite as suites
from hybridsim.testing.atlas import Atlas, atlas, configurations, example, pages, scenes_named
from hybridsim.testing.atlas import cell as cells
from hybridsim.testing.atlas.cell import Cell, Row
from hybridsim.testing.atlas.configurations import chosen
from hybridsim.testing.atlas.pages import anchor, verdicts

DOCS = Path(__file__).parents[2] / "docs" / "atlas"
CHOSEN = ("exact", "rk4-sign", "scipy-rk45 native", "rk4 tanh", "rk4 karnopp")


@pytest.fixture(scope="module")
def small() -> Atlas:
    return atlas(scenes_named(("FREE-1", "SCI-cubic", "box-from-the-side")), CHOSEN)


def test_known_verdicts(small: Atlas) -> None:
    assert [one.name for one in small.configurations] == [
        "exact", "rk4-sign", "scipy-rk45 native", "rk4 tanh", "rk4 karnopp",
    ]  # fmt: skip
    found = {scene.name: [cell.verdict for cell in small.row(scene)] for scene in small.scenes}
    assert found["SCI-cubic"] == ["right", "right", "wrong mode sequence", "not run", "not run"]
    assert found["box-from-the-side"] == ["right", "right", "wrong mode sequence", "not run", "not run"]
    assert found["FREE-1"] == ["right", "wrong mode sequence", "right", "wrong answer", "right"]


def test_the_class_of_trouble_chooses_scenes() -> None:
    assert {scene.trouble for scene in scenes_named((), "sliding")} == {"sliding"}
    assert scenes_named(()) == SCENES


def test_an_integrator_brings_its_variants_and_no_other_model() -> None:
    named = [one.name for one in chosen(("rk4-dichotomy", "rk4-sign", "scipy-rk45"))]
    assert named == ["scipy-rk45", "rk4-dichotomy", "rk4-dichotomy refined", "rk4-sign", "scipy-rk45 native"]
    with pytest.raises(UsageError) as caught:
        chosen(("no such thing",))
    assert f"{len(configurations())} in all" in str(caught.value)


def test_names_that_do_not_exist_are_refused_with_the_nearest() -> None:
    with pytest.raises(UsageError, match="SCI-cubic"):
        scenes_named(("SCI-cubik",))
    with pytest.raises(UsageError, match="sliding"):
        scenes_named((), "slidding")
    with pytest.raises(UsageError, match="rk4-sign"):
        atlas(scenes_named(("FREE-1",)), ("rk4-sing",))


def test_a_run_without_end_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """An explicit method on stiff friction, with next to no time allowed."""
    monkeypatch.setattr(cells, "SECONDS", 0.2)
    (cell,) = atlas(scenes_named(("TANH-1e-6",)), ("dop853",)).cells.values()
    assert cell.verdict == "hang (bounded)"


def test_a_class_of_ones_own_is_judged_without_being_registered() -> None:
    scenes = scenes_named(("NOS-cross", "SCI-cannon", "FREE-1"))
    assert conformance_failures(Tsitouras, scenes) == []
    assert {cell.verdict for cell in atlas(scenes, (Tsitouras,)).cells.values()} == {"right"}
    assert Tsitouras.name not in {one.name for one in hs.list_integrators()}


def test_a_class_that_is_wrong_is_found_wrong() -> None:
    class Late(Tsitouras):
        name: ClassVar[str] = "late"

        def start(self, flow, x0, *rest):
            return super().start(flow, x0 * (1 + 1e-5), *rest)

    scene = scenes_named(("NOS-cross",))[0]
    found = outcome(Late, scene)
    assert found.verdict == "wrong answer" and found.failed
    (cell,) = atlas([scene], [Late]).cells.values()
    assert cell.verdict == found.verdict and cell.reason in found.reasons


def test_what_does_not_come_to_an_end_is_called_so_by_both(monkeypatch: pytest.MonkeyPatch) -> None:
    class Asleep(Tsitouras):
        name: ClassVar[str] = "asleep"

        def start(self, flow, x0, *rest):
            while True:
                sum(range(1000))

    monkeypatch.setattr(clock, "BACKSTOP", 1000.0)  # the machine may be busy with something else
    monkeypatch.setattr(suites, "carry_out", partial(suites.carry_out, seconds=0.3))
    monkeypatch.setattr(cells, "SECONDS", 0.15)
    scene = scenes_named(("NOS-cross",))[0]
    found = outcome(Asleep, scene)
    (cell,) = atlas([scene], [Asleep]).cells.values()
    assert found.verdict == cell.verdict == "hang (bounded)"
    assert found.reasons == ("rtol 1e-06: no end after 0.3 s of processor time",) == (cell.reason,)


def test_a_name_that_is_taken_is_refused() -> None:
    taken = type("Mine", (Tsitouras,), {"name": "dop853"})
    with pytest.raises(UsageError, match="dop853"):
        outcome(taken, SCENES[0])


def test_all_that_people_use_is_in_the_matrix() -> None:
    names = {one.name for one in configurations()}
    assert {one.name for one in hs.list_integrators()} <= names
    assert {"rk4-dichotomy refined", "scipy-lsoda native", "rk4 tanh", "rk4 karnopp"} <= names
    assert len(names) >= 12


def test_json_is_read_back_as_it_was(small: Atlas) -> None:
    again = Atlas.from_json(small.to_json())
    assert again.to_json() == small.to_json()
    assert json.loads(small.to_json())["cells"][0]["verdict"] == "right"


def test_the_index_has_a_symbol_for_every_cell(small: Atlas) -> None:
    """The number of each symbol is that of its verdict, and a row begins with a link to the scene."""
    table = [line for line in pages(small)["index.md"].split("## Verdicts")[1].splitlines() if "|" in line]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    assert rows[0] == ["scene", *(one.name for one in small.configurations)]
    symbols = {row[0].partition("]")[0].lstrip("["): row[1:] for row in rows if row[0].startswith("[")}
    assert symbols == {
        "FREE-1": ["✓", "**≠**", "✓", "**✗**", "✓"],
        "SCI-cubic": ["✓", "✓", "**≠**", "", ""],
        "box-from-the-side": ["✓", "✓", "**≠**", "", ""],
    }


def test_an_example_shows_the_true_motion_and_the_failing_one(small: Atlas) -> None:
    scene = next(one for one in small.scenes if one.name == "SCI-cubic")
    found = example(small, scene)
    assert found is not None and found.failing is not None
    assert (found.failing.name, len(found.right.events)) == ("scipy-rk45 native", 2)
    assert len(found.failing.events) < 2  # none or one: sums of products differ from processor to processor
    assert found.points[-1] == (0.0, -24.0)
    axes = picture(found)
    assert axes.get_ylabel() == "y"
    assert axes.figure.axes[-1].get_xlabel() == "t"  # nothing has a unit in this scene
    assert picture(replace(found, time="s")).figure.axes[-1].get_xlabel() == "t [s]"


def test_ctrl_c_ends_a_picture_too(small: Atlas, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that Ctrl-C ends is no example: `simulate` returns what it has, and the atlas does not go on with it."""

    def interrupt(fraction: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(measuring, "ProcessorTime", lambda seconds: interrupt)
    with pytest.raises(KeyboardInterrupt):
        example(small, small.scenes[0])
    stopped = atlas(small.scenes, ("scipy-rk45",))
    assert stopped.interrupted and stopped.scenes == ()


def test_pages_tell_of_every_scene(small: Atlas) -> None:
    found = pages(small, {"FREE-1"})
    assert set(found) == {"index.md", "events.md", "stick.md"}
    assert "(stick/FREE-1.png)" in found["stick.md"]
    assert "**wrong mode sequence** | rk4-sign" in found["stick.md"]
    assert "| `rk4-sign` |" in found["index.md"]
    for scene in small.scenes:  # the index leads to the section of each
        ((file, place),) = re.findall(rf"\[{scene.name}\]\((\w+\.md)#([^)]+)\)", found["index.md"])
        headings = re.findall(r"^## (.+)$", found[file], re.MULTILINE)
        assert [anchor(heading) for heading in headings].count(place) == 1


def test_a_reason_is_read_easily_and_a_stop_by_design_says_so() -> None:
    """Nine digits of a time, no order of an error that does not fall, and what `moreau` says of reversals."""
    (moreau,) = chosen(("moreau",))
    said = "unit/4800: event 2 should be f:slip- at t = 5.34544081677444, and is f:stick at t = 5.344786318305168"
    rows = (Row("unit/4800", 1.0, 1e-3, 1, 0.0), Row("unit/19200", 1.0, 1e-3, 1, 0.0))
    cell = Cell("DH-r2-f0.2", "moreau", "wrong mode sequence", said, rows, order=-0.02)
    line = verdicts([cell], (moreau,))[-1]
    assert "t = 5.34544082, and is f:stick at t = 5.34478632 (by design: events are not located" in line
    assert "order" not in line and "order 0.9" in verdicts([replace(cell, order=0.9)], (moreau,))[-1]
    assert (
        "by design" not in verdicts([replace(cell, reason=said.replace("f:stick", "f:slip+"))], (moreau,))[-1]
    )


def test_the_pages_in_docs_are_those_of_its_data() -> None:
    kept = Atlas.from_json((DOCS / "atlas.json").read_text(encoding="utf-8"))
    pictures = {path.stem for path in DOCS.glob("*/*.png")}
    for name, text in pages(kept, pictures).items():
        assert (DOCS / name).read_text(encoding="utf-8") == text, f"write {name} again"
    assert kept.scenes == SCENES


def test_our_best_integrators_are_wrong_in_no_scene_of_docs() -> None:
    kept = Atlas.from_json((DOCS / "atlas.json").read_text(encoding="utf-8"))
    for one in kept.configurations:
        if one.name in ("exact", "taylor", "dop853"):
            assert [c.scene for c in kept.column(one) if c.verdict.startswith("wrong")] == []


def test_pictures_are_small() -> None:
    sizes = [path.stat().st_size for path in DOCS.rglob("*") if path.is_file()]
    assert sum(sizes) < 3e6


def test_a_scene_of_ones_own_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('[states]\nx = { start = 1, der = "-x" }\n', encoding="utf-8")
    mine = replace(scenes_named(("NOS-cross",))[0], name="mine", file=str(path), truth=hs_truth())
    assert outcome("dop853", mine).verdict == "right"


def hs_truth() -> object:
    from math import exp

    from hybridsim.testing import Truth

    return Truth((), ((1.0, (exp(-1.0),)), (1.5, (exp(-1.5),))))
