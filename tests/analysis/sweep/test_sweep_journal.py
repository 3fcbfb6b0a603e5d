"""Sweeps that were killed go on where they were, and end with the bits of an undisturbed one."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from analysis import swept
from analysis.swept import end

import hybridsim as hs
from hybridsim.analysis.sweep.identity import identity
from hybridsim.cli import main

VALUES = {"F0": np.linspace(20.0, 40.0, 12).tolist(), "omega": [350.0, 424.0, 500.0]}
COUNT = 36


def mixed(model: hs.Model) -> dict[str, object]:
    """Readings of every kind, a point that fails, one that is no number."""
    force = model.parameter_values()["F0"]
    if force > 38.0:
        raise RuntimeError("too much")
    root = float("nan") if force < 21.0 else force**0.5
    return {
        "root": root,
        "turned": complex(force, 1.0 / 3.0),
        "word": f"at {force:.3g}",
        "row": np.array([force, 0.1]),
        "rows": np.array([1j * force]),
    }


def same(one: hs.Sweep, other: hs.Sweep) -> bool:
    return (
        (one.status == other.status).all()
        and list(one.values) == list(other.values)
        and all(
            v.dtype == other[n].dtype and (np.array_equal(v, other[n], equal_nan=v.dtype != object))
            for n, v in one.values.items()
        )
    )


@pytest.mark.parametrize("measure", [end, mixed])
def test_a_journal_that_is_cut_anywhere_goes_on(measure: object, tmp_path: Path) -> None:
    whole = hs.sweep("dfcs", VALUES, measure)
    path = tmp_path / "sweep.journal"
    assert same(whole, hs.sweep("dfcs", VALUES, measure, journal=path, workers=2))
    written = path.read_bytes()
    draws = np.random.default_rng(3)
    for _ in range(25):
        kept = int(draws.integers(0, len(written) + 1))
        path.write_bytes(written[:kept])
        assert same(whole, hs.sweep("dfcs", VALUES, measure, journal=path, workers=2)), kept
        assert path.read_bytes().count(b"\n") >= written[:kept].count(b"\n")


def test_what_is_done_is_not_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, calls = tmp_path / "sweep.journal", []
    monkeypatch.setattr(swept, "note", calls.append)  # not read by the measure itself, or it would change it

    def measure(model: hs.Model) -> float:
        swept.note(None)
        return model.parameter_values()["F0"]

    hs.sweep("dfcs", VALUES, measure, journal=path, workers=1)
    assert len(calls) == COUNT
    hs.sweep("dfcs", VALUES, measure, journal=path, workers=1)
    assert len(calls) == COUNT
    lines = path.read_bytes().splitlines(keepends=True)
    lost = sum(len(json.loads(line)[0]) for line in lines[-2:])
    path.write_bytes(b"".join(lines[:-2]))
    hs.sweep("dfcs", VALUES, measure, journal=path, workers=1)
    assert len(calls) == COUNT + lost


def test_rows_that_follow_each_other_are_done_as_rows(tmp_path: Path) -> None:
    def follow(model: hs.Model, previous: float | None) -> float:
        return model.parameter_values()["F0"] + 0.5 * (previous or 0.0)

    path = tmp_path / "sweep.journal"
    whole = hs.sweep("dfcs", VALUES, follow, warm_start=True)
    assert same(whole, hs.sweep("dfcs", VALUES, follow, warm_start=True, journal=path))
    lines = path.read_bytes().splitlines(keepends=True)
    assert len(lines) == 1 + 3
    path.write_bytes(b"".join(lines[:2]) + lines[2][:20])
    assert same(whole, hs.sweep("dfcs", VALUES, follow, warm_start=True, journal=path))


def test_a_journal_of_another_sweep_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sweep.journal"
    hs.sweep("dfcs", {"F0": [20.0, 30.0]}, end, journal=path)
    for model, values, measure in (
        ("dfcs", {"F0": [20.0, 31.0]}, end),
        ("dfcs", {"F0": [20.0, 30.0]}, mixed),
        (hs.load("dfcs").with_(mu=0.4), {"F0": [20.0, 30.0]}, end),
    ):
        with pytest.raises(hs.UsageError, match="belongs to another sweep"):
            hs.sweep(model, values, measure, journal=path)
    path.write_text("something else\n")
    with pytest.raises(hs.UsageError, match="not a journal"):
        hs.sweep("dfcs", {"F0": [20.0]}, end, journal=path)
    assert path.read_text() == "something else\n"
    with pytest.raises(hs.UsageError, match="cannot be written"):
        hs.sweep("dfcs", {"F0": [20.0]}, end, journal=tmp_path / "nowhere" / "sweep.journal")


# The command line, killed in the middle of its work: when the journal has grown by so much.
_KILLED = """
import os, signal, sys
from hybridsim.cli.progress import Progress
path, most = sys.argv[1], int(sys.argv[2])
progress = Progress.__call__
def tell(self, *arguments):
    if os.path.exists(path) and os.stat(path).st_size >= most:
        os.kill(os.getpid(), signal.SIGKILL)
    progress(self, *arguments)
Progress.__call__ = tell
from hybridsim.cli import main
sys.exit(main(sys.argv[3:]))
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGKILL")
def test_a_sweep_that_is_killed_goes_on(tmp_path: Path) -> None:
    argv = ["sweep", "dfcs", "F0=20:40:12", "omega=350:500:12", "--measure", "final.x", "--t-end", "0.2"]
    whole = tmp_path / "whole"
    assert main([*argv, "--out", str(whole)]) == 0
    out, journal = tmp_path / "killed", tmp_path / "killed" / "sweep.journal"
    sizes = [0]
    for _ in range(2):
        words = [str(journal), str(sizes[-1] + 200), *argv, "--out", str(out)]
        done = subprocess.run([sys.executable, "-c", _KILLED, *words], capture_output=True, text=True)
        assert done.returncode == -signal.SIGKILL, done.stderr
        sizes.append(journal.stat().st_size)
    assert sizes[0] < sizes[1] < sizes[2]
    assert main([*argv, "--out", str(out)]) == 0
    assert not journal.exists()
    assert (out / "sweep.csv").read_text() == (whole / "sweep.csv").read_text()


def _reading(name: str, factor: float = 1.0) -> Callable[[hs.Model], float]:
    return lambda model: factor * model.parameter_values()[name]


def _named(model: hs.Model, name: str) -> float:
    return model.parameter_values()[name]


LEVEL = 1.0


def _over_level(model: hs.Model) -> float:
    return model.parameter_values()["F0"] / LEVEL


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (lambda model: 1.0, lambda model: 2.0),
        (_reading("F0"), _reading("omega")),
        (_reading("F0", 1.0), _reading("F0", 1.0 + 1e-15)),
        (partial(_named, name="F0"), partial(_named, name="omega")),
    ],
)
def test_a_journal_serves_no_other_measure_of_the_same_name(
    one: Callable[[hs.Model], float], other: Callable[[hs.Model], float], tmp_path: Path
) -> None:
    path = tmp_path / "sweep.journal"
    hs.sweep("dfcs", {"F0": [20.0, 30.0]}, one, journal=path)
    with pytest.raises(hs.UsageError, match="belongs to another sweep"):
        hs.sweep("dfcs", {"F0": [20.0, 30.0]}, other, journal=path)
    hs.sweep("dfcs", {"F0": [20.0, 30.0]}, one, journal=path)


def test_a_journal_serves_no_measure_that_reads_another_constant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "sweep.journal"
    hs.sweep("dfcs", {"F0": [20.0, 30.0]}, _over_level, journal=path)
    monkeypatch.setattr(sys.modules[__name__], "LEVEL", 2.0)
    with pytest.raises(hs.UsageError, match="belongs to another sweep"):
        hs.sweep("dfcs", {"F0": [20.0, 30.0]}, _over_level, journal=path)


class _Scaled:
    """A measure with a factor of its class, and a method that its call uses."""

    factor = 1.0

    def __call__(self, model: hs.Model) -> float:
        return self.factor * self.read(model) + self.added()

    def read(self, model: hs.Model) -> float:
        return model.parameter_values()["F0"]

    @staticmethod
    def added() -> float:
        return 0.0


class _Heir(_Scaled):
    pass


def _asks_a_class(model: hs.Model) -> float:
    return model.parameter_values()["F0"] + _Scaled.added()


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("factor", 2.0),
        ("read", lambda self, model: 10.0 * model.parameter_values()["F0"]),
        ("added", staticmethod(lambda: 1.0)),
    ],
)
@pytest.mark.parametrize("measure", [_Scaled(), _Heir(), _Scaled().__call__, _asks_a_class])
def test_a_journal_serves_no_measure_of_a_class_that_has_changed(
    measure: Callable[[hs.Model], float],
    name: str,
    part: object,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = tmp_path / "sweep.journal"
    whole = hs.sweep("dfcs", {"F0": [20.0, 30.0]}, measure, journal=path)
    monkeypatch.setattr(_Scaled, name, part)
    with pytest.raises(hs.UsageError, match="belongs to another sweep"):
        hs.sweep("dfcs", {"F0": [20.0, 30.0]}, measure, journal=path)
    monkeypatch.undo()
    assert same(whole, hs.sweep("dfcs", {"F0": [20.0, 30.0]}, measure, journal=path))


class _Slotted:
    __slots__ = ("factor",)

    def __init__(self, factor: float) -> None:
        self.factor = factor

    def __call__(self, model: hs.Model) -> float:
        return self.factor * model.parameter_values()["F0"]


class _Silent(_Slotted):
    def __repr__(self) -> str:
        return "silent"


class _Row(list[float]):
    def __call__(self, model: hs.Model) -> float:
        return self[0] * model.parameter_values()["F0"]


@dataclass
class _Both(_Slotted):
    factor: float


@pytest.mark.parametrize("kind", [_Slotted, _Silent, _Both, lambda factor: _Row([factor])])
def test_an_object_is_told_by_its_state(
    kind: Callable[[float], Callable[[hs.Model], float]], tmp_path: Path
) -> None:
    path = tmp_path / "sweep.journal"
    assert identity(partial(_asks_a_class, kind(1.0))) != identity(partial(_asks_a_class, kind(2.0)))
    hs.sweep("dfcs", {"F0": [20.0, 30.0]}, kind(1.0), journal=path)
    hs.sweep("dfcs", {"F0": [20.0, 30.0]}, kind(1.0), journal=path)
    with pytest.raises(hs.UsageError, match="belongs to another sweep"):
        hs.sweep("dfcs", {"F0": [20.0, 30.0]}, kind(2.0), journal=path)


def test_what_cannot_be_told_from_another_one_is_refused(tmp_path: Path) -> None:
    lock, path = threading.Lock(), tmp_path / "sweep.journal"

    def measure(model: hs.Model) -> float:
        with lock:
            return model.parameter_values()["F0"]

    with pytest.raises(hs.UsageError, match=r"an object of type lock(?s:.)*__getstate__"):
        hs.sweep("dfcs", {"F0": [20.0, 30.0]}, measure, journal=path)
    assert not path.exists()
    assert hs.sweep("dfcs", {"F0": [20.0, 30.0]}, measure)["value"].tolist() == [20.0, 30.0]


def test_what_reads_itself_or_names_no_value_yet_is_told() -> None:
    def ring(factor: float) -> Callable[[int], float]:
        def inner(n: int) -> float:
            return factor if n < 1 else inner(n - 1) + later

        return inner
        later = 1.0  # type: ignore[unreachable]  # an empty cell

    assert identity(ring(1.0)) == identity(ring(1.0)) != identity(ring(2.0))


def test_a_measure_is_told_alike_in_another_process() -> None:
    """By code, constants, closures and functions that are not written in Python."""
    text = (
        "import numpy as np, hybridsim as hs\n"
        "from hybridsim.analysis.sweep.identity import identity\n"
        "measure = (lambda k: lambda model: np.max(k))(2.0)\n"
        "import enum, functools, dataclasses\n"
        "class Side(enum.Enum):\n    left = {'a', 'b', 'c'}\n    right = 2\n"
        "@dataclasses.dataclass\nclass One:\n    side: Side\n    names: frozenset = frozenset({'x', 'y', 'z'})\n"
        "    @functools.cached_property\n    def twice(self): return 2\n"
        "    def __call__(self, model): return self.twice, {'p', 'q', 'r'}, One\n"
        "more = [One(Side.left), functools.lru_cache(measure), np.sin, len, dict.get, [].append]\n"
        "more += [np.random.default_rng(1), np.float64(2), np.dtype(float), 1j, slice(1, 2)]\n"
        "print(identity([measure, np.max, np.arange(3.0), hs.load('dfcs'), more]))"
    )
    told = {subprocess.check_output([sys.executable, "-c", text]) for _ in range(2)}
    assert len(told) == 1
    assert b" at 0x" not in told.pop()
