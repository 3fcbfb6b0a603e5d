"""`hybridsim report`: one page of one run, in a folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from report.parsed_page import ParsedPage, unpacked

import hybridsim as hs


def test_it_writes_the_page_of_the_run(hybridsim: Callable, tmp_path: Path) -> None:
    line = ["report", "dfcs", "-p", "F0=22", "--t-end", "0.05", "--integrator", "dop853", "--rtol", "1e-8"]
    found = hybridsim(*line, "--out", "pages")
    assert found.code == 0 and found.out.startswith("dfcs: Single-degree-of-freedom")
    (path,) = (tmp_path / "pages").iterdir()
    assert path.name == "dfcs.html" and "wrote pages/dfcs.html" in found.err
    page = ParsedPage(path.read_text(encoding="utf-8"))
    run = hs.simulate("dfcs", (0, 0.05), params={"F0": 22}, integrator="dop853", rtol=1e-8)
    assert unpacked(page.data["events"]["t"]).tolist() == [event.t for event in run.events]
    assert page.text_of("again-command") == (
        "hybridsim run dfcs -p F0=22.0 --t-end 0.05 --integrator dop853 --rtol 1e-08"
    )


def test_a_folder_that_cannot_be_made_costs_no_run(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    found = hybridsim("report", "dfcs", "--out", "file")
    assert found.code == 2 and "--out" in found.err and found.out == ""


def test_a_run_that_stops_is_reported_too(hybridsim: Callable, tmp_path: Path) -> None:
    found = hybridsim(
        "report", "dfcs", "--limit", "events=5", "--integrator", "scipy-dop853", "--t-end", "0.1"
    )
    assert found.code == 1 and (tmp_path / "report-dfcs" / "dfcs.html").exists()
