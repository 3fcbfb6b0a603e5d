"""This module writes files atomically: if writing fails, the previous file is unchanged."""

from __future__ import annotations

import csv
import errno
import json
import math
import os
import secrets
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from os import PathLike
from typing import Any

from hybridsim.errors import UsageError

_TRIALS = 100  # attempts to find an unused name with 64 random bits
_NO_SPACE = "free some disk space, or use another path"
_REMEDIES = {
    errno.ENOSPC: _NO_SPACE,
    errno.EDQUOT: _NO_SPACE,
    errno.EISDIR: "add a file name to the path",
    errno.ENOENT: "create the folder first, or use another path",
    errno.EACCES: "permit writing to the file and its folder, or use another path",
}
_LETTERS = 100  # leading characters of the name that a temporary name copies; file systems allow 255 bytes


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[str]:
    """Yield a temporary path; after the block succeeds, the temporary file replaces `path`.

    The temporary file has a unique name in the same folder. If two processes write the same file, the last complete
    file remains. A replaced file keeps its mode and owner, and before the replacement only this user can read the new
    file. After an error the temporary file is deleted. Devices and pipes are written directly.

    Raises
    ------
    UsageError
        If the file cannot be written, with the reason from the operating system.

    Examples
    --------
    >>> with whole_file("table.csv") as partly, open(partly, "w") as file:  # doctest: +SKIP
    ...     file.write("t,x\\n")
    """
    named = path_text(path)
    try:
        before = _found(named)
        is_other = before is not None and not stat.S_ISREG(before.st_mode)
        if is_other or named.startswith("/dev/"):
            yield named
            return
        final = os.path.realpath(named)
        if before is not None and not os.access(final, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        partly = _new_file(final, 0o666 if before is None else 0o600)
        try:
            yield partly
            if before is not None:
                _dress(partly, before)
            os.replace(partly, final)
        finally:
            with suppress(OSError):  # after success the file no longer has this name
                os.remove(partly)
    except BrokenPipeError:
        raise
    except OSError as fault:
        raise cannot_write(named, fault) from fault


def _found(path: str) -> os.stat_result | None:
    try:
        return os.stat(path)
    except FileNotFoundError:
        return None


def _new_file(final: str, mode: int) -> str:
    """Create an empty file with an unused name in the same folder as a path."""
    folder, name = os.path.split(final)
    stem, suffix = os.path.splitext(name)
    for _ in range(_TRIALS):
        path = os.path.join(folder, f".{stem[:_LETTERS]}-{secrets.token_hex(8)}.part{suffix}")
        with suppress(FileExistsError):
            os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode))
            return path
    raise FileExistsError(errno.EEXIST, "the folder has no unused name for a temporary file")


def _dress(path: str, before: os.stat_result) -> None:
    """Flush a file to the disk, and give it the owner and the mode of the replaced file."""
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
                mode &= ~0o070  # the group differs, so it gets no access
    os.chmod(path, mode)


@contextmanager
def held(path: str | PathLike[str], busy: str) -> Iterator[None]:
    """Lock a file or folder during a block; a second attempt to lock it raises an error.

    The operating system releases the lock when the process ends. On systems without such locks nothing is locked.

    Raises
    ------
    UsageError
        If it is already locked, with the message `busy`.
    """
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:  # for example a folder on Windows
        yield
        return
    try:
        hold(handle, busy)
        yield
    finally:
        os.close(handle)


def hold(handle: int, busy: str) -> None:
    """Lock an open file until it is closed."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(busy, remedy="wait until the lock is released, or use another path") from None
    except OSError:  # a file system without locks
        return


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a text file atomically."""
    with whole_file(path) as partly, open(partly, "w", encoding="utf-8") as file:
        file.write(text)


def cannot_write(path: str | PathLike[str], fault: OSError) -> UsageError:
    """Return the error for a file that cannot be written, with the reason from the operating system."""
    why = fault.strerror or str(fault)
    remedy = _REMEDIES.get(fault.errno or 0, "use another path")
    return UsageError(f"{os.fspath(path)} cannot be written: {why}", remedy=remedy)


def path_text(path: object) -> str:
    """Return a path as a string.

    Raises
    ------
    UsageError
        If the object is neither a string nor a path.
    """
    try:
        found = os.fspath(path)  # type: ignore[call-overload]  # it may be anything
    except TypeError:
        found = path
    if not isinstance(found, str) or "\0" in found or not found:
        raise UsageError(f"A path cannot be {path!r}", remedy="use the path of a file as a string")
    return found


def json_text(value: Any) -> str:
    """Return a value as a JSON document; nan and inf become null."""
    return json.dumps(plain(value), indent=2, ensure_ascii=True, allow_nan=False)


def json_record(record: Mapping[str, Any], path: str | PathLike[str] | None) -> str:
    """Return a result as a JSON document, and write it if a path is given."""
    text = json_text(record)
    if path is not None:
        write_text(path, text + "\n")
    return text


def csv_records(path: str | PathLike[str], records: Sequence[Mapping[str, Any]]) -> None:
    """Write records with the same keys as lines of a CSV file; mappings are written as JSON."""
    with whole_file(path) as partly, open(partly, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(records[0]) if records else [])
        writer.writeheader()
        for record in records:
            texts = {k: json.dumps(v, default=str) for k, v in record.items() if isinstance(v, Mapping)}
            writer.writerow({**record, **texts})


def fields_of(owner: object, *names: str) -> dict[str, Any]:
    """Return the named attributes of an object as a record, in the given order."""
    return {name: getattr(owner, name) for name in names}


def plain(value: Any, digits: int | None = None) -> Any:
    """Return a value as lists, mappings, text and numbers, rounded to some digits; nan and inf become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item, digits) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy arrays and numbers
        return plain(value.tolist(), digits)
    if isinstance(value, float) and math.isfinite(value):
        return value if digits is None else float(f"{value:.{digits}g}")
    if isinstance(value, float):
        return None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Iterable):
        return [plain(item, digits) for item in value]
    return str(value)
