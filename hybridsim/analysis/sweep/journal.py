"""This module writes the results of a sweep to a file as they arrive, so that the sweep can be resumed.

Each piece of work is one line of JSON; an incomplete last line, cut off by a kill, is ignored. Numbers are
written with all digits, so that a sweep in parts equals a sweep in one bit for bit.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
from collections.abc import Sequence
from contextlib import suppress
from itertools import count
from os import PathLike
from types import TracebackType
from typing import IO, Any

import numpy as np

from hybridsim.analysis.sweep.identity import identity
from hybridsim.analysis.sweep.readings import Reading
from hybridsim.analysis.sweep.work.job import Outcome
from hybridsim.errors import UsageError
from hybridsim.files import cannot_write, hold, path_text

_FORMAT = "hybridsim sweep"
_MOST_BYTES = 1 << 28  # per line: about 10 million numbers


def fingerprint(*parts: object) -> str:
    """Return a hash that identifies a sweep: model, values, measure, options."""
    return hashlib.sha256("\n".join(map(identity, parts)).encode()).hexdigest()


class Journal:
    """The journal file of one sweep, open for more results.

    Parameters
    ----------
    path : its path.
    sweep : the `fingerprint` of the sweep.

    Attributes
    ----------
    known : the numbers of points and their outcomes that it already contained.

    Raises
    ------
    UsageError
        If the file is not a journal, belongs to another sweep, is in use, or cannot be written.
    """

    def __init__(self, path: str | PathLike[str], sweep: str) -> None:
        self.path = path_text(path)
        self.known: list[tuple[list[int], list[Outcome]]] = []
        self._file = self._opened()
        try:
            self._read(sweep)
        except BaseException:  # the file is closed on any error, which is raised again
            self._close()
            raise

    def _opened(self) -> IO[bytes]:
        """Open the file and lock it, so that no other sweep can write to it."""
        while True:
            try:
                is_other = os.path.exists(self.path) and not stat.S_ISREG(os.stat(self.path).st_mode)
                if is_other:
                    raise OSError(errno.EINVAL, "the path is not a regular file")
                file = open(self.path, "a+b")  # noqa: SIM115  # it stays open as long as the journal
            except OSError as error:
                raise cannot_write(self.path, error) from error
            try:
                hold(file.fileno(), f"{self.path} is in use by another sweep")
            except UsageError:
                file.close()
                raise
            # the previous sweep may have deleted the file in the meantime
            if os.path.exists(self.path) and os.path.samestat(os.stat(self.path), os.fstat(file.fileno())):
                return file
            file.close()

    def _read(self, sweep: str) -> None:
        """Read the existing results, and cut off an incomplete last line."""
        head = {"format": _FORMAT, "sweep": sweep}
        self._file.seek(0)
        end, line = 0, self._file.readline(_MOST_BYTES)
        if not line.endswith(b"\n") and _as_line(head).startswith(
            line
        ):  # nothing, or an incomplete first line of ours
            self._file.truncate(0)
            self._write(head)
            return
        self._check_head(line, head)
        for number in count(2):
            end += len(line)
            line = self._file.readline(_MOST_BYTES)
            if not line.endswith(b"\n") and len(line) < _MOST_BYTES:
                break
            try:
                self.known.append(_piece(json.loads(line)))
            except (ValueError, OverflowError, RecursionError) as error:
                raise UsageError(
                    f"{self.path}, line {number} is not a result of a sweep: {error}",
                    remedy="remove this line from the file, or delete the file",
                ) from error
        self._file.truncate(end)

    def _check_head(self, line: bytes, head: dict[str, str]) -> None:
        try:
            found = json.loads(line)
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict) or found.get("format") != _FORMAT:
            raise UsageError(
                f"{self.path} is not a journal of a sweep", remedy="use another path, or delete the file"
            )
        if found.get("sweep") != head["sweep"]:
            raise UsageError(
                f"{self.path} belongs to another sweep: its model, values, options or measure differ",
                remedy="finish the other sweep, delete the file, or use another path",
            )

    def note(self, numbers: range, outcomes: Sequence[Outcome]) -> None:
        """Append the outcomes of some points and flush the file, so that they survive a crash."""
        rows = [[o.status, {n: _written(v) for n, v in (o.found or {}).items()}] for o in outcomes]
        if rows:
            self._write([list(numbers[: len(rows)]), rows])

    def _write(self, line: Any) -> None:
        try:
            self._file.write(_as_line(line))
            self._file.flush()
        except OSError as error:
            raise cannot_write(self.path, error) from error

    def _close(self) -> None:
        with suppress(OSError):  # an earlier error of writing, which was reported
            self._file.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()


def _as_line(content: Any) -> bytes:
    return json.dumps(content).encode() + b"\n"


def _piece(line: Any) -> tuple[list[int], list[Outcome]]:
    """Read one line of the journal: the indices of some points, and their outcomes.

    Raises
    ------
    ValueError
        For any other content.
    """
    if not (isinstance(line, list) and len(line) == 2 and all(isinstance(part, list) for part in line)):
        raise ValueError("the line is not a pair of lists: point numbers and results")
    numbers, rows = line
    if not all(type(number) is int for number in numbers):
        raise ValueError("the point numbers in the line are not whole numbers")
    return numbers, [_outcome(row) for row in rows]


def _outcome(row: Any) -> Outcome:
    is_pair = isinstance(row, list) and len(row) == 2
    if not (is_pair and isinstance(row[0], str) and isinstance(row[1], dict)):
        raise ValueError("a result is not a pair of a status and values")
    return Outcome(row[0], {name: _read_back(value) for name, value in row[1].items()} or None)


def _written(value: Reading) -> Any:
    """Convert a value to JSON: numbers and texts are unchanged, other values get a type tag."""
    if isinstance(value, np.ndarray):
        parts = [value.real.tolist(), value.imag.tolist()] if value.dtype.kind == "c" else [value.tolist()]
        return {"array": parts}
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    return value


def _read_back(value: Any) -> Reading:
    if isinstance(value, str):
        return value
    if not isinstance(value, dict):
        return _number(value)
    match value:
        case {"complex": [real, imaginary], **others} if not others:
            return complex(_number(real), _number(imaginary))
        case {"array": [list(numbers)], **others} if not others:
            return np.array([_number(number) for number in numbers], dtype=float)
        case {"array": [list(real), list(imaginary)], **others} if not others and len(real) == len(imaginary):
            both = np.empty(len(real), dtype=complex)
            both.real = [_number(number) for number in real]
            both.imag = [_number(number) for number in imaginary]
            return both
    raise ValueError("a value is not a number, array or text")


def _number(value: Any) -> float:
    if type(value) not in (int, float):
        raise ValueError(f"{value!r} is not a number")
    return float(value)
