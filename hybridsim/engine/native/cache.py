"""Where compiled things live on disk: one folder for generated model modules, one for the engine's own kernels.

What is found there runs. The folder is therefore this user's own (see `hybridsim.engine.native.private_folder`);
without such a folder nothing is kept, and each process compiles for itself.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

from hybridsim.engine.native.private_folder import HAS_OWNERS, is_trusted_file, make_private, why_not

_PACKAGE = Path(__file__).resolve().parents[2]
_KERNEL_FLOORS = ("engine", "integrators", "ensemble", "mechanics")  # the floors that define kernels
_MODEL_FLOORS = ("expr", "model", "engine")  # the floors that write the modules of models
_MARK = "hybridsim.cache"  # a file in each folder that hybridsim made
_MARK_TEXT = b"Compiled code of hybridsim. `hybridsim cache clear` deletes this folder.\n"
_DIGEST = hashlib.sha256().digest_size


def chosen_root() -> Path | None:
    """The folder that is meant to hold the cache: ``$HYBRIDSIM_CACHE``, else the user's cache folder.

    None where the system does not say what the user's folder is.
    """
    chosen = os.environ.get("HYBRIDSIM_CACHE")
    if chosen:
        return Path(os.path.abspath(chosen))
    try:
        if sys.platform == "win32":
            base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
        elif sys.platform == "darwin":
            base = Path.home() / "Library" / "Caches"
        else:
            base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except (RuntimeError, KeyError):  # no HOME, and no entry in the password file
        return None
    return Path(os.path.abspath(base)) / "hybridsim"


def cache_root() -> Path | None:
    """Folder of everything hybridsim keeps between runs; None where no folder belongs to this user."""
    root = chosen_root()
    if root is None:
        note("no cache: this user has no home folder", "set HYBRIDSIM_CACHE to a private folder")
        return None
    return root if _is_usable(root) else None


@cache
def _is_usable(folder: Path) -> bool:
    """Whether a folder is there, or could be made, and nobody else could have put code into it; if not, say why."""
    reason = why_not(folder)
    if reason is None:
        try:
            make_private(folder)
            reason = why_not(folder)  # somebody may have been faster
        except OSError as fault:
            reason = f"cannot create {folder}: {fault.strerror}"
    if reason is not None:
        note(f"no cache: {reason}", "set HYBRIDSIM_CACHE to a private folder with mode 700")
    return reason is None


_noted: set[str] = set()  # in this process: one line of a kind is enough


def note(text: str, remedy: str) -> None:
    """Say once, on stderr, why compiled code is not kept."""
    if text not in _noted:
        _noted.add(text)
        print(f"hybridsim: {text}; compiled code is not kept ({remedy})", file=sys.stderr, flush=True)


@cache
def engine_key() -> str:
    """Hash of the engine's sources and of the versions that shape its machine code.

    numba notices an edit in the file of a cached function, but not in a file that it calls into
    (numba issue 1833); a folder named after all the sources leaves nothing stale.
    """
    from importlib.metadata import version

    digest = _of_sources(_KERNEL_FLOORS)
    versions = f"{sys.version_info[:3]} {version('numba')} {version('numpy')}"
    digest.update(versions.encode())
    return digest.hexdigest()[:16]


@cache
def _model_key() -> str:
    """Hash of the sources that say what the module of a model contains."""
    return _of_sources(_MODEL_FLOORS).hexdigest()[:16]


def _of_sources(floors: tuple[str, ...]) -> hashlib._Hash:
    """Hash of all sources of some floors, each with its path and its length: what is in one file is not in another."""
    digest = hashlib.sha256()
    for floor in floors:
        for path in sorted((_PACKAGE / floor).glob("**/*.py")):
            text = path.read_bytes()
            digest.update(f"{path.relative_to(_PACKAGE).as_posix()} {len(text)} ".encode())
            digest.update(text)
    return digest


def kernel_folder() -> Path | None:
    """Folder of the engine's compiled kernels, valid for these sources and versions only; None where none is kept."""
    root = cache_root()
    if root is None:
        return None
    folder = root / f"engine-{engine_key()}"
    return folder if _is_marked(folder) else None


@cache
def _is_marked(folder: Path) -> bool:
    """Whether a folder for these sources is usable; it is made, with our mark, if it can be."""
    if not _is_usable(folder):
        return False
    if not (folder / _MARK).exists():
        store(folder / _MARK, _MARK_TEXT)
    return True


def model_folder() -> Path | None:
    """Folder of generated model modules and their compiled functions; None where none is kept."""
    kernels = kernel_folder()
    if kernels is None:
        return None
    folder = kernels / f"models-{_model_key()}"
    return folder if _is_usable(folder) else None


def store(path: Path | None, content: bytes) -> bool:
    """Keep something in one move, so that another process never reads half a file; return whether it is kept.

    A disk that is full, or a folder that may only be read, costs the time to compile again and no more.
    """
    if path is None:
        return False
    temporary = None
    try:
        make_private(path.parent)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except OSError as fault:
        if temporary is not None:
            with suppress(OSError):
                os.remove(temporary)
        note(
            f"cannot write to the cache {chosen_root()}: {fault.strerror or fault}",
            "free disk space or set HYBRIDSIM_CACHE to another folder",
        )
        return False
    return True


def store_whole(path: Path | None, content: bytes) -> bool:
    """Keep something together with its digest, for `load_whole`."""
    return store(path, hashlib.sha256(content).digest() + content)


def load_whole(path: Path | None) -> bytes | None:
    """What `store_whole` kept; None where it is not there, not whole, or not this user's own."""
    if path is None or not is_trusted_file(path):
        return None
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    digest, content = stored[:_DIGEST], stored[_DIGEST:]
    return content if hashlib.sha256(content).digest() == digest else None


def _made_by_us(root: Path) -> tuple[list[Path], list[Path]]:
    """Folders of compiled code in a folder that carry our mark, and those that only have such a name."""
    ours, others = [], []
    for entry in sorted(root.glob("engine-*")):
        is_folder = entry.is_dir() and not entry.is_symlink()
        is_own = is_folder and (not HAS_OWNERS or os.lstat(entry).st_uid == os.geteuid())
        mark = entry / _MARK
        if is_own and is_trusted_file(mark) and mark.read_bytes() == _MARK_TEXT:
            ours.append(entry)
        else:
            others.append(entry)
    return ours, others


def clear() -> tuple[int, list[Path]]:
    """Delete the folders that carry our mark; return the bytes freed, and what has such a name and is left alone."""
    root = cache_root()
    if root is None:
        return 0, []
    ours, others = _made_by_us(root)
    freed = sum(_size(entry) for entry in ours)
    for entry in ours:
        shutil.rmtree(entry, ignore_errors=True)
    return freed - sum(_size(entry) for entry in ours), others


def _size(folder: Path) -> int:
    return sum(path.lstat().st_size for path in folder.glob("**/*") if path.is_file())
