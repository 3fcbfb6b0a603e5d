"""A sweep's results on disk as they come in: what was killed and is started again goes on where it was.

A line of text for each piece of work, in JSON, whole or not there at all: a line that a kill has cut off is not read.
Numbers are written with all their digits, so that a sweep in parts is to the last bit a sweep in one.
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
from hybridsim.analysis.sweep.job import Outcome
from hybridsim.analysis.sweep.readings import Reading
from hybridsim.errors import UsageError
from hybridsim.files import cannot_write, hold, path_text

_FORMAT = "hybridsim sweep"
_MOST_BYTES = 1 << 28  # of a line: some 10 million numbers


def fingerprint(*parts: object) -> str:
    """What tells one sweep from another: model, values, measure, options."""
    return hashlib.sha256("\n".join(map(identity, parts)).encode()).hexdigest()


class Journal:
    """The file of one sweep, open for what is to come.

    Parameters
    ----------
    path : where it is, or is to be.
    sweep : the `fingerprint` of the sweep.

    Attributes
    ----------
    known : the numbers of points and their outcomes that it held already.

    Raises
    ------
    UsageError
        Where the file is no journal, or of another sweep, or in use by one, or cannot be written.
    """

    def __init__(self, path: str | PathLike[str], sweep: str) -> None:
        self.path = path_text(path)
        self.known: list[tuple[list[int], list[Outcome]]] = []
        self._file = self._opened()
        try:
            self._read(sweep)
        except BaseException:  # whatever it is, the file is not left open; it is raised again
            self._close()
            raise

    def _opened(self) -> IO[bytes]:
        """The file, which no other sweep has open."""
        while True:
            try:
                is_other = os.path.exists(self.path) and not stat.S_ISREG(os.stat(self.path).st_mode)
                if is_other:
                    raise OSError(errno.EINVAL, "it is no regular file")
                file = open(self.path, "a+b")  # noqa: SIM115  # it is open as long as the journal is
            except OSError as error:
                raise cannot_write(self.path, error) from error
            try:
                hold(file.fileno(), f"{self.path} is in use by another sweep")
            except UsageError:
                file.close()
                raise
            # the sweep that had it may have deleted it in the meantime
            if os.path.exists(self.path) and os.path.samestat(os.stat(self.path), os.fstat(file.fileno())):
                return file
            file.close()

    def _read(self, sweep: str) -> None:
        """Take in what is there; a last line that is not whole is cut off."""
        head = {"format": _FORMAT, "sweep": sweep}
        self._file.seek(0)
        end, line = 0, self._file.readline(_MOST_BYTES)
        if not line.endswith(b"\n") and _as_line(head).startswith(line):  # nothing, or a beginning of ours
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
                    f"{self.path}, line {number} is no result of a sweep: {error}",
                    remedy="take the line out, or delete the file",
                ) from error
        self._file.truncate(end)

    def _check_head(self, line: bytes, head: dict[str, str]) -> None:
        try:
            found = json.loads(line)
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict) or found.get("format") != _FORMAT:
            raise UsageError(
                f"{self.path} is no journal of a sweep", remedy="give another path, or delete it"
            )
        if found.get("sweep") != head["sweep"]:
            raise UsageError(
                f"{self.path} is of another sweep: model, values, options or measure differ",
                remedy="finish that one, delete the file, or give another path",
            )

    def note(self, numbers: range, outcomes: Sequence[Outcome]) -> None:
        """Add the outcomes of some points; a kill from now on does not lose them."""
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
        with suppress(OSError):  # of what could not be written before, which has been said
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
    """Numbers of points and their outcomes.

    Raises
    ------
    ValueError
        For anything else.
    """
    if not (isinstance(line, list) and len(line) == 2 and all(isinstance(part, list) for part in line)):
        raise ValueError("it is no pair of points and results")
    numbers, rows = line
    if not all(type(number) is int for number in numbers):
        raise ValueError("its points are no numbers")
    return numbers, [_outcome(row) for row in rows]


def _outcome(row: Any) -> Outcome:
    is_pair = isinstance(row, list) and len(row) == 2
    if not (is_pair and isinstance(row[0], str) and isinstance(row[1], dict)):
        raise ValueError("a result is no status with readings")
    return Outcome(row[0], {name: _read_back(value) for name, value in row[1].items()} or None)


def _written(value: Reading) -> Any:
    """A reading as JSON has it: numbers and texts as they are, others with their kind."""
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
    raise ValueError("a reading is no number, array or text")


def _number(value: Any) -> float:
    if type(value) not in (int, float):
        raise ValueError(f"{value!r} is no number")
    return float(value)
