"""This module manages the disk cache: folders for generated modules and for compiled kernels.

Files in the cache are executed. The folder must therefore be private to this user (see
`hybridsim.engine.native.private_folder`). Without such a folder nothing is cached, and each process compiles
again.
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
_KERNEL_FLOORS = ("engine", "integrators", "ensemble", "mechanics")  # packages that define kernels
_MODEL_FLOORS = ("expr", "model", "engine")  # packages that determine the modules of models
_MARK = "hybridsim.cache"  # name of a file in each folder that hybridsim created
_MARK_TEXT = b"Compiled code of hybridsim. `hybridsim cache clear` deletes this folder.\n"
_DIGEST = hashlib.sha256().digest_size


def chosen_root() -> Path | None:
    """Return the folder of the cache: ``$HYBRIDSIM_CACHE``, or a folder in the user's cache folder.

    Return None if the user has no home folder.
    """
    chosen = os.environ.get("HYBRIDSIM_CACHE")
    if chosen:
        return Path(os.path.abspath(chosen))
    from platformdirs import user_cache_path

    try:
        folder = user_cache_path("hybridsim", appauthor=False, opinion=False)
    except (RuntimeError, KeyError):  # no HOME, and no entry in the password file
        return None
    return folder if folder.is_absolute() else None  # some versions return ~/.cache without a home folder


def cache_root() -> Path | None:
    """Return the cache folder, or None if no private folder is available."""
    root = chosen_root()
    if root is None:
        note("the cache is not used: this user has no home folder", "set HYBRIDSIM_CACHE to a private folder")
        return None
    return root if _is_usable(root) else None


@cache
def _is_usable(folder: Path) -> bool:
    """Return whether a private folder exists or can be created; if not, print the reason."""
    reason = why_not(folder)
    if reason is None:
        try:
            make_private(folder)
            reason = why_not(folder)  # another process may have created it meanwhile
        except OSError as fault:
            reason = f"cannot create {folder}: {fault.strerror}"
    if reason is not None:
        note(f"the cache is not used: {reason}", "set HYBRIDSIM_CACHE to a private folder with mode 700")
    return reason is None


@cache
def note(text: str, remedy: str) -> None:
    """Print the reason why compiled code is not cached, on stderr and only once."""
    print(f"hybridsim: {text}; compiled code is not stored ({remedy})", file=sys.stderr, flush=True)


@cache
def engine_key() -> str:
    """Return a hash of the engine's sources and of the versions that affect its machine code.

    numba detects an edit in the file of a cached function, but not in a file that the function calls into
    (numba issue 1833). A folder named after all sources excludes stale code.
    """
    from importlib.metadata import version

    digest = _of_sources(_KERNEL_FLOORS)
    versions = f"{sys.version_info[:3]} {version('numba')} {version('numpy')}"
    digest.update(versions.encode())
    return digest.hexdigest()[:16]


@cache
def _model_key() -> str:
    """Return a hash of all sources that affect the module of a model."""
    return _of_sources(_MODEL_FLOORS).hexdigest()[:16]


def _of_sources(floors: tuple[str, ...]) -> hashlib._Hash:
    """Return a hash of all source files of some packages."""
    digest = hashlib.sha256()
    for floor in floors:
        for path in sorted((_PACKAGE / floor).glob("**/*.py")):
            text = path.read_bytes()
            digest.update(f"{path.relative_to(_PACKAGE).as_posix()} {len(text)} ".encode())
            digest.update(text)
    return digest


def kernel_folder() -> Path | None:
    """Return the folder of compiled kernels for these sources and versions, or None if there is no cache."""
    root = cache_root()
    if root is None:
        return None
    folder = root / f"engine-{engine_key()}"
    return folder if _is_marked(folder) else None


@cache
def _is_marked(folder: Path) -> bool:
    """Return whether a cache folder can be used; create and mark it if it does not exist."""
    if not _is_usable(folder):
        return False
    if not (folder / _MARK).exists():
        store(folder / _MARK, _MARK_TEXT)
    return True


def model_folder() -> Path | None:
    """Return the folder of generated modules and their compiled functions, or None without a cache."""
    kernels = kernel_folder()
    if kernels is None:
        return None
    folder = kernels / f"models-{_model_key()}"
    return folder if _is_usable(folder) else None


def store(path: Path | None, content: bytes) -> bool:
    """Write a file atomically, so that other processes never read half a file; return whether the file was written.

    A full disk or a read-only folder only has the effect that code is compiled again.
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
    """Write content together with its checksum, for `load_whole`."""
    return store(path, hashlib.sha256(content).digest() + content)


def load_whole(path: Path | None) -> bytes | None:
    """Return the content that `store_whole` wrote, or None if it is missing, damaged or writable by others."""
    if path is None or not is_trusted_file(path):
        return None
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    digest, content = stored[:_DIGEST], stored[_DIGEST:]
    return content if hashlib.sha256(content).digest() == digest else None


def _made_by_us(root: Path) -> tuple[list[Path], list[Path]]:
    """Return the cache folders that contain the mark of hybridsim, and the folders without this mark."""
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
    """Delete the folders with hybridsim's mark; return the freed bytes and the remaining folders."""
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
