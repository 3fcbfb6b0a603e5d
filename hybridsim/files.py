"""Files that are whole or not there: what cannot be written to its end leaves what was there before."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike

from hybridsim.errors import UsageError


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[str]:
    """A path to write to in place of another, which it replaces once all is written.

    Where something fails it is removed. A device, a pipe, and a file in a folder that may not be written to are written
    to as they are.

    Raises
    ------
    UsageError
        Where the file cannot be written, with the reason of the system.

    Examples
    --------
    >>> with whole_file("table.csv") as partly, open(partly, "w") as file:  # doctest: +SKIP
    ...     file.write("t,x\\n")
    """
    given = os.fspath(path)
    final = os.path.realpath(given)
    folder, name = os.path.split(final)
    stem, suffix = os.path.splitext(name)  # which tells libraries of pictures the format
    partly = os.path.join(folder, f"{stem}.part{suffix}")
    try:
        is_there = os.path.exists(given)
        is_other = is_there and not stat.S_ISREG(os.stat(given).st_mode)
        if is_other or given.startswith("/dev/") or (is_there and not os.access(folder, os.W_OK)):
            yield given
            return
        try:
            yield partly
            os.replace(partly, final)
        finally:
            with suppress(OSError):  # it is in its place already, or was never made
                os.remove(partly)
    except BrokenPipeError:
        raise
    except OSError as fault:
        raise cannot_write(given, fault) from fault


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a text, whole or not at all."""
    with whole_file(path) as partly, open(partly, "w", encoding="utf-8") as file:
        file.write(text)


def cannot_write(path: str | PathLike[str], fault: OSError) -> UsageError:
    """What is raised for a file that cannot be written, with the reason of the system."""
    why = fault.strerror or str(fault)
    return UsageError(f"{os.fspath(path)} cannot be written: {why}", remedy="make room, or give another path")
