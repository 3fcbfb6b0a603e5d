"""This module caches compiled kernels on disk, with the same safety rules as the other caches.

A cached kernel is private to this user and checked against its digest; a damaged file is compiled again.
numba's own cache loads any pickle under a predictable name and ends with a traceback if a file is truncated.
Two of its processes may exchange their numbered files, and it fails in a read-only folder.

This module uses only the cache interface of numba. Without it each process would compile all kernels.
"""

from __future__ import annotations

import hashlib
import pickle
from pathlib import Path
from typing import Any

from hybridsim.engine.native.cache import _PACKAGE, engine_key, kernel_folder, load_whole, store_whole
from hybridsim.engine.native.inner_parts import find_part

_AGAIN = "each process compiles all kernels again"
CompileResultCacheImpl: Any = find_part("numba.core.caching", "CompileResultCacheImpl", _AGAIN)
FunctionCache: Any = find_part("numba.core.caching", "FunctionCache", _AGAIN)
dumps: Any = find_part("numba.core.serialize", "dumps", _AGAIN)


def cache_on_disk(dispatcher: Any, function: Any) -> None:
    """Make a numba function or C callback load its compiled code from the cache, and store new code in the cache."""
    folder = kernel_folder()
    if folder is not None and None not in (CompileResultCacheImpl, FunctionCache, dumps):
        dispatcher._cache = KernelCache(function, folder)


class _Place:
    """The folder and the source of one function, with the attribute names that numba expects."""

    def __init__(self, function: Any, folder: Path) -> None:
        code = function.__code__
        self._py_file, self.line = code.co_filename, code.co_firstlineno
        source = Path(self._py_file)
        if source.is_relative_to(_PACKAGE):  # independent of the place of installation
            self.folder = folder / "kernels" / source.relative_to(_PACKAGE).with_suffix("")
            self._stamp = engine_key()
        else:
            self.folder = folder / "others" / hashlib.sha256(str(source).encode()).hexdigest()[:24]
            self._stamp = _digest_of(source)

    def ensure_cache_path(self) -> None:
        """Do nothing, because the folder is created when a file is stored."""

    def get_cache_path(self) -> str:
        """Return the folder of the functions of one source file."""
        return str(self.folder)

    def get_source_stamp(self) -> str:
        """Return a stamp that changes with the source code."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """Return a string that distinguishes functions of the same name in one file."""
        return str(self.line)


class _Form(CompileResultCacheImpl or object):  # type: ignore[misc]  # a numba without it
    """The format of numba's compiled functions, independent of numba's settings."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Place(function, folder)
        self._filename_base = self.get_filename_base(function.__qualname__, "")


class _Versions:
    """The compiled versions of one function, each stored in its own file."""

    def __init__(self, folder: Path, name: str, stamp: str) -> None:
        self._folder, self._name, self._stamp = folder, name, stamp

    def _path(self, key: Any) -> Path:
        return self._folder / f"{self._name}.{hashlib.sha256(str(key).encode()).hexdigest()[:24]}.nbc"

    def save(self, key: Any, data: Any) -> None:
        """Store a compiled version together with its key."""
        store_whole(self._path(key), dumps((self._stamp, key, data)))

    def load(self, key: Any) -> Any:
        """Return the compiled version for a key, or None if this source has no version for the key."""
        content = load_whole(self._path(key))
        if content is None:
            return None
        stamp, found, data = pickle.loads(content)
        return data if (stamp, found) == (self._stamp, key) else None

    def flush(self) -> None:
        """Do nothing, because no index is kept in memory."""


class KernelCache(FunctionCache or object):  # type: ignore[misc]  # a numba without it
    """A numba cache of one function that stores files in hybridsim's format."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._name, self._py_func = repr(function), function
        self._impl = _Form(function, folder)
        place = self._impl.locator
        self._cache_path = place.get_cache_path()
        self._cache_file = _Versions(place.folder, self._impl.filename_base, place.get_source_stamp())
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a compiled version, or None if it has to be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # from another build of numba; a real fault will show when the kernel is compiled
            return None


def _digest_of(source: Path) -> str:
    try:
        return hashlib.sha256(source.read_bytes()).hexdigest()
    except OSError:  # entered interactively or from an archive: the key contains the bytes of the code
        return ""
