"""The walks on the page of the architecture are those that runs take."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "explanation" / "architecture.md"
MOST = 12  # stops of a walk

# Without the compiler the kernels are Python functions, whose calls can be traced.
RUN = """
import json, sys
import hybridsim as hs

calls = []

def trace(frame, event, _):
    name = frame.f_code.co_filename
    if event == "call" and PACKAGE in name:
        calls.append([name.split(PACKAGE)[1], frame.f_code.co_qualname])

PACKAGE = hs.__file__.removesuffix("__init__.py")
sys.setprofile(trace)
sol = hs.simulate(sys.argv[1], (0.0, 15.0), params={"delta": 2.5}, integrator="taylor")
events = sol.events
sol.save(sys.argv[2])
sys.setprofile(None)
assert {event.target for event in events} >= {"stick", "slip-"}
json.dump(calls, sys.stdout)
"""


def walks() -> list[list[tuple[str, str]]]:
    """File and function of each stop of each walk."""
    found = []
    for part in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        rows = re.findall(r"^\| (\d+) \| `(.+?)` \| `(.+?)` \|", part, re.MULTILINE)
        assert [int(number) for number, *_ in rows] == list(range(1, len(rows) + 1))
        found.append([(file, function) for _, file, function in rows])
    return found


@cache
def calls(folder: Path) -> tuple[tuple[str, str], ...]:
    """File and function of each call of the run, in order."""
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(ROOT / "models" / "belt.toml"), str(folder / "run.hs")],
        env={**os.environ, "HYBRIDSIM_JIT": "0"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return tuple((file, function) for file, function in json.loads(done.stdout))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


def test_there_are_two_walks_of_at_most_twelve_stops() -> None:
    assert [0 < len(walk) <= MOST for walk in walks()] == [True, True]


@pytest.mark.parametrize("number", [0, 1], ids=["a parameter", "an event"])
def test_a_run_passes_the_stops_in_their_order(number: int, folder: Path) -> None:
    later = iter(calls(folder))
    for stop in walks()[number]:
        assert stop in calls(folder), f"{stop} is not called"
        assert stop in later, f"{stop} is called, but not after the stop before"  # goes on from there


def test_stops_in_another_order_are_noticed(folder: Path) -> None:
    """The walk backward is no walk."""
    for walk in walks():
        later = iter(calls(folder))
        assert not all(stop in later for stop in walk[::-1])
