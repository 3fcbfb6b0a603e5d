"""Signals to a process of its own: exit code 130 or 143, no traceback, and what was computed is kept."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim.cli import main

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT between processes")

# The program says on stderr when so much of its work is done; then a signal comes from outside, or from itself.
_PROGRAM = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from hybridsim.cli.progress import Progress
called = []
progress = Progress.__call__
def tell(self, done, *arguments):
    if not called and done >= float(sys.argv[1]):
        called.append(print("begun", file=sys.stderr, flush=True))
        if int(sys.argv[2]):
            os.kill(os.getpid(), int(sys.argv[2]))
    progress(self, done, *arguments)
Progress.__call__ = tell
from hybridsim.cli import main
sys.exit(main(sys.argv[3:]))
"""


def interrupted(tmp_path: Path, *argv: str, after: float = 0.0, own: int = 0) -> tuple[int, str]:
    """Exit code and messages of a command that is interrupted half a second after this part of its work is done.

    own: a signal that it sends itself instead, at once.
    """
    process = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, str(after), str(own), *argv],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    seen = []
    for line in process.stderr:
        seen.append(line)
        if line == "begun\n":
            break
    if not own:
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
    seen.append(process.communicate(timeout=600)[1])
    return process.returncode, "".join(seen)


# Ctrl-C where C code calls back, as the compiler does: Python drops what is raised there, with a traceback.
_CALLED_BACK = """
import ctypes, signal, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from hybridsim.cli.session import Session
session = Session()
with session.listening():
    try:
        ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))()
        for _ in range(1000):
            time.sleep(0.01)
    except KeyboardInterrupt:
        print("interrupted", session.interrupted_code)
"""


def test_what_hits_the_compiler_is_not_lost() -> None:
    done = subprocess.run([sys.executable, "-c", _CALLED_BACK], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("interrupted 130\n", "")


def test_run_keeps_what_was_computed(tmp_path: Path) -> None:
    argv = ("run", "dfcs", "--t-end", "10000T", "--integrator", "scipy-dop853", "--csv", "out.csv")
    code, messages = interrupted(tmp_path, *argv)
    assert code == 130, messages
    assert "stopping at the next step" in messages
    assert "interrupted at t = " in messages and "wrote out.csv" in messages
    assert "Traceback" not in messages
    assert len((tmp_path / "out.csv").read_text().splitlines()) > 1


def test_compare_stops_altogether(tmp_path: Path) -> None:
    argv = ("compare", "dfcs", "--t-end", "10000T", "--integrators", "scipy-rk45", "--rtol", "1e-4,1e-12")
    code, messages = interrupted(tmp_path, *argv)
    assert code == 130, messages
    assert "interrupted; nothing was written" in messages
    assert "Traceback" not in messages


def test_a_run_that_is_asked_to_end_goes_on(tmp_path: Path) -> None:
    argv = ("run", "dfcs", "--t-end", "6T", "--integrator", "scipy-dop853", "--save", "run.hsol")
    code, messages = interrupted(tmp_path, *argv, after=0.4, own=signal.SIGTERM)
    assert code == 143, messages
    assert "'hybridsim resume run.hsol' continues the run" in messages and "Traceback" not in messages
    saved = str(tmp_path / "run.hsol")
    partly = hs.load_solution(saved)
    assert partly.status == "interrupted"
    assert main(["resume", saved, "--save", saved]) == 0
    finished = hs.load_solution(saved)
    assert 0.4 < partly.t_end / finished.t_end < 0.9
    whole = hs.simulate("dfcs", (0.0, finished.t_end), integrator="scipy-dop853")
    assert (finished.t == whole.t).all() and (finished.y == whole.y).all()


def test_sweep_writes_the_points_that_it_has(tmp_path: Path) -> None:
    argv = ("sweep", "dfcs", "F0=20:40:100", "omega=300:900:100", "--measure", "final", "--t-end", "15")
    code, messages = interrupted(tmp_path, *argv)
    assert code == 130, messages
    assert "interrupted after" in messages and "wrote sweep-dfcs/sweep.csv" in messages
    assert "Traceback" not in messages
    lines = (tmp_path / "sweep-dfcs" / "sweep.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 10_001 and lines[-1].endswith(",not run")


@pytest.mark.parametrize("workers", ["1", "2"])
def test_atlas_keeps_the_scenes_that_are_done(tmp_path: Path, workers: str) -> None:
    """The last scene takes seconds by a method that steps from Python; of those before it, one is done for certain."""
    scenes = ("FREE-1", "FREE-2", "TANH-1e-6")
    argv = ("atlas", *scenes, "--integrators", "rk4-sign,scipy-rk23", "--quick", "--workers", workers)
    code, messages = interrupted(tmp_path, *argv, after=0.66)
    assert code == 130, messages
    assert "Traceback" not in messages
    assert "of 3 scenes" in messages and "matrix.png" not in messages
    kept = json.loads((tmp_path / "atlas" / "atlas.json").read_text(encoding="utf-8"))
    done = [scene["name"] for scene in kept["scenes"]]
    assert done and set(done) <= {"FREE-1", "FREE-2"}
    assert f"interrupted after {len(done)} of 3 scenes" in messages
    assert len(kept["integrators"]) == 3 and len(kept["cells"]) == 3 * len(done)
