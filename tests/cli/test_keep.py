"""What the command line keeps of a long run, and that its process ends with its last line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.cli import main


@pytest.mark.parametrize("keep", ["all", "events", "last-period", "nothing", "0.05"])
def test_it_keeps_what_python_keeps(keep: str, hybridsim: Callable, tmp_path: Path) -> None:
    asked = ("run", "dfcs", "--t-end", "0.3", "--integrator", "dop853", "--keep", keep)
    code, out, _ = hybridsim(*asked, "--json", "--save", "r.hsol")
    found = json.loads(out)
    save = float(keep) if keep[0] == "0" else keep
    sol = hs.simulate("dfcs", (0, 0.3), integrator="dop853", keep=save)
    assert (
        code == 0
        and found["kept"] == save
        and found["final"] == dict(zip(sol.names, sol.y[:, -1], strict=True))
    )
    if keep == "nothing":
        assert found["events"] is None and found["modes"] is None
    else:
        assert [event["t"] for event in found["events"]] == [event.t for event in sol.events]
    assert hs.load_solution(tmp_path / "r.hsol").y.tolist() == sol.y.tolist()
    text = hybridsim(*asked).out
    assert ("events       not stored" in text) == (keep == "nothing")
    assert hybridsim("resume", "r.hsol", "--t-end", "0.4").code == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--keep", "some"], "use all, events, last-period, nothing"),
        (["--keep", "-1"], "--keep"),
        (["--keep", "events", "--csv", "r.csv"], "--csv needs the states over time, which --keep events"),
        (["--keep", "nothing", "--plot", "r.png"], "--plot needs the states over time, which --keep nothing"),
        (["--keep", "nothing", "--explain", "0"], "--explain needs the whole run, but --keep is nothing"),
        (["--save", "events"], "or --keep events to choose"),
    ],
)
def test_what_cannot_be_kept_is_refused_before_the_run(
    words: list[str], told: str, hybridsim: Callable
) -> None:
    code, out, err = hybridsim("run", "dfcs", *words)
    assert code == 2 and not out and told in err


# An object that says when it is freed, and an exit handler, beside the command in one process.
COMMAND = """
import atexit
from hybridsim.cli import command

class Freed:
    def __del__(self):
        print("freed", flush=True)

kept = Freed()
atexit.register(print, "handled")
command()
"""


def test_the_process_ends_without_freeing_its_memory(tmp_path: Path) -> None:
    paths = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, "run", "dfcs", "--t-end", "20T", "--csv", "r.csv"],
        env={**os.environ, "PYTHONPATH": paths},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    lines = done.stdout.splitlines()
    assert done.returncode == 0 and "cost" in lines[-2] and lines[-1] == "handled", done.stderr
    assert (tmp_path / "r.csv").read_text().endswith("\n")


def test_an_event_that_there_is_not_does_not_lose_the_run(tmp_path, capsys):
    table, kept = tmp_path / "run.csv", tmp_path / "run.hsol"
    given = ["run", "dfcs", "--t-end", "0.1", "--explain", "0", "--explain", "1000"]
    assert main([*given, "--csv", str(table), "--save", str(kept)]) == 2
    printed = capsys.readouterr()
    assert "1000" in printed.err
    assert "is not zero decides" in printed.out
    assert table.exists()
    assert hs.load_solution(kept).success
