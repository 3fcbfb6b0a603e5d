"""Manners of every command: exit codes, streams, interruption, a closed pipe, how a bug is reported."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import hybridsim as hs
from hybridsim import __version__
from hybridsim.cli.entry import COMMANDS


def run(*argv: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run the program in a process of its own, with environment variables set."""
    return subprocess.run(
        [sys.executable, "-m", "hybridsim", *argv],
        capture_output=True,
        text=True,
        env=dict(os.environ) | variables,
        check=False,
    )


def raising(error: BaseException) -> Callable:
    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


def test_version(hybridsim: Callable) -> None:
    assert hybridsim("--version") == (0, f"hybridsim {__version__}\n", "")


def test_help_names_every_command(hybridsim: Callable) -> None:
    code, out, err = hybridsim("--help")
    assert (code, err) == (0, "")
    assert all(name in out for name in ("run", "compare", "check", "models", "integrators", "cache"))


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (hs.SimulationError("the step became too small", remedy="loosen rtol"), 1),
        (hs.UsageError("no such thing", remedy="take another"), 2),
        (hs.ModelError("no such state", place=hs.Place("m.toml", 3), remedy="add it"), 3),
    ],
)
def test_exit_code_and_message_of_an_error(
    error: hs.HybridsimError, code: int, hybridsim: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hs, "load", raising(error))
    outcome = hybridsim("check", "dfcs")
    assert outcome == (code, "", f"hybridsim: {error}\n")


def test_a_bug_is_one_line_and_how_to_see_more(hybridsim: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hs, "load", raising(KeyError("omega")))
    code, out, err = hybridsim("check", "dfcs")
    assert (code, out) == (1, "")
    assert "KeyError: 'omega'" in err and "HYBRIDSIM_TRACEBACK=1" in err
    assert "Traceback" not in err

    monkeypatch.setenv("HYBRIDSIM_TRACEBACK", "1")
    code, _, err = hybridsim("check", "dfcs")
    assert code == 1
    assert "Traceback" in err


def test_interruption(hybridsim: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hs, "simulate", raising(KeyboardInterrupt()))
    code, out, err = hybridsim("run", "dfcs", "--csv", "out.csv")
    assert (code, out) == (130, "")
    assert "interrupted" in err and "nothing was written" in err


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C as on a terminal: a shell that runs the tests in the background has it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("ctrl_c")
def test_interruption_that_comes_out_as_another_error(
    hybridsim: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulate(*_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGINT)  # waits, as it is the first one
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as interrupt:
            raise SystemError("returned a result with an exception set") from interrupt

    monkeypatch.setattr(hs, "simulate", simulate)
    code, out, err = hybridsim("run", "dfcs")
    assert (code, out) == (130, "")
    assert "stopping at the next step" in err
    assert "interrupted; nothing was written" in err and "internal error" not in err
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_warnings_go_to_stderr_in_one_line(hybridsim: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    models = hs.list_models()

    def warn() -> object:
        warnings.warn("mind the step", RuntimeWarning, stacklevel=1)
        return models

    monkeypatch.setattr(hs, "list_models", warn)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        code, out, err = hybridsim("models")
    assert code == 0
    assert err == "hybridsim: warning: mind the step (RuntimeWarning)\n"
    assert "mind" not in out


@pytest.mark.skipif(os.name == "nt", reason="pipes break otherwise on Windows")
def test_closed_pipe() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "hybridsim", "models"],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.skipif(os.name == "nt", reason="pipes break otherwise on Windows")
@pytest.mark.parametrize(
    "words",
    [
        ("run", "dfcs", "--t-end", "0.1", "--json", "--csv", "found.csv"),
        ("sweep", "dfcs", "F0=10,30", "--workers", "1", "--out", "."),
        ("steady", "dfcs", "--plot", "found.png"),
    ],
    ids=["run", "sweep", "steady"],
)
def test_a_reader_who_has_gone_loses_no_file(words: tuple[str, ...], tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "hybridsim", *words],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    os.close(writer)
    assert done.returncode == 141, done.stderr
    names = {"found.csv", "found.png", "sweep.csv"} & {path.name for path in tmp_path.iterdir()}
    assert len(names) == 1


def test_ascii_terminal() -> None:
    done = run("check", "dfcs", PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr


def test_the_same_program_as_a_module() -> None:
    assert run("--version").stdout == f"hybridsim {__version__}\n"


LINES = {
    "run": ["dfcs"],
    "resume": ["r.hsol"],
    "report": ["dfcs"],
    "fit": ["dfcs", "r.csv", "--unknown", "N=1:100"],
    "compare": ["dfcs"],
    "advise": ["dfcs", "--quantity", "x"],
    "steady": ["dfcs"],
    "sweep": ["dfcs", "F0=10:20:3"],
    "study": ["he2026"],
    "atlas": [],
    "check": ["dfcs"],
    "models": [],
    "schema": [],
    "integrators": [],
    "explain_status": [],
    "cache": ["path"],
}


@pytest.mark.parametrize("command", [c.__name__.rpartition(".")[2] for c in COMMANDS])
def test_out_of_memory_names_options_that_the_command_has(
    command: str, hybridsim: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = set(re.findall(r"--[a-z][a-z0-9-]*", hybridsim(command.replace("_", "-"), "--help").out))
    monkeypatch.setattr(f"hybridsim.cli.commands.{command}.execute", raising(MemoryError()))
    found = hybridsim(command.replace("_", "-"), *LINES[command])
    assert found.code == 1 and found.err.startswith("hybridsim: out of memory")
    named = set(re.findall(r"--[a-z][a-z0-9-]*", found.err))
    assert named <= known
    assert bool(named) == (
        command not in ("check", "models", "schema", "integrators", "explain_status", "cache")
    )


def test_a_run_that_stops_at_its_start_says_why_and_writes_no_picture(
    tmp_path: Path, hybridsim: Callable
) -> None:
    model, picture = tmp_path / "bad.toml", tmp_path / "bad.png"
    model.write_text(
        'schema = 1\nname = "bad"\n[states]\nx = { start = 0, der = "v" }\nv = { start = 1, der = "-f" }\n'
        '[contacts.f]\nvelocity = "v"\nnormal = "x - 1"\nlaw = { name = "coulomb", mu = 0.3 }\n'
    )
    code, _, err = hybridsim("run", str(model), "--t-end", "1", "--plot", str(picture))
    assert code == 1
    assert "no picture was written" in err and "inconsistent" in err
    assert not picture.exists()
