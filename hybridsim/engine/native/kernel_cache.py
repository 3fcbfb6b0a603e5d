"""Compiled kernels on disk, kept as the rest of the cache is: whole, this user's own, and made again if they are not.

numba's own cache loads whatever pickle lies at a name that anyone can work out, ends with a traceback where one is cut
short, numbers its files so that two processes may exchange them, and gives up on a folder that may only be read.

The parts of numba used here are those that it calls a cache. Without them each process would compile all kernels.
"""

from __future__ import annotations

import hashlib
import pickle
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

from hybridsim.engine.native.cache import _PACKAGE, engine_key, kernel_folder, load_whole, store_whole


def keep_on_disk(dispatcher: Any, function: Any) -> None:
    """Let a compiled function of numba, or a callback for C, look for its code on disk, and leave it there."""
    folder = kernel_folder()
    if folder is not None:
        dispatcher._cache = KernelCache(function, folder)


class _Place:
    """The place and the source of one function's code, under the names by which numba asks for them."""

    def __init__(self, function: Any, folder: Path) -> None:
        code = function.__code__
        self._py_file, self.line = code.co_filename, code.co_firstlineno
        source = Path(self._py_file)
        if source.is_relative_to(_PACKAGE):  # wherever it is installed
            self.folder = folder / "kernels" / source.relative_to(_PACKAGE).with_suffix("")
            self._stamp = engine_key()
        else:
            self.folder = folder / "others" / hashlib.sha256(str(source).encode()).hexdigest()[:24]
            self._stamp = _digest_of(source)

    def ensure_cache_path(self) -> None:
        """The folder is made when something is kept."""

    def get_cache_path(self) -> str:
        """Folder of the file's functions."""
        return str(self.folder)

    def get_source_stamp(self) -> str:
        """What changes with the source."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """What tells functions of one name in one file from each other."""
        return str(self.line)


class _Form(CompileResultCacheImpl):
    """How compiled functions are written, as numba has it; the place is ours, whatever else is set."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Place(function, folder)
        self._filename_base = self.get_filename_base(function.__qualname__, "")


class _Versions:
    """The compiled versions of one function, a file for each."""

    def __init__(self, folder: Path, name: str, stamp: str) -> None:
        self._folder, self._name, self._stamp = folder, name, stamp

    def _path(self, key: Any) -> Path:
        return self._folder / f"{self._name}.{hashlib.sha256(str(key).encode()).hexdigest()[:24]}.nbc"

    def save(self, key: Any, data: Any) -> None:
        """Keep a version, with what it is of."""
        store_whole(self._path(key), dumps((self._stamp, key, data)))

    def load(self, key: Any) -> Any:
        """The version for a key; None if this source has no such version."""
        content = load_whole(self._path(key))
        if content is None:
            return None
        stamp, found, data = pickle.loads(content)
        return data if (stamp, found) == (self._stamp, key) else None

    def flush(self) -> None:
        """Nothing is remembered between calls."""


class KernelCache(FunctionCache):
    """numba's cache of one function, with files of ours."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._name, self._py_func = repr(function), function
        self._impl = _Form(function, folder)
        place = self._impl.locator
        self._cache_path = place.get_cache_path()
        self._cache_file = _Versions(place.folder, self._impl.filename_base, place.get_source_stamp())
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """A compiled version; None where it is to be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except (
            Exception
        ):  # of another build of numba, such as it may be: compiling tells what is wrong, if anything
            return None


def _digest_of(source: Path) -> str:
    try:
        return hashlib.sha256(source.read_bytes()).hexdigest()
    except OSError:  # typed in, or of an archive: the bytes of the code, which are in the key, tell it
        return ""
