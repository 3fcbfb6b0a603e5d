"""Files that anybody may have made: what does not fit is refused by name, with bounded memory and time."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridsim as hs

sys.path.insert(0, str(Path(__file__).parent))
from broken_archives import parts, sealed  # it is a script, too

RUNS = [
    ("dfcs", 0.02, "taylor"),
    ("dfcs", 0.02, "exact"),
    ("bouncing-ball", 2.0, "dop853"),
    ("dfcs", 0.01, "rk4-dichotomy"),
    ("dfcs", 0.01, "scipy-dop853"),
]


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The path of a run with an integrator, saved before its end."""
    folder, known = tmp_path_factory.mktemp("saved"), {}

    def path(integrator: str) -> Path:
        if integrator not in known:
            scene, end, name = next(run for run in RUNS if run[2] == integrator)
            known[integrator] = folder / f"{integrator}.hsol"
            hs.simulate(scene, (0, end), integrator=name, limits={"steps": 60}).save(known[integrator])
        return known[integrator]

    return path


def test_changes_at_random(saved: Callable[[str], Path]) -> None:
    paths = os.pathsep.join(path for path in sys.path if path)
    script = Path(__file__).with_name("broken_archives.py")
    done = subprocess.run(
        [sys.executable, script, "60", *(saved(name) for _, _, name in RUNS)],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=600,
    )
    lines = done.stdout.splitlines()
    assert done.returncode == 0 and lines[-1] == "done", (lines[-1:], done.stderr[-2000:])
    assert "FAULT" not in done.stdout, done.stdout[done.stdout.index("FAULT") :][:3000]


# of a block: the array, its entry, and what it is set to
MISLEADING = [
    ("taylor", "segments/0/ends", 1, 10**9),
    ("taylor", "segments/0/ends", -1, 2**62),
    ("taylor", "segments/0/ends", 0, -5),
    ("taylor", "segments/0/modes", 0, 7),
    ("taylor", "segments/0/modes", 0, -1),
    ("exact", "segments/1/rows", 0, 10**9),
    ("exact", "segments/1/rows", 0, -1),
    ("exact", "segments/1/tables", None, 3),
    ("exact", "segments/0/counts", 0, 10**9),
    ("exact", "segments/0/ends", (0, 0), -1),
    ("exact", "segments/0/ends", (0, 0), 10**9),
    ("rk4-dichotomy", "segments/0/cuts", 0, 10**9),
    ("rk4-dichotomy", "segments/0/z", 0, 9),
    ("scipy-dop853", "segments/0/lengths", 0, 10**9),
    ("scipy-dop853", "segments/0/terms", 0, -1),
    ("taylor", "checkpoint/z", 0, 5),
    ("taylor", "checkpoint/orders", 0, 10**6),
    ("taylor", "checkpoint/sides", 0, 2),
]


@pytest.mark.parametrize(("integrator", "name", "entry", "value"), MISLEADING)
def test_indices_that_lead_out_of_an_array(
    integrator: str, name: str, entry: Any, value: int, saved: Callable[[str], Path], tmp_path: Path
) -> None:
    header, arrays = parts(saved(integrator))
    arrays[name] = arrays[name].copy()
    arrays[name][() if entry is None else entry] = value
    path = tmp_path / "r.hsol"
    path.write_bytes(sealed(header, arrays))
    with pytest.raises(hs.UsageError, match=r"r\.hsol is damaged: ValueError: "):
        hs.load_solution(path)


@pytest.mark.parametrize(
    "place", [[0, 0, 2**40], [50, 0, 10], [0, 10**6, 64], [np.nan] * 3, [np.inf] * 3, [1.0]]
)
def test_a_place_for_rows_that_are_not_there(
    place: list, saved: Callable[[str], Path], tmp_path: Path
) -> None:
    header, arrays = parts(saved("taylor"))
    arrays["checkpoint/place"] = np.array(place, dtype=float)
    (tmp_path / "r.hsol").write_bytes(sealed(header, arrays))
    with pytest.raises(hs.UsageError, match="its file is damaged: the numbers of rows"):
        hs.load_solution(tmp_path / "r.hsol").resume(0.03)


def zipped(members: dict[str, bytes], **options: Any) -> bytes:
    """A zip of these."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", **options) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


def array_of(shape: tuple, descr: str = "<f8", content: bytes = b"") -> bytes:
    """What NumPy writes for an array of a shape, with the content of another."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": descr, "fortran_order": False, "shape": shape})
    return head.getvalue() + content


def flagged(content: bytes) -> bytes:
    """A zip whose members say that they are encrypted."""
    changed = bytearray(content)
    for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        changed[changed.index(mark) + offset] |= 1
    return bytes(changed)


DEEP = b"[" * 200_000
BAD_FILES = {
    "nothing": lambda: b"",
    "no zip": lambda: b"no solution" * 100,
    "a bomb": lambda: zipped({"header.npy": bytes(300_000_000)}, compression=zipfile.ZIP_DEFLATED),
    "compressed": lambda: zipped({"header.npy": array_of((0,))}, compression=zipfile.ZIP_BZIP2),
    "encrypted": lambda: flagged(zipped({"header.npy": array_of((0,))})),
    "terabytes": lambda: zipped({"header.npy": array_of((10**13,))}),
    "less than nothing": lambda: zipped({"header.npy": array_of((-1,))}),
    "many times nothing": lambda: zipped({"header.npy": array_of((10**15, 0))}),
    "objects": lambda: zipped({"header.npy": array_of((1,), "|O", b"cposix\nsystem\n.")}),
    "records": lambda: zipped({"header.npy": array_of((1,), "|V8", bytes(8))}),
    "too few bytes": lambda: zipped({"header.npy": array_of((3,), content=bytes(16))}),
    "no array": lambda: zipped({"header.npy": b"\x93NUMPY" + b"\xff" * 40}),
    "a deep shape": lambda: zipped({"header.npy": b"\x93NUMPY\x01\x00\x10\x27" + b"(" * 10_000}),
    "deep header": lambda: zipped({"header.npy": array_of((len(DEEP),), "|u1", DEEP)}),
    "a list": lambda: zipped({"header.npy": array_of((2,), "|u1", b"[]")}),
    "a number": lambda: zipped({"header.npy": array_of((1,), "|u1", b"3")}),
    "no text": lambda: zipped({"header.npy": array_of((2,), "|u1", b"\xff\xfe")}),
    "names that meet": lambda: zipped({"header.npy": array_of((0,)), "header": array_of((0,))}),
}


@pytest.mark.parametrize("kind", BAD_FILES)
def test_files_that_are_no_solutions(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "r.hsol"
    path.write_bytes(BAD_FILES[kind]())
    tracemalloc.start()
    try:
        with pytest.raises(hs.UsageError, match=r"r\.hsol is not a saved solution"):
            hs.load_solution(path)
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="devices and pipes are those of POSIX")
@pytest.mark.parametrize("kind", ["device", "pipe", "folder"])
def test_what_is_no_file(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "r.hsol"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to("/dev/zero")
    with pytest.raises(hs.UsageError, match=r"r\.hsol cannot be read: it is not a regular file"):
        hs.load_solution(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="devices and pipes are those of POSIX")
@pytest.mark.parametrize("what", ["model.toml", "table.csv"])
def test_models_and_tables_that_are_no_files(what: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / what)
    model = tmp_path / "scene.toml"
    model.write_text(
        '[states]\nx = { start = 0, der = "u" }\n[inputs.u]\nkind = "table"\nfile = "table.csv"\n'
        if what == "table.csv"
        else '[states]\nx = { start = 0, der = "-x" }\n'
    )
    with pytest.raises(hs.HybridsimError, match=r"no file|regular"):
        hs.load(tmp_path / what if what == "model.toml" else model)
