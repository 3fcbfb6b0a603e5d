"""Code that others could have put into the cache is refused with a word, and never runs.

Every test fills a cache, plants code in each file of it that is ever executed, and makes the folder one that somebody
else could have written to. A run must then say so, give the right answer, and leave the planted code alone.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import fresh
import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners and modes are those of POSIX")
needs_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only the superuser gives files to others"
)
SOMEBODY = 54321  # has no entry in the password file

KERNEL = """
def three(given):
    return 3
"""
# a model's module, and a kernel of numba: the two kinds of code that are kept
SCRIPT = """
import sys
import numpy as np
from pathlib import Path
import hybridsim as hs
from hybridsim.engine.native import kernels
decay = hs.Model("decay", states=[hs.State("x", 1.0, "-x")])
if kernels.ENABLED:
    sys.path.insert(0, sys.argv[1])
    import own_kernel
    address = kernels.kernel_address(own_kernel.three, np.zeros(1))
    assert kernels.call_kernel.__name__ and address
from hybridsim.engine.system.modules import compiled
code = compiled(decay)
out = np.zeros(1)
code.module.flow(0.0, np.array([0.25]), np.zeros(0), np.zeros(0, dtype=np.int64), out)
assert code.address("flow")
print(out[0])
"""


class Place:
    """A cache, and what runs with it."""

    def __init__(self, folder: Path, kernels: Path | None = None) -> None:
        self.folder, self.cache, self.ran = folder, folder / "cache", folder / "ran"
        self.kernels = kernels or folder
        if kernels is None:
            (folder / "own_kernel.py").write_text(KERNEL)

    def run(self, *, cache: Path | None = None, **more: str) -> subprocess.CompletedProcess[str]:
        """Run the script in a process of its own."""
        paths = os.pathsep.join(path for path in sys.path if path)
        given = {"HYBRIDSIM_CACHE": str(cache or self.cache), "PYTHONPATH": paths, "NUMBA_CACHE_DIR": ""}
        return fresh.run(SCRIPT, str(self.kernels), environment={**os.environ, **given, **more})

    def plant(self) -> None:
        """Put code that leaves a trace in the place of all that is kept."""
        text = f"open({str(self.ran)!r}, 'w').close()\n"
        pickled = f"cposix\nsystem\n(S'touch {self.ran}'\ntR.".encode()
        planted = 0
        for path in self.cache.rglob("*"):
            if path.suffix == ".py":
                path.write_text(text)
                planted += 1
            elif path.suffix in (".nbi", ".nbc"):
                path.write_bytes(pickled)
                planted += 1
            elif path.suffix == ".pyc":
                path.unlink()
        assert planted >= 2

    def check(self, word: str, *, cache: Path | None = None) -> None:
        """The answer is right, the reason is told, and nothing planted ran."""
        done = self.run(cache=cache)
        assert not self.ran.exists()
        assert done.returncode == 0 and done.stdout == "-0.25\n", done.stderr
        assert word in done.stderr and "not stored" in done.stderr


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a cache that is filled."""
    folder = tmp_path_factory.mktemp("filled")
    assert Place(folder).run().stdout == "-0.25\n"
    return folder


@pytest.fixture
def full(filled: Path, tmp_path: Path) -> Place:
    """A cache that is filled."""
    found = Place(tmp_path, filled)
    shutil.copytree(filled / "cache", found.cache)
    return found


@pytest.fixture
def place(full: Place) -> Place:
    """A cache that is filled, in which code is planted."""
    full.plant()
    return full


def give_away(top: Path) -> None:
    """Make somebody else the owner of a folder and all that is in it."""
    for path in (top, *top.rglob("*")):
        os.chown(path, SOMEBODY, SOMEBODY, follow_symlinks=False)


def others_own(place: Place) -> str:
    give_away(place.cache)
    return f"{place.cache} belongs to another user ({SOMEBODY})"


def others_own_a_part(place: Place) -> str:
    (part,) = place.cache.glob("engine-*")
    give_away(part)
    return f"{part} belongs to another user"


def all_may_write(place: Place) -> str:
    place.cache.chmod(0o777)
    return f"other users may write to {place.cache} (mode 777)"


def all_may_write_a_part(place: Place) -> str:
    (part,) = place.cache.glob("engine-*")
    part.chmod(0o707)
    return f"other users may write to {part} (mode 707)"


def group_may_write(place: Place) -> str:
    os.chown(place.cache, -1, SOMEBODY)
    place.cache.chmod(0o770)
    return f"other users may write to {place.cache} (mode 770)"


def link_of_others(place: Place) -> str:
    real = place.cache.rename(place.folder / "real")
    place.cache.symlink_to(real)
    os.chown(place.cache, SOMEBODY, SOMEBODY, follow_symlinks=False)
    return f"{place.cache} belongs to another user"


def link_to_others(place: Place) -> str:
    real = place.cache.rename(place.folder / "real")
    place.cache.symlink_to("real")
    give_away(real)
    return f"{real} belongs to another user"


def link_of_others_within(place: Place) -> str:
    (part,) = place.cache.glob("engine-*")
    real = part.rename(place.folder / "real")
    part.symlink_to(real)
    os.chown(part, SOMEBODY, SOMEBODY, follow_symlinks=False)
    return f"{part} belongs to another user"


def all_may_rename_it(place: Place) -> str:
    place.folder.chmod(0o777)
    return f"other users may write to {place.folder} (mode 777)"


@needs_root
@pytest.mark.parametrize(
    "spoil",
    [
        others_own,
        others_own_a_part,
        all_may_write,
        all_may_write_a_part,
        group_may_write,
        link_of_others,
        link_to_others,
        link_of_others_within,
        all_may_rename_it,
    ],
)
def test_nothing_runs_that_others_may_have_put_there(spoil: Callable[[Place], str], place: Place) -> None:
    place.check(spoil(place))


def test_a_folder_for_all_is_refused_for_everybody(place: Place) -> None:
    place.check(all_may_write(place))


@needs_root
def test_single_files_of_others_are_made_again(place: Place) -> None:
    files = [path for path in place.cache.rglob("*") if path.is_file()]
    for path in files:
        os.chown(path, SOMEBODY, SOMEBODY)
    done = place.run()
    assert done.stdout == "-0.25\n" and not place.ran.exists()


def test_a_folder_that_is_made_is_for_this_user_alone(tmp_path: Path) -> None:
    found = Place(tmp_path)
    before = os.umask(0)
    try:
        assert found.run(cache=tmp_path / "a" / "b").stdout == "-0.25\n"
    finally:
        os.umask(before)
    made = [path for path in (tmp_path / "a").rglob("*") if path.is_dir()]
    assert len(made) > 3
    assert {
        path.stat().st_mode & 0o077 for path in [tmp_path / "a", *made] if path.name != "__pycache__"
    } == {0}


def test_own_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir(mode=0o700)
    (tmp_path / "link").symlink_to("real")
    done = Place(tmp_path).run(cache=tmp_path / "link")
    assert done.stdout == "-0.25\n" and "not stored" not in done.stderr
    assert list((tmp_path / "real").glob("engine-*"))


def test_files_that_are_cut_short_are_made_again(full: Place) -> None:
    sizes = {path: path.stat().st_size for path in full.cache.rglob("*.*") if path.is_file()}
    for path, size in sizes.items():
        os.truncate(path, size // 2)
        os.utime(path, (time.time() - 100, time.time() - 100))
    done = full.run()
    assert done.returncode == 0 and done.stdout == "-0.25\n", (done.returncode, done.stderr)
    assert "Traceback" not in done.stderr
    for path, size in sizes.items():
        assert path.suffix in (".cache", ".pyc") or path.stat().st_size == size, path


def tree(folder: Path) -> dict[str, int]:
    """Files and when they were written."""
    return {str(path): path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


@needs_root
def test_a_whole_cache_of_the_superuser_is_used_by_others(full: Place) -> None:
    for path in (full.cache, *full.cache.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    before = tree(full.cache)
    done = as_somebody(SCRIPT, str(full.kernels), HYBRIDSIM_CACHE=str(full.cache))
    assert done.stdout == "-0.25\n", done.stderr
    assert "not stored" not in done.stderr and tree(full.cache) == before


def as_somebody(script: str, *given: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Run a script as a user without an entry in the password file, and without a home folder.

    The user may read everything, since the interpreter may be in a private folder.
    """
    reads = ("--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search")
    head = ["setpriv", f"--reuid={SOMEBODY}", f"--regid={SOMEBODY}", "--clear-groups", *reads, sys.executable]
    if not shutil.which("setpriv") or subprocess.run([*head, "-c", "pass"], capture_output=True).returncode:
        pytest.skip("no process of another user can be started here")
    environment = {
        k: v for k, v in os.environ.items() if k not in ("HOME", "USER", "LOGNAME", "HYBRIDSIM_CACHE")
    }
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    return subprocess.run(
        [*head, "-c", script, *given],
        env={**environment, **more},
        cwd="/",
        capture_output=True,
        text=True,
        timeout=600,
    )


@needs_root
def test_a_user_without_an_entry_in_the_password_file(tmp_path: Path) -> None:
    (tmp_path / "own_kernel.py").write_text(KERNEL)
    done = as_somebody(SCRIPT, str(tmp_path))
    assert done.stdout == "-0.25\n", done.stderr
    assert "this user has no home folder" in done.stderr and "HYBRIDSIM_CACHE" in done.stderr


def test_numba_that_is_switched_off(tmp_path: Path) -> None:
    done = Place(tmp_path).run(NUMBA_DISABLE_JIT="1")
    assert done.stdout == "-0.25\n", done.stderr


@needs_root
def test_a_full_disk_is_named(tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k,mode=700", "tmpfs", str(small)])
    if mounted.returncode:
        pytest.skip("nothing may be mounted here")
    try:
        found = Place(tmp_path)
        done = found.run(cache=small)
        assert done.stdout == "-0.25\n", done.stderr
        assert f"cannot write to the cache {small}: No space left on device" in done.stderr
        assert done.stderr.count("cannot write to the cache") == 1
    finally:
        subprocess.run(["umount", str(small)], check=True)


def test_files_of_one_name_in_two_folders_have_keys_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from hybridsim.engine.native import cache

    monkeypatch.setattr(cache, "_PACKAGE", tmp_path)
    first, second = tmp_path / "engine" / "a" / "same.py", tmp_path / "engine" / "b" / "same.py"
    for path, text in ((first, "x = 1\n"), (second, "x = 2\n")):
        path.parent.mkdir(parents=True)
        path.write_text(text)
    before = cache._of_sources(("engine",)).hexdigest()
    first.rename(tmp_path / "held")
    second.rename(first)
    (tmp_path / "held").rename(second)
    assert cache._of_sources(("engine",)).hexdigest() != before
