"""`hybridsim study`: usage, and the whole on grids of a few points."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from cli.conftest import Outcome

from hybridsim.studies.he2026.measured import settings

CLAIMS = (
    "figure 3",
    "figure 4",
    "figure 5",
    "figure 6",
    "figure 7",
    "figures 8, 9",
    "figure 10",
    "figure 11",
    "figure 12",
    "figure 13",
    "text",
)
VERDICTS = {
    "reproduced",
    "reproduced in shape only",
    "not reproduced",
    "an artefact of discretization",
}


def test_an_unknown_study_is_bad_usage(hybridsim: Callable[..., Outcome]) -> None:
    outcome = hybridsim("study", "he2025")
    assert outcome.code == 2
    assert "he2026" in outcome.err


@pytest.mark.parametrize("option", ["--out", "--images"])
def test_a_file_is_no_folder(hybridsim: Callable[..., Outcome], tmp_path: Path, option: str) -> None:
    (tmp_path / "taken").write_text("")
    outcome = hybridsim("study", "he2026", option, "taken")
    assert outcome.code == 2
    assert option in outcome.err


@pytest.mark.slow
def test_the_whole_on_few_points(
    hybridsim: Callable[..., Outcome], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tiny = dataclasses.replace(
        settings.QUICK,
        periods=40,
        last=20,
        ratios=(0.54, 0.58, 0.7),
        r=(0.6, 0.8, 1.2),
        map_count=4,
        timed_count=4,
        timed_sample=4,
        ladder_count=2,
        steps=(300, 600, 1200, 1300),
        eps=(1e-3, 8e-4, 1e-4),
        timed_periods=10,
        repeats=1,
    )
    monkeypatch.setattr("hybridsim.studies.he2026.measured.he2026.QUICK", tiny)
    outcome = hybridsim("study", "he2026", "--quick", "--out", "page", "--images", "pictures", "--json")
    assert outcome.code == 0, outcome.err
    printed = json.loads(outcome.out)
    written = json.loads((tmp_path / "page" / "he2026.json").read_text())
    assert tuple(claim["name"] for claim in written["claims"]) == CLAIMS
    assert printed.keys() == written.keys()
    assert len(written["seconds"]) == 11
    for claim in written["claims"]:
        assert claim["verdict"] in VERDICTS
        assert claim["why"].endswith(".")
        assert claim["closest"]
        if claim["verdict"] == "an artefact of discretization":
            assert claim["step_study"]
    page = (tmp_path / "page" / "he2026.md").read_text()
    links = re.findall(r"\]\(([^)]+)\)", page)
    assert len(links) > len(CLAIMS)
    for link in links:
        assert (tmp_path / "page" / link).resolve().exists(), link
    for name in CLAIMS:
        assert f"| {name} |" in page
    assert "nan" not in page
