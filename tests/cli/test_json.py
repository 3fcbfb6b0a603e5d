"""With `--json` standard output holds one JSON document and nothing else, whatever runs beneath."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.cli import main

INTEGRATORS = [integrator.name for integrator in hs.list_integrators()]
# CVODE warns on these of steps that are rounded away
MODELS = {"clutches": "0.3", "dfcs": "2T", "square-wave": "0.5", "bouncing-ball": "1"}


def document(words: list[str], capfd: pytest.CaptureFixture[str], codes: tuple[int, ...] = (0,)) -> object:
    """What a command line prints, read strictly; the standard output of C is looked at, too."""
    capfd.readouterr()
    code = main(words)
    out, err = capfd.readouterr()
    assert code in codes, err
    if code == 2 and not out:  # refused by name, such as a method without impacts
        return None
    return json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_runs(
    integrator: str, capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for model, end in MODELS.items():
        words = ["run", model, "--t-end", end, "--integrator", integrator, "--json", "--limit", "seconds=20"]
        found = document(words, capfd, codes=(0, 1, 2))
        assert found is None or (isinstance(found, dict) and found["integrator"] == integrator)


@pytest.mark.parametrize(
    "words",
    [
        [
            "compare",
            "clutches",
            "--integrators",
            "cvode-adams,cvode-bdf,dop853",
            "--t-end",
            "0.3",
            "--out",
            "c",
        ],
        ["steady", "dfcs"],
        ["sweep", "dfcs", "F0=20,30", "--measure", "amplitude.x", "--out", "s"],
        ["check", "clutches"],
        ["models"],
        ["integrators"],
        ["integrators", "cvode-bdf"],
    ],
)
def test_other_commands(
    words: list[str], capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert document([*words, "--json"], capfd)


SCRIPT = """
import os, sys, threading
import numpy as np
from sksundae.cvode import CVODE
import hybridsim as hs

hs.simulate("clutches", (0, 0.3), integrator="cvode-adams")

def rhs(t, y, dy):
    dy[0] = 1e18 if t > 0.5 else 1.0

def steps():  # that are rounded away, of which CVODE warns
    solver = CVODE(rhs, method="Adams", rtol=1e-9, atol=1e-30, max_num_steps=100)
    solver.init_step(0.0, np.zeros(1))
    for _ in range(60):
        if not solver.step(1.0, method="onestep", tstop=1.0).success:
            break

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
        timeout=240,
    )
    assert done.returncode == 0 and done.stdout == "data\n"
    assert "[WARNING]" in done.stderr  # it does warn here
