"""Where compiled things live on disk: one folder for generated model modules, one for the engine's own kernels."""

from __future__ import annotations

import getpass
import hashlib
import os
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path

from hybridsim.files import cannot_write

_PACKAGE = Path(__file__).resolve().parent.parent
_KERNEL_FLOORS = ("engine", "integrators", "mechanics")  # the floors that define kernels


def cache_root() -> Path:
    """Folder of everything hybridsim keeps between runs: ``$HYBRIDSIM_CACHE``, else the user's cache folder."""
    chosen = os.environ.get("HYBRIDSIM_CACHE")
    if chosen:
        return _usable(Path(chosen))
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return _usable(base / "hybridsim")


@cache
def _usable(folder: Path) -> Path:
    """The folder if it can be made and written to, else one among the temporary files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    temporary = Path(tempfile.gettempdir()) / f"hybridsim-{getpass.getuser()}"
    temporary.mkdir(parents=True, exist_ok=True, mode=0o700)
    print(f"hybridsim: {folder} cannot be written to, the cache is {temporary}", file=sys.stderr)
    return temporary


def write_whole(path: Path, content: bytes) -> None:
    """Write in one move, so that another process never reads half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=path.suffix)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except OSError as fault:
        os.remove(temporary)
        raise cannot_write(path, fault) from fault


@cache
def engine_key() -> str:
    """Hash of the engine's sources and of the versions that shape its machine code.

    numba notices an edit in the file of a cached function, but not in a file that it calls into
    (numba issue 1833); a folder named after all the sources leaves nothing stale.
    """
    from importlib.metadata import version

    digest = hashlib.sha256()
    for floor in _KERNEL_FLOORS:
        for path in sorted((_PACKAGE / floor).glob("**/*.py")):
            digest.update(path.name.encode())
            digest.update(path.read_bytes())
    versions = f"{sys.version_info[:3]} {version('numba')} {version('numpy')}"
    digest.update(versions.encode())
    return digest.hexdigest()[:16]


def kernel_folder() -> Path:
    """Folder of the engine's compiled kernels, valid for these sources and versions only."""
    return cache_root() / f"engine-{engine_key()}"


def model_folder() -> Path:
    """Folder of generated model modules and their compiled functions."""
    return kernel_folder() / "models"


def clear() -> int:
    """Delete the whole cache; return the number of bytes freed."""
    root = cache_root()
    freed = size()
    for entry in root.glob("engine-*"):
        shutil.rmtree(entry, ignore_errors=True)
    return freed


def size() -> int:
    """Bytes the cache holds now."""
    return sum(path.stat().st_size for path in cache_root().glob("engine-*/**/*") if path.is_file())
