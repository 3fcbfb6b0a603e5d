"""`compare --suite` and `compare --regularized` from the command line."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import pytest

PNG = b"\x89PNG"


def test_the_suite_prints_a_table_and_fills_its_folder(hybridsim: Callable, tmp_path: Path) -> None:
    argv = ("--integrators", "dop853,rk4-sign", "--rtol", "1e-6,1e-9", "--steps", "600", "--repeat", 1)
    code, out, err = hybridsim("compare", "--suite", "--scenes", "P1,bouncing-ball", *argv, "--budget", 100)
    assert code == 0, err
    assert "Correct runs" in out and "bouncing-" in out and "of 100 s" in out
    folder = tmp_path / "compare-suite"
    assert (folder / "suite.png").read_bytes().startswith(PNG)
    with (folder / "table.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 6
    assert set(json.loads((folder / "comparison.json").read_text())["scenes"]) == {"P1", "bouncing-ball"}


def test_regularised_forms(hybridsim: Callable, tmp_path: Path) -> None:
    argv = ("--regularized", "tanh", "--v0", "1e-2,1e-3,1e-4", "--integrators", "dop853", "--repeat", 1)
    code, out, err = hybridsim("compare", "dfcs", "--t-end", "2T", *argv, "--out", "forms")
    assert code == 0, err
    assert "tanh, dop853: error ~ v0^" in out
    assert (tmp_path / "forms" / "chart.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize(
    "argv, message",
    [
        (["compare"], "add a model"),
        (["compare", "dfcs", "--suite"], "MODEL cannot be combined with --suite"),
        (["compare", "--suite", "-p", "F0=3"], "-p cannot be combined with --suite"),
        (["compare", "--suite", "--t-end", "5T"], "--t-end cannot be combined with --suite"),
        (["compare", "--suite", "--regularized", "tanh"], "--regularized cannot be combined with --suite"),
        (["compare", "--suite", "--scenes", "P1,P9"], "no scene 'P9'"),
        (["compare", "dfcs", "--scenes", "P1"], "--scenes requires --suite"),
        (["compare", "--suite", "--budget", "0"], "--budget"),
        (["compare", "dfcs", "--v0", "1e-3"], "`v0` requires `regularized`"),
        (["compare", "dfcs", "--regularized", "tan"], "`regularized` cannot contain 'tan'"),
    ],
)
def test_bad_usage(hybridsim: Callable, argv: list[str], message: str) -> None:
    code, out, err = hybridsim(*argv)
    assert (code, out) == (2, "")
    assert message in err
