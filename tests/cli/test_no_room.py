"""A disk that is full, and files that must not be written over: said by name, nothing half written, nothing lost."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs

resource = pytest.importorskip("resource")  # limits on the size of files are those of POSIX

MODEL = '[states]\nx = { start = 1, der = "-x" }\n'


def with_limit(limit: int, work: Callable) -> object:
    """What work returns where no file may grow beyond a size, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        return work()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize("option", ["csv", "npz", "save", "plot"])
def test_outputs_of_a_run(option: str, hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "ok.toml").write_text(MODEL)
    name = {"csv": "r.csv", "npz": "r.npz", "save": "r.hsol", "plot": "r.png"}[option]
    asked = ["run", "ok.toml", "--t-end", "1", f"--{option}", name]
    if option in ("csv", "npz"):
        asked += ["--points", "50"]
    assert hybridsim(*asked).code == 0  # which fills the cache as well
    assert (tmp_path / name).stat().st_size > 200
    (tmp_path / name).write_text("what was there")
    done = with_limit(200, lambda: hybridsim(*asked))
    assert done.code == 2
    assert f"{name} cannot be written: File too large" in done.err and "internal" not in done.err
    assert (tmp_path / name).read_text() == "what was there"
    assert {path.name for path in tmp_path.iterdir()} == {"ok.toml", name}


def test_the_journal_of_a_sweep(tmp_path: Path) -> None:
    (tmp_path / "ok.toml").write_text(MODEL)
    path = tmp_path / "sweep.journal"
    values = np.linspace(1.0, 2.0, 20).tolist()

    def swept(**more: object) -> np.ndarray:
        return hs.sweep(tmp_path / "ok.toml", {"x": values}, "final.x", t_span=(0, 1), **more)["final.x"]

    def refused() -> None:
        with pytest.raises(hs.UsageError, match=r"sweep\.journal cannot be written: File too large"):
            swept(journal=path, workers=1)

    with_limit(300, refused)
    assert np.array_equal(swept(journal=path), swept())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
def test_a_device_and_a_pipe_are_written_to_as_they_are(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "ok.toml").write_text(MODEL)
    done = hybridsim("run", "ok.toml", "--t-end", "1", "--csv", "/dev/full")
    assert done.code == 2 and "/dev/full cannot be written: No space left on device" in done.err
    reader, writer = os.pipe()
    hs.simulate("ok.toml", (0, 1)).to_csv(f"/dev/fd/{writer}", 3)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        assert [line.split(",")[0] for line in pipe] == ["t", "0.0", "0.5", "1.0"]


def test_points_that_a_sweep_has_not(tmp_path: Path) -> None:
    (tmp_path / "ok.toml").write_text(MODEL)
    path = tmp_path / "sweep.journal"
    swept = {"t_span": (0, 1), "journal": path}
    hs.sweep(tmp_path / "ok.toml", {"x": [1, 2, 3]}, "final.x", **swept)
    whole = path.read_text()
    row = whole.splitlines()[1]
    path.write_text(whole + row.replace("[[0", "[[99", 1) + "\n")
    line = len(whole.splitlines()) + 1
    with pytest.raises(hs.UsageError, match=rf"sweep\.journal, line {line}: \[99"):
        hs.sweep(tmp_path / "ok.toml", {"x": [1, 2, 3]}, "final.x", **swept)


def test_a_model_is_not_written_over(hybridsim: Callable, tmp_path: Path) -> None:
    (tmp_path / "ok.toml").write_text(MODEL)
    (tmp_path / "same.toml").symlink_to("ok.toml")
    for name in ("ok.toml", "./ok.toml", "same.toml"):
        done = hybridsim("run", "ok.toml", "--t-end", "1", "--csv", name)
        assert done.code == 2 and "--csv" in done.err and "the file of the model" in done.err
    done = hybridsim("run", "ok.toml", "--t-end", "1", "--csv", "r.npz", "--npz", "r.npz")
    assert done.code == 2 and "--npz: r.npz is also the output file of --csv" in done.err
    assert (tmp_path / "ok.toml").read_text() == MODEL


@pytest.mark.skipif(
    not Path("/proc/self").exists(), reason="a folder that says it may be written, and is not"
)
def test_a_folder_that_cannot_be_made_is_refused_before_the_work(hybridsim: Callable) -> None:
    done = hybridsim("atlas", "--out", "/proc/atlas")
    assert done.code == 2 and "--out: no permission to write to /proc" in done.err and not done.out
    done = hybridsim("run", "dfcs", "--csv", "/proc/r.csv")
    assert done.code == 2 and "--csv: no permission to write /proc/r.csv" in done.err and not done.out
