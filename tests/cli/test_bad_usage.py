"""Bad command lines: exit code 2, a message with the value and what to do, no traceback, nothing is run."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

# The command line, and what its message must hold.
BAD = {
    "no command": ([], ["COMMAND", "--help"]),
    "unknown command": (["rum", "dfcs"], ["rum", "run"]),
    "no model": (["run"], ["MODEL"]),
    "two models": (["run", "dfcs", "belt"], ["belt"]),
    "unknown option of the command": (
        ["run", "dfcs", "--intgrator", "auto"],
        ["--intgrator", "--integrator"],
    ),
    "abbreviated option": (["run", "dfcs", "--integ", "auto"], ["--integ", "--integrator"]),
    "option without a value": (["run", "dfcs", "--rtol"], ["--rtol"]),
    "unknown integrator": (["run", "dfcs", "--integrator", "scipy-dop583"], ["scipy-dop583", "scipy-dop853"]),
    "unknown integrator option": (["run", "dfcs", "--option", "ordr=3"], ["ordr"]),
    "run option as an integrator option": (
        ["run", "dfcs", "--integrator", "dop853", "--option", "rtoll=1e-9"],
        ["--option rtoll: integrator 'dop853' has no such option", "did you mean --rtol?"],
    ),
    "integrator option near a known one": (
        ["run", "dfcs", "--integrator", "rk4-dichotomy", "--option", "step_per_period=600"],
        ["step_per_period", "steps_per_period"],
    ),
    "integrator option of a wrong kind": (
        ["run", "dfcs", "--integrator", "rk4-dichotomy", "--option", "steps_per_period=many"],
        ["steps_per_period", "many"],
    ),
    "integrator option out of range": (
        ["run", "dfcs", "--integrator", "rk4-dichotomy", "--option", "stick_velocity=half"],
        ["stick_velocity", "half", "kept", "zero"],
    ),
    "option without a name": (["run", "dfcs", "--option", "600"], ["600", "NAME=VALUE"]),
    "negative t-end": (["run", "dfcs", "--t-end", "-5"], ["-5", "above zero"]),
    "negative number of periods": (["run", "dfcs", "--t-end", "-5T"], ["-5T", "above zero"]),
    "t-end of zero": (["run", "dfcs", "--t-end", "0"], ["0", "above zero"]),
    "t-end that is no time": (["run", "dfcs", "--t-end", "soon"], ["soon"]),
    "t-end with a unit": (["run", "dfcs", "--t-end", "5h"], ["5h", "time unit", "20T"]),
    "t-end that is infinite": (["run", "dfcs", "--t-end", "1e999"], ["1e999"]),
    "periods of a model without": (["run", "bouncing-ball", "--t-end", "5T"], ["bouncing-ball", "period"]),
    "negative tolerance": (["run", "dfcs", "--rtol", "-1e-6"], ["--rtol", "-1e-6"]),
    "tolerance that is no number": (["run", "dfcs", "--rtol", "tight"], ["--rtol", "tight"]),
    "NaN tolerance": (["run", "dfcs", "--rtol", "nan"], ["--rtol", "nan"]),
    "infinite step": (["run", "dfcs", "--max-step", "inf"], ["--max-step", "inf"]),
    "unknown parameter": (["run", "dfcs", "-p", "omga=3"], ["omga", "omega"]),
    "parameter without a value": (["run", "dfcs", "-p", "N="], ["N=", "NAME=VALUE"]),
    "parameter without a name": (["run", "dfcs", "-p", "40"], ["40", "NAME=VALUE"]),
    "parameter given twice": (["run", "dfcs", "-p", "N=4", "-p", "N=5"], ["N", "twice"]),
    "NaN for a parameter": (["run", "dfcs", "-p", "N=nan"], ["N", "nan"]),
    "unknown name in a parameter": (["run", "dfcs", "-p", "omega=0.6*sqrt(kk/m)"], ["kk", "omega"]),
    "circle made by a parameter": (["run", "dfcs", "-p", "k=omega**2"], ["k", "omega"]),
    "code in a parameter": (["run", "dfcs", "-p", "N=open('canary','w')"], ["open"]),
    "negative normal load": (["run", "dfcs", "-p", "N=-40"], ["N", "-40"]),
    "unknown state": (["run", "dfcs", "--x0", "y=1"], ["y", "x"]),
    "state as a parameter": (["run", "dfcs", "-p", "x=1"], ["'x' is a state", "--x0 x=VALUE"]),
    "parameter as a state": (["run", "dfcs", "--x0", "F0=1"], ["'F0' is a parameter", "-p F0=VALUE"]),
    "picture of an unknown kind": (["run", "dfcs", "--plot", "out.doc"], ["'.doc'", ".png"]),
    "what is kept in place of a file": (
        ["run", "dfcs", "--save", "last-period"],
        ["--save", "last-period", "run.hsol", "--keep last-period"],
    ),
    "picture without an ending": (["run", "dfcs", "--plot", "out"], ["out", ".png"]),
    "picture in no folder": (["run", "dfcs", "--plot", "nowhere/out.png"], ["nowhere"]),
    "points of no table": (["run", "dfcs", "--points", "9"], ["--points", "--csv"]),
    "one point": (["run", "dfcs", "--csv", "x.csv", "--points", "1"], ["--points cannot be 1", "at least 2"]),
    "arrays into a table": (["run", "dfcs", "--npz", "x.csv"], ["--npz", ".csv", ".npz"]),
    "table into a folder": (["run", "dfcs", "--csv", "."], ["--csv", "folder"]),
    "unknown integrator to compare": (
        ["compare", "dfcs", "--integrators", "cvode-bfd"],
        ["cvode-bfd", "cvode-bdf"],
    ),
    "empty name among integrators": (["compare", "dfcs", "--integrators", "cvode-bdf,"], ["cvode-bdf,"]),
    "no number among tolerances": (["compare", "dfcs", "--rtol", "1e-4,fine"], ["fine"]),
    "no repetition": (["compare", "dfcs", "--repeat", "0"], ["--repeat", "0"]),
    "folder whose name is too long": (["compare", "dfcs", "--out", "x" * 300], ["--out", "too long"]),
    "unknown action on the cache": (["cache", "empty"], ["empty", "clear"]),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_usage(case: str, hybridsim: Callable, tmp_path: Path) -> None:
    argv, fragments = BAD[case]
    code, out, err = hybridsim(*argv)
    assert code == 2, err
    assert out == ""
    assert "Traceback" not in err and "internal error" not in err
    assert all(fragment in err for fragment in fragments), err
    assert len(err.splitlines()) > 1, f"no remedy: {err}"
    assert list(tmp_path.iterdir()) == []


def test_a_held_input_as_a_parameter(hybridsim: Callable, tmp_path: Path) -> None:
    """The remedy of the error works: x' = u gives x(2) = 2*u."""
    (tmp_path / "driven.toml").write_text(
        'schema = 1\nname = "driven"\n[inputs]\nu = { kind = "held", value = 1 }\n'
        'w = { kind = "wave", shape = "sine", period = 1, amplitude = 0 }\n'
        '[states]\nx = { start = 0, der = "u + w" }\n'
    )
    code, _, err = hybridsim("run", "driven.toml", "-p", "u=12")
    assert code == 2 and "'u' is a held input" in err and "--x0 u=VALUE" in err
    code, out, _ = hybridsim(
        "run", "driven.toml", "--x0", "u=12", "--t-end", "2", "--json", "--integrator", "dop853"
    )
    assert code == 0 and json.loads(out)["final"]["x"] == pytest.approx(24, rel=1e-9)
    code, _, err = hybridsim("run", "driven.toml", "-p", "w=12")
    assert code == 2 and "'w' is an input of kind 'wave'" in err


@pytest.mark.parametrize("command", ["run", "compare", "check"])
@pytest.mark.parametrize(
    ("model", "fragments"),
    [
        ("dfsc", ["dfsc", "'dfcs'"]),
        ("nowhere/my.toml", ["nowhere/my.toml", "does not exist"]),
        ("", ["''"]),
        ("../dfcs", ["../dfcs"]),
        ("my\0.toml", ["my", "null"]),
    ],
)
def test_no_such_model(command: str, model: str, fragments: list[str], hybridsim: Callable) -> None:
    code, out, err = hybridsim(command, model)
    assert (code, out) == (3, "")
    assert "Traceback" not in err and "internal error" not in err
    assert all(fragment in err for fragment in fragments), err
    assert len(err.splitlines()) > 1, f"no remedy: {err}"


def test_folder_in_place_of_a_model(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").mkdir()
    code, _, err = hybridsim("run", tmp_path / "scene.toml")
    assert code in (2, 3)
    assert "scene.toml" in err and "folder" in err


def test_model_that_may_not_be_read(hybridsim: Callable, tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text("schema = 1\n")
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read every file")  # as root does, whom no permission stops
    code, _, err = hybridsim("run", path)
    assert code in (2, 3)
    assert "scene.toml" in err


def test_results_into_a_file_in_place_of_a_folder(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    code, _, err = hybridsim("compare", "dfcs", "--out", "taken/here")
    assert code == 2
    assert "taken is a file, not a folder" in err


def test_picture_where_nothing_may_be_written(hybridsim: Callable, tmp_path: Path) -> None:
    folder = tmp_path / "closed"
    folder.mkdir(mode=0o500)
    if os.access(folder, os.W_OK):
        pytest.skip("this user may write everywhere")  # as root does, whom no permission stops
    code, _, err = hybridsim("run", "dfcs", "--plot", folder / "out.png")
    assert code == 2
    assert "no permission to write" in err
