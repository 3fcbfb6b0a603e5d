"""This module writes messages to stderr and data to stdout, and checks that files can be written."""

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
from hybridsim.presentation.readable import aligned

TRIAL = ".hybridsim-"  # prefix of the temporary folder that tests whether a folder is writable


class _Data:
    """The stream for data while stdout is redirected to stderr, otherwise None."""

    stream: TextIO | None = None


@contextmanager
def only_data_on_stdout() -> Iterator[None]:
    """Redirect all output of libraries to stderr, so that stdout contains only data."""
    real = sys.stdout
    if real is None:  # the process has no standard output
        yield
        return
    real.flush()
    saved, stream = -1, real
    with suppress(OSError, ValueError):  # without file descriptors, the output of C code cannot be redirected
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
        with suppress(OSError, ValueError):  # Python flushes the stream again at exit
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
    """Print a message to stderr."""
    print(printable(f"hybridsim: {message}"), file=sys.stderr, flush=True)


def say(text: str = "") -> None:
    """Print text to stdout without control characters, which names and units may contain."""
    print(printable(text), file=_Data.stream)


def print_json(value: Any) -> None:
    """Print one JSON document; nan and inf become null."""
    print(json_text(value), file=_Data.stream)


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print rows under a header, in left-aligned columns."""
    for line in aligned([header, *rows]):
        say(line)


def require_writable(path: Path, option: str, suffixes: Sequence[str] = ()) -> None:
    """Raise an error if a file cannot be written, before the work starts."""
    if suffixes and path.suffix.lower() not in suffixes:
        fault = f"unsupported file type '{path.suffix}'" if path.suffix else f"'{path}' has no file type"
        raise UsageError(f"{option}: {fault}", remedy=f"use {' or '.join(suffixes)}")
    try:
        is_folder = path.is_dir()
    except OSError as error:  # an invalid file name
        raise UsageError(f"{option}: {path}: {error.strerror}", remedy="use another file name") from None
    if is_folder:
        raise UsageError(
            f"{option}: {path} is a folder", remedy=f"use the name of a file, such as {path / 'result'}"
        )
    folder = path.parent
    if not folder.is_dir():
        raise UsageError(
            f"{option}: the folder {folder} does not exist", remedy="create this folder, or use another one"
        )
    if not (os.access(path, os.W_OK) if path.exists() else _takes_files(folder)):
        raise UsageError(
            f"{option}: no permission to write {path}", remedy="use a folder that you can write to"
        )


def require_apart(path: Path, option: str, others: Mapping[str, Path]) -> None:
    """Raise an error if an output file is also an input file, or the file of another option."""
    for other_use, other in others.items():
        if path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other)):
            raise UsageError(f"{option}: {path} is also {other_use}", remedy="use another file name")


def _takes_files(folder: Path) -> bool:
    """Return whether files can be created in a folder, by creating one."""
    try:
        with tempfile.TemporaryDirectory(dir=folder, prefix=TRIAL):
            return True
    except OSError:
        return False


def require_folder(path: Path, option: str) -> None:
    """Raise an error if a folder for results neither exists nor can be created."""
    existing = path
    try:
        while not existing.exists() and existing != existing.parent:
            existing = existing.parent
    except OSError as fault:  # an invalid folder name
        raise UsageError(f"{option}: {path}: {fault.strerror}", remedy="use another folder") from None
    if not existing.is_dir():
        raise UsageError(f"{option}: {existing} is a file, not a folder", remedy="use the name of a folder")
    if not _takes_files(existing):
        raise UsageError(
            f"{option}: no permission to write to {existing}", remedy="use a folder that you can write to"
        )
