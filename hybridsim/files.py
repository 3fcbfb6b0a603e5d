"""Files that are whole or not there: what cannot be written to its end leaves what was there before."""

from __future__ import annotations

import errno
import json
import math
import os
import secrets
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from os import PathLike
from typing import Any

from hybridsim.errors import UsageError

_TRIALS = 100  # of names of 64 random bits each
_LETTERS = 100  # of a name that a temporary one begins with; file systems take 255 bytes


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[str]:
    """A path to write to in place of another, which it replaces once all is written.

    The path is a new one in the same folder, so that two processes that write one file do not meet: the last one's
    file stays, whole. The file keeps its mode and its owner, and until it is in its place only this user may read it.
    Where something fails it is removed. A device and a pipe are written to as they are.

    Raises
    ------
    UsageError
        Where the file cannot be written, with the reason of the system.

    Examples
    --------
    >>> with whole_file("table.csv") as partly, open(partly, "w") as file:  # doctest: +SKIP
    ...     file.write("t,x\\n")
    """
    given = path_text(path)
    try:
        before = _found(given)
        is_other = before is not None and not stat.S_ISREG(before.st_mode)
        if is_other or given.startswith("/dev/"):
            yield given
            return
        final = os.path.realpath(given)
        if before is not None and not os.access(final, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        partly = _new_file(final, 0o666 if before is None else 0o600)
        try:
            yield partly
            if before is not None:
                _dress(partly, before)
            os.replace(partly, final)
        finally:
            with suppress(OSError):  # it is in its place already
                os.remove(partly)
    except BrokenPipeError:
        raise
    except OSError as fault:
        raise cannot_write(given, fault) from fault


def _found(path: str) -> os.stat_result | None:
    try:
        return os.stat(path)
    except FileNotFoundError:
        return None


def _new_file(final: str, mode: int) -> str:
    """Make an empty file beside another, under a name that nobody has; the ending tells libraries the format."""
    folder, name = os.path.split(final)
    stem, suffix = os.path.splitext(name)
    for _ in range(_TRIALS):
        path = os.path.join(folder, f".{stem[:_LETTERS]}-{secrets.token_hex(8)}.part{suffix}")
        with suppress(FileExistsError):
            os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode))
            return path
    raise FileExistsError(errno.EEXIST, "no name for a temporary file is free")


def _dress(path: str, before: os.stat_result) -> None:
    """Give a file the owner and the mode of the one that it replaces, and see to it that its content is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
    mode = stat.S_IMODE(before.st_mode)
    if hasattr(os, "chown"):
        found = os.stat(path)
        if (found.st_uid, found.st_gid) != (before.st_uid, before.st_gid):
            try:
                os.chown(path, before.st_uid, before.st_gid)
            except OSError:
                mode &= ~0o070  # what one group may read is not for another
    os.chmod(path, mode)


@contextmanager
def held(path: str | PathLike[str], busy: str) -> Iterator[None]:
    """Hold a file or a folder as long as the block lasts; another process, or thread, that wants it is refused.

    A process that ends, however it does, holds nothing any more. Where the system has no such locks nothing is held.

    Raises
    ------
    UsageError
        Where another one holds it, with the message `busy`.
    """
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:  # such as a folder on Windows
        yield
        return
    try:
        hold(handle, busy)
        yield
    finally:
        os.close(handle)


def hold(handle: int, busy: str) -> None:
    """Hold an open file until it is closed; see `held`."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(busy, remedy="wait for it to end, or give another path") from None
    except OSError:  # a file system that has no locks
        return


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a text, whole or not at all."""
    with whole_file(path) as partly, open(partly, "w", encoding="utf-8") as file:
        file.write(text)


def cannot_write(path: str | PathLike[str], fault: OSError) -> UsageError:
    """What is raised for a file that cannot be written, with the reason of the system."""
    why = fault.strerror or str(fault)
    return UsageError(f"{os.fspath(path)} cannot be written: {why}", remedy="make room, or give another path")


def path_text(path: object) -> str:
    """A path as a text.

    Raises
    ------
    UsageError
        For what is neither a text nor a path.
    """
    try:
        found = os.fspath(path)  # type: ignore[call-overload]  # it may be anything
    except TypeError:
        found = path
    if not isinstance(found, str) or "\0" in found or not found:
        raise UsageError(f"the path is {path!r}", remedy="give the path of a file as a text")
    return found


def json_text(value: Any) -> str:
    """One JSON document; numbers that JSON does not have (nan, inf) become null."""
    return json.dumps(_plain(value), indent=2, ensure_ascii=True, allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy arrays and numbers
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Iterable):
        return [_plain(item) for item in value]
    return str(value)
