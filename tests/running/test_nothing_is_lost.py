"""What existed is there after a full disk, a kill or another writer: archives, tables, pictures and journals.

The disk is a small one in memory, where one can be mounted. A kill is SIGKILL in the middle of a write.
"""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.files import held, whole_file

needs_posix = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes and locks are those of POSIX")
DECAY = hs.Model("decay", states=[hs.State("x", 1.0, "-x")])
KINDS = {
    "archive": "r.hsol",
    "table": "r.csv",
    "arrays": "r.npz",
    "picture": "r.png",
    "document": "r.pdf",
    "drawing": "r.svg",
}


@pytest.fixture(scope="module")
def run() -> hs.Solution:
    """A run with enough in it to fill a small disk."""
    return hs.simulate(DECAY, (0, 1), integrator="dop853", max_step=1e-3)


def write(kind: str, sol: hs.Solution, path: Path) -> None:
    if kind == "archive":
        sol.save(path)
    elif kind == "table":
        sol.to_csv(path, 2000)
    elif kind == "arrays":
        sol.to_npz(path, 20_000)
    else:
        from hybridsim.plot import save, time_history

        save(time_history(sol), path, dpi=300)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder on a disk of 8 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = ["mount", "-t", "tmpfs", "-o", "size=8k,mode=700", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(made, capture_output=True).returncode:
        pytest.skip("nothing may be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@needs_posix
@pytest.mark.parametrize("kind", KINDS)
def test_a_full_disk(kind: str, run: hs.Solution, small_disk: Path) -> None:
    path = small_disk / KINDS[kind]
    path.write_text("what was there")
    path.chmod(0o640)
    with pytest.raises(hs.UsageError, match="No space left on device"):
        write(kind, run, path)
    assert path.read_text() == "what was there" and stat.S_IMODE(path.stat().st_mode) == 0o640
    assert list(small_disk.iterdir()) == [path]


@needs_posix
@pytest.mark.parametrize("kind", KINDS)
def test_modes_owners_and_neighbours(kind: str, run: hs.Solution, tmp_path: Path) -> None:
    path = tmp_path / KINDS[kind]
    neighbour = path.with_name(f"r.part{path.suffix}")
    neighbour.write_text("of the user")
    before = os.umask(0o027)
    try:
        write(kind, run, path)
        assert stat.S_IMODE(path.stat().st_mode) == 0o640  # as any new file
        path.chmod(0o600)
        if os.geteuid() == 0:
            os.chown(path, 54321, 54322)
        write(kind, run, path)
    finally:
        os.umask(before)
    found = path.stat()
    assert stat.S_IMODE(found.st_mode) == 0o600
    assert os.geteuid() != 0 or (found.st_uid, found.st_gid) == (54321, 54322)
    assert neighbour.read_text() == "of the user"
    assert {entry.name for entry in tmp_path.iterdir()} == {path.name, neighbour.name}


@needs_posix
def test_what_is_being_written_is_private(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("secret")
    path.chmod(0o600)
    with whole_file(path) as partly:
        assert stat.S_IMODE(os.stat(partly).st_mode) == 0o600


@needs_posix
def test_a_file_that_may_only_be_read_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "r.csv"
    path.write_text("kept")
    monkeypatch.setattr(os, "access", lambda *_: False)  # which the superuser always may
    with pytest.raises(hs.UsageError, match="Permission denied"), whole_file(path):
        pass
    assert path.read_text() == "kept"


@needs_posix
def test_a_path_that_is_a_folder_or_has_none_says_what_to_do(tmp_path: Path) -> None:
    """A full disk is not the reason, so freeing space is no remedy."""
    (tmp_path / "r.html").mkdir()
    for path, remedy in (("r.html", "add a file name"), ("none/r.html", "create the folder first")):
        with pytest.raises(hs.UsageError, match="cannot be written") as caught:
            hs.simulate("free-decay", (0, 0.1)).report(tmp_path / path)
        assert remedy in str(caught.value) and "disk space" not in str(caught.value)


@needs_posix
def test_a_link_is_written_through(tmp_path: Path) -> None:
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to("real.csv")
    with whole_file(tmp_path / "link.csv") as partly:
        Path(partly).write_text("new")
    assert (tmp_path / "link.csv").is_symlink() and (tmp_path / "real.csv").read_text() == "new"


def test_a_name_as_long_as_may_be(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 250 + ".csv")
    for text in ("one", "two"):
        with whole_file(path) as partly:
            Path(partly).write_text(text)
    assert path.read_text() == "two"


KILLED = """
import os, signal, sys
import hybridsim as hs
real, path = os.replace, sys.argv[1]
os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)  # all is written, and nothing is in its place
hs.simulate(hs.Model("decay", states=[hs.State("x", 1.0, "-x")]), (0, 1)).save(path)
"""


def script(text: str, *given: object, **more: str) -> subprocess.Popen[bytes]:
    """Start a script in a process of its own."""
    paths = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(
        [sys.executable, "-c", text, *map(str, given)],
        env={**os.environ, "PYTHONPATH": paths, "HYBRIDSIM_JIT": "0", **more},
        stderr=subprocess.PIPE,
    )


@needs_posix
def test_a_kill_in_the_middle_of_an_archive(run: hs.Solution, tmp_path: Path) -> None:
    path = tmp_path / "r.hsol"
    run.save(path)
    before = path.read_bytes()
    process = script(KILLED, path)
    process.communicate(timeout=600)
    assert process.returncode == -signal.SIGKILL
    assert path.read_bytes() == before
    assert np.array_equal(hs.load_solution(path).y, run.y)


WRITER = """
import os, sys
import hybridsim as hs
sol = hs.simulate(hs.Model("decay", states=[hs.State("x", float(sys.argv[2]), "-x")]), (0, 1))
while not os.path.exists(sys.argv[1] + ".enough"):
    sol.save(sys.argv[1] + ".hsol")
    sol.to_csv(sys.argv[1] + ".csv", 50)
"""


def test_two_processes_that_write_to_one_file(tmp_path: Path) -> None:
    head = tmp_path / "r"
    writers = [script(WRITER, head, start) for start in (1, 2)]
    archive, table, enough = (tmp_path / f"r.{end}" for end in ("hsol", "csv", "enough"))
    starts, reads = set(), 0
    try:
        while (len(starts) < 2 or reads < 40) and all(writer.poll() is None for writer in writers):
            if archive.exists() and table.exists():  # at each instant they are whole
                starts.add(hs.load_solution(archive).y[0, 0])
                assert len(table.read_text().splitlines()) == 51
                reads += 1
            time.sleep(0.01)
    finally:
        enough.touch()
    told = [writer.communicate()[1] for writer in writers]
    assert [writer.returncode for writer in writers] == [0, 0], told
    enough.unlink()
    assert starts == {1.0, 2.0} and reads >= 40
    assert hs.load_solution(archive).success
    assert {path.name for path in tmp_path.iterdir()} == {"r.hsol", "r.csv"}


MODEL = '[states]\nx = { start = 1, der = "-x" }\n'
SWEEP = ("sweep", "ok.toml", "x=1,2,3", "--measure", "final.x", "--t-end", "1", "--out", "found")


@pytest.fixture
def command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable:
    """A function that runs a command line in an empty folder; it returns the code, the data and the messages."""
    from hybridsim.cli import main

    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("HYBRIDSIM_TRACEBACK", raising=False)
    (tmp_path / "ok.toml").write_text(MODEL)

    def call(*words: str) -> tuple[int, str, str]:
        code = main(list(words))
        return code, *capsys.readouterr()

    return call


@pytest.mark.parametrize("last", ["sweep.csv", "sweep.json", "sweep.png"])
def test_results_that_cannot_be_written_leave_the_journal(
    last: str, command: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = os.replace

    def replace(source: str, target: str) -> None:
        if str(target).endswith(last):
            raise OSError(28, os.strerror(28))
        real(source, target)

    monkeypatch.setattr(os, "replace", replace)
    code, out, err = command(*SWEEP)
    journal = tmp_path / "found" / "sweep.journal"
    assert code == 2 and f"{last} cannot be written: No space left" in err and "0.367879 at x=1" in out
    assert len(journal.read_text().splitlines()) > 1
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    code, out, err = command(*SWEEP)
    assert code == 0 and "continuing from" in err and not journal.exists()
    assert (tmp_path / "found" / last).exists()


@needs_posix
def test_two_sweeps_into_one_folder(command: Callable, tmp_path: Path) -> None:
    (tmp_path / "found").mkdir()
    with held(tmp_path / "found", "as another process does"):
        code, out, err = command(*SWEEP)
    assert code == 2 and not out
    assert "Another sweep is writing to found" in err and "internal" not in err
    assert command(*SWEEP)[0] == 0


GATES = threading.Event(), threading.Event()


@needs_posix
def test_two_sweeps_with_one_journal(tmp_path: Path) -> None:
    path, (inside, go_on) = tmp_path / "sweep.journal", GATES

    def slow(model: hs.Model) -> float:
        gates = vars(sys.modules[__name__])["GATES"]  # a journal serves a measure with what it reads by name
        gates[0].set()
        assert gates[1].wait(600)
        return 1.0

    first = threading.Thread(target=lambda: hs.sweep(DECAY, {"x": [1, 2]}, slow, journal=path, workers=1))
    first.start()
    assert inside.wait(600)
    with pytest.raises(hs.UsageError, match=r"sweep\.journal is in use by another sweep"):
        hs.sweep(DECAY, {"x": [1, 2]}, slow, journal=path, workers=1)
    go_on.set()
    first.join()
    assert hs.sweep(DECAY, {"x": [1, 2]}, slow, journal=path, workers=1)["value"].tolist() == [1.0, 1.0]


HEAD = '{"format": "hybridsim sweep", "sweep": "MARK"}\n'
ROW = '[[0], [["ok", {"x": 1.0}]]]\n'
MALFORMED = {
    "no text": (b"\xff\xfe\x00", "not a journal"),
    "a head of another kind": (b"[1, 2]\n", "not a journal"),
    "deep head": (b"[" * 100_000 + b"\n", "not a journal"),
    "a head without a mark": (b'{"format": "hybridsim sweep"}\n', "another sweep"),
    "a number": (b"HEAD3\n", "line 2"),
    "an object": (b'HEAD{"a": 1}\n', "line 2"),
    "deep": (b"HEAD" + b"[" * 100_000 + b"\n", "line 2"),
    "no points": (b"HEAD[[], []]\n", "line 2"),
    "points that are no numbers": (b'HEAD[["a"], [["ok", {}]]]\n', "line 2"),
    "a point that is true": (b'HEAD[[true], [["ok", {}]]]\n', "line 2"),
    "points below zero": (b'HEAD[[-1], [["ok", {"x": 1}]]]\n', "line 2"),
    "a huge point": (b'HEAD[[1e9], [["ok", {"x": 1}]]]\n', "line 2"),
    "fewer results": (b'HEAD[[0, 1], [["ok", {"x": 1}]]]\n', "line 2"),
    "a point twice": (b'HEAD[[0, 0], [["ok", {"x": 1}], ["ok", {"x": 1}]]]\n', "line 2"),
    "a line twice": (b"HEADROWROW", "line 3"),
    "a status that is no text": (b'HEAD[[0], [[3, {"x": 1}]]]\n', "line 2"),
    "readings that are none": (b'HEAD[[0], [["ok", [1]]]]\n', "line 2"),
    "a reading that is null": (b'HEAD[[0], [["ok", {"x": null}]]]\n', "line 2"),
    "a reading of another kind": (b'HEAD[[0], [["ok", {"x": {"a": 1}}]]]\n', "line 2"),
    "an array of texts": (b'HEAD[[0], [["ok", {"x": {"array": [["a"]]}}]]]\n', "line 2"),
    "an array of arrays": (b'HEAD[[0], [["ok", {"x": {"array": [[[1]]]}}]]]\n', "line 2"),
    "parts of two lengths": (b'HEAD[[0], [["ok", {"x": {"array": [[1], [1, 2]]}}]]]\n', "line 2"),
    "a number without end": (b'HEAD[[0], [["ok", {"x": 1' + b"0" * 400 + b"}]]]\n", "line 2"),
    "a second line that is cut in the middle": (b'HEAD[[0], [["ok", {"x"\nROW', "line 2"),
}


@pytest.mark.parametrize("kind", MALFORMED)
def test_malformed_journals_are_errors_by_name(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "sweep.journal"

    def swept() -> hs.Sweep:
        return hs.sweep(DECAY, {"x": [1, 2]}, "final.x", t_span=(0, 1), journal=path, workers=1)

    swept()
    head = path.read_bytes().splitlines(keepends=True)[0]
    content, words = MALFORMED[kind]
    content = content.replace(b"HEAD", head).replace(b"ROW", ROW.encode())
    path.write_bytes(content)
    with pytest.raises(hs.UsageError, match=words):
        swept()
    assert path.read_bytes() == content  # what is not ours is left as it is


def test_a_journal_whose_head_is_cut_off_is_begun_anew(tmp_path: Path) -> None:
    path = tmp_path / "sweep.journal"
    swept = {"t_span": (0, 1), "journal": path}
    whole = hs.sweep(DECAY, {"x": [1, 2]}, "final.x", **swept)["final.x"]
    head = path.read_bytes().splitlines(keepends=True)[0]
    for length in (0, 1, 30, len(head) - 1):
        path.write_bytes(head[:length])
        assert np.array_equal(hs.sweep(DECAY, {"x": [1, 2]}, "final.x", **swept)["final.x"], whole)


@needs_posix
@pytest.mark.parametrize("kind", ["pipe", "folder", "device"])
def test_a_journal_that_is_no_file(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "sweep.journal"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path = Path("/dev/zero")
    with pytest.raises(hs.UsageError, match="cannot be written"):
        hs.sweep(DECAY, {"x": [1, 2]}, "final.x", t_span=(0, 1), journal=path)
