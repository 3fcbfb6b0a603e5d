"""What leaves the program: messages to stderr, data to stdout, files where they can be written."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any, TextIO

from hybridsim.errors import UsageError, printable
from hybridsim.files import json_text
from hybridsim.readable import aligned

TRIAL = ".hybridsim-"  # how the name of a folder begins that is made, and removed, to see whether it can be


class _Data:
    """Where data go while everything else that is printed goes to standard error; None: to `sys.stdout` as it is."""

    stream: TextIO | None = None


@contextmanager
def only_data_on_stdout() -> Iterator[None]:
    """Send what libraries print to standard error, be it by Python or by C: standard output holds data alone."""
    real = sys.stdout
    if real is None:  # the process was started without one
        yield
        return
    real.flush()
    saved, stream = -1, real
    with suppress(
        OSError, ValueError
    ):  # a stream or a process without descriptors: what C prints is not seen there
        number, errors = real.fileno(), sys.stderr.fileno()
        saved = os.dup(1)
        if number == 1:
            lines = 1 if real.isatty() else -1
            stream = os.fdopen(os.dup(saved), "w", lines, encoding=real.encoding, errors=real.errors)
        os.dup2(errors, 1)
    _Data.stream = stream
    try:
        with redirect_stdout(sys.stderr):
            yield
        stream.flush()
    except BrokenPipeError:
        with suppress(OSError, ValueError):  # Python flushes it once more at its end
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        raise
    finally:
        _Data.stream = None
        if saved >= 0:
            os.dup2(saved, 1)
            os.close(saved)
        if stream is not real:
            stream.close()


def complain(message: str) -> None:
    """Print a message for the person at the terminal."""
    print(printable(f"hybridsim: {message}"), file=sys.stderr, flush=True)


def say(text: str = "") -> None:
    """Print data for people: what a model's titles, units and names hold does not steer the terminal."""
    print(printable(text), file=_Data.stream)


def print_json(value: Any) -> None:
    """Print one JSON document; numbers that JSON does not have (nan, inf) become null."""
    print(json_text(value), file=_Data.stream)


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print rows under a header, columns aligned to the left."""
    for line in aligned([header, *rows]):
        say(line)


def require_writable(path: Path, option: str, suffixes: Sequence[str] = ()) -> None:
    """Refuse a file that cannot be written before the work is done, not after it."""
    if suffixes and path.suffix.lower() not in suffixes:
        found = f"the ending {path.suffix!r}" if path.suffix else "no ending"
        raise UsageError(f"{option}: {path} has {found}", remedy=f"use one of {' '.join(suffixes)}")
    try:
        is_folder = path.is_dir()
    except OSError as fault:  # a name that no file can have
        raise UsageError(f"{option}: {path}: {fault.strerror}", remedy="name another file") from None
    if is_folder:
        raise UsageError(
            f"{option}: {path} is a folder", remedy=f"name a file in it, such as {path / 'result'}"
        )
    folder = path.parent
    if not folder.is_dir():
        raise UsageError(f"{option}: there is no folder {folder}", remedy="create it first, or name another")
    if not (os.access(path, os.W_OK) if path.exists() else _takes_files(folder)):
        raise UsageError(
            f"{option}: {path} may not be written", remedy="choose a place that you may write to"
        )


def require_apart(path: Path, option: str, others: Mapping[str, Path]) -> None:
    """Refuse to write over a file that the command reads, or that another of its options writes."""
    for what, other in others.items():
        if path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other)):
            raise UsageError(f"{option}: {path} is {what}", remedy="name another file")


def _takes_files(folder: Path) -> bool:
    """Whether files can be made in a folder; some say that they may be written, and are not."""
    try:
        with tempfile.TemporaryDirectory(dir=folder, prefix=TRIAL):
            return True
    except OSError:
        return False


def require_folder(path: Path, option: str) -> None:
    """Refuse a folder for results that does not exist and cannot be made."""
    nearest = path
    try:
        while not nearest.exists() and nearest != nearest.parent:
            nearest = nearest.parent
    except OSError as fault:  # a name that no file can have
        raise UsageError(f"{option}: {path}: {fault.strerror}", remedy="name a folder") from None
    if not nearest.is_dir():
        raise UsageError(f"{option}: {nearest} is a file", remedy="name a folder")
    if not _takes_files(nearest):
        raise UsageError(
            f"{option}: {nearest} may not be written", remedy="choose a place that you may write to"
        )
