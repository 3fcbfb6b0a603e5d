"""With `--json` standard output holds one JSON document and nothing else, whatever runs beneath."""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.cli import main
from hybridsim.cli.entry import build_parser

INTEGRATORS = [integrator.name for integrator in hs.list_integrators()]
# CVODE may warn on these of steps that are rounded away
MODELS = {"clutches": "0.3", "dfcs": "2T", "square-wave": "0.5", "bouncing-ball": "1"}


def document(words: list[str], capfd: pytest.CaptureFixture[str], codes: tuple[int, ...] = (0,)) -> object:
    """What a command line prints, read strictly; the standard output of C is looked at, too."""
    capfd.readouterr()
    code = main(words)
    out, err = capfd.readouterr()
    assert code in codes, err
    if code == 2 and not out:  # refused by name, such as a method without impacts
        return None
    return strict(out)


def strict(text: str) -> Any:
    """A JSON document, without the numbers that only Python reads."""
    return json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_runs(
    integrator: str, capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for model, end in MODELS.items():
        words = [
            "run",
            model,
            "--t-end",
            end,
            "--integrator",
            integrator,
            "--json",
            "--limit",
            "steps=100000",
        ]
        found = document(words, capfd, codes=(0, 1, 2))
        assert found is None or (isinstance(found, dict) and found["integrator"] == integrator)


# a line for each subcommand that has --json, in a folder with a run that is kept as run.hsol
CASES = {
    "run": ["run", "square-wave", "--t-end", "0.5"],
    "resume": ["resume", "run.hsol", "--t-end", "0.2"],
    "compare": [
        *("compare", "clutches", "--integrators", "cvode-adams,cvode-bdf,dop853", "--t-end", "0.3"),
        *("--rtol", "1e-4,1e-6", "--repeat", "1", "--out", "c"),
    ],
    "advise": ["advise", "dfcs", "--quantity", "amplitude.x", "--rungs", "no-friction", "--no-integrators"],
    "report": ["report", "dfcs", "--t-end", "0.01"],
    "fit": ["fit", "free-decay", "record.csv", "--unknown", "mu=0.05:0.5"],
    "steady": ["steady", "dfcs"],
    "sweep": ["sweep", "dfcs", "F0=20,30", "--measure", "amplitude.x", "--out", "s"],
    "study": ["study", "he2026", "--quick"],
    "atlas": ["atlas", "FREE-1", "--integrators", "exact", "--workers", "1"],
    "check": ["check", "clutches"],
    "models": ["models"],
    "integrators": ["integrators", "cvode-bdf"],
}
WITHOUT_JSON = {"cache", "explain-status", "schema"}  # the schema is JSON by itself
FAULTY = {
    "run": ["run", "dfsc"],
    "resume": ["resume", "none.hsol"],
    "report": ["report", "dfsc"],
    "fit": ["fit", "free-decay", "none.csv", "--unknown", "mu=0.05:0.5"],
    "compare": ["compare", "dfcs", "--integrators", "exakt"],
    "advise": ["advise", "dfcs", "--quantity", "amplitud.x"],
    "steady": ["steady", "dfcs", "--tol", "-1"],
    "sweep": ["sweep", "dfcs", "F9=20,30"],
    "study": ["study", "he2025"],
    "atlas": ["atlas", "FREE-0"],
    "check": ["check", "dfsc"],
    "models": ["models", "dfcs"],
    "integrators": ["integrators", "exakt"],
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of one's own, in which the study takes no time: its numbers are of the kinds that JSON has not."""
    monkeypatch.chdir(tmp_path)
    numbers = {"nothing": math.nan, "all": np.array([1.0, math.inf]), "count": np.int64(3)}
    monkeypatch.setattr(
        "hybridsim.studies.he2026.measured.he2026",
        lambda **keywords: SimpleNamespace(to_plain=lambda: numbers),
    )
    monkeypatch.setattr("hybridsim.cli.commands.study._write", lambda *arguments: None)
    return tmp_path


def test_every_subcommand_is_among_the_cases() -> None:
    (commands,) = (a for a in build_parser()._actions if isinstance(a, argparse._SubParsersAction))
    has_json = {name: "--json" in parser._option_string_actions for name, parser in commands.choices.items()}
    assert {name for name, has in has_json.items() if has} == CASES.keys() == FAULTY.keys()
    assert {name for name, has in has_json.items() if not has} == WITHOUT_JSON


@pytest.mark.parametrize("command", CASES)
def test_every_subcommand_prints_one_document_whatever_libraries_print(
    command: str, folder: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside the command something prints by Python and by the descriptor of C, and warns."""
    if command == "resume":
        hs.simulate("dfcs", (0, 0.1)).save(folder / "run.hsol")
    if command == "fit":
        (folder / "record.csv").write_text("t,x\n0,10.5\n1,6.1\n2,-3.5\n3,-8.4\n")
    module = importlib.import_module(f"hybridsim.cli.commands.{command}")
    execute = module.execute

    def noisy(*arguments: Any) -> int:
        print("by Python")
        os.write(1, b"by C\n")
        warnings.simplefilter("always", UserWarning)  # here warnings are errors
        warnings.warn("of a library", UserWarning, stacklevel=1)
        return int(execute(*arguments))

    monkeypatch.setattr(module, "execute", noisy)
    capfd.readouterr()
    assert main([*CASES[command], "--json"]) == 0
    out, err = capfd.readouterr()
    assert strict(out)
    assert "by Python\n" in err and "by C\n" in err and "warning: of a library" in err


@pytest.mark.parametrize("command", FAULTY)
def test_an_error_leaves_standard_output_empty(
    command: str, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    capfd.readouterr()
    assert main([*FAULTY[command], "--json"]) in (2, 3)
    out, err = capfd.readouterr()
    assert out == "" and err.startswith("hybridsim: ") and "internal error" not in err


def test_warnings_and_runs_that_fail_do_not_spoil_the_document(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (folder / "c.toml").write_text(
        'schema = 1\nname = "c"\n[states]\nx = { start = 1, der = "v" }\n'
        'v = { start = 0, der = "-x if x != 0.5 else -2*x" }\n'
    )
    (folder / "grows.toml").write_text(
        'schema = 1\nname = "grows"\n[states]\nx = { start = 1, der = "x**2" }\n'
    )
    assert main(["run", "c.toml", "--t-end", "1", "--json"]) == 0
    out, err = capfd.readouterr()
    assert strict(out)["status"] == "finished" and "warning: " in err
    assert main(["run", "grows.toml", "--t-end", "2", "--json"]) == 1
    out, err = capfd.readouterr()
    assert strict(out)["status"] == "step-failure" and "step-failure" in err
    assert main(["steady", "grows.toml", "--json"]) == 1
    out, err = capfd.readouterr()
    assert (out == "" or strict(out)) and err


@pytest.mark.parametrize("model", [info.name for info in hs.list_models()])
def test_every_packaged_model(model: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    checked = document(["check", model, "--json"], capfd)
    assert isinstance(checked, dict) and checked["name"] == model
    ran = document(["run", model, "--t-end", "1e-3", "--json", "--explain", "0"], capfd, codes=(0, 2))
    assert ran is None or (isinstance(ran, dict) and ran["status"] == "finished")


def test_results_of_comparisons_hold_no_numbers_that_json_has_not() -> None:
    found = hs.compare("dfcs", (0, 0.01), integrators=["dop853"], rtols=[1e-6], repeat=1)
    (row, *_) = found.rows
    assert row.errors is not None
    lost = replace(found, rows=(replace(row, errors=replace(row.errors, state=math.inf)),))
    assert strict(lost.to_json())["rows"][0]["state_error"] is None


PIPED = """
import os, sys
from hybridsim.cli import main
from hybridsim.cli.commands import models
execute = models.execute
def noisy(*arguments):
    print("by Python", flush=True)
    os.write(1, b"by C")
    return execute(*arguments)
models.execute = noisy
sys.exit(main(["models", "--json"]))
"""


def test_through_a_pipe_standard_output_holds_data_alone() -> None:
    paths = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", PIPED],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    assert len(strict(done.stdout)) == len(hs.list_models())
    assert "by Python" in done.stderr and "by C" in done.stderr


SCRIPT = """
import os, sys, threading
import numpy as np
from sksundae.cvode import CVODE
import hybridsim as hs

hs.simulate("clutches", (0, 0.3), integrator="cvode-adams")

def rhs(t, y, dy):
    dy[0] = 1.0

def idle(t, y, out):  # zero throughout, of which CVODE warns
    out[0] = 0.0

def steps():
    solver = CVODE(rhs, method="Adams", eventsfn=idle, num_events=1)
    solver.init_step(0.0, np.zeros(1))
    for _ in range(3):
        solver.step(1.0, method="onestep", tstop=1.0)

threads = [threading.Thread(target=steps) for _ in range(2)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print("data")
"""


def test_python_and_threads() -> None:
    paths = os.pathsep.join(path for path in sys.path if path)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("SUNLOGGER")}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**environment, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0 and done.stdout == "data\n"
    assert "[WARNING]" in done.stderr  # it does warn here
