"""A sweep's results on disk as they come in: what was killed and is started again goes on where it was.

A line of text for each piece of work, in JSON, whole or not there at all: a line that a kill has cut off is not read.
Numbers are written with all their digits, so that a sweep in parts is to the last bit a sweep in one.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from contextlib import suppress
from os import PathLike
from types import TracebackType
from typing import IO, Any

import numpy as np

from hybridsim.analysis.sweep.job import Outcome
from hybridsim.analysis.sweep.readings import Reading
from hybridsim.errors import UsageError
from hybridsim.files import cannot_write

_FORMAT = "hybridsim sweep"


def fingerprint(*parts: object) -> str:
    """What tells one sweep from another: model, values, measure, options."""
    return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()


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
        Where the file is no journal, or of another sweep, or cannot be written.
    """

    def __init__(self, path: str | PathLike[str], sweep: str) -> None:
        self.path = os.fspath(path)
        self.known: list[tuple[list[int], list[Outcome]]] = []
        try:
            self._file: IO[bytes] = open(self.path, "a+b")  # noqa: SIM115  # it is open as long as the journal is
        except OSError as error:
            raise cannot_write(self.path, error) from error
        try:
            self._read(sweep)
        except BaseException:  # whatever it is, the file is not left open; it is raised again
            self._close()
            raise

    def _read(self, sweep: str) -> None:
        self._file.seek(0)
        whole = self._file.read()
        end = whole.rfind(b"\n") + 1
        lines = whole[:end].splitlines()
        try:
            head = json.loads(lines[0]) if lines else None
            if whole and (not isinstance(head, dict) or head.get("format") != _FORMAT):
                raise ValueError
            self.known = [_piece(json.loads(line)) for line in lines[1:]]
        except (ValueError, KeyError, TypeError) as error:
            raise UsageError(
                f"{self.path} is no journal of a sweep", remedy="give another path, or delete it"
            ) from error
        if head is None:
            self._write({"format": _FORMAT, "sweep": sweep})
        elif head["sweep"] != sweep:
            raise UsageError(
                f"{self.path} is of another sweep: model, values, measure or options differ",
                remedy="finish that one, delete the file, or give another path",
            )
        else:
            self._file.truncate(end)

    def note(self, numbers: range, outcomes: Sequence[Outcome]) -> None:
        """Add the outcomes of some points; a kill from now on does not lose them."""
        rows = [[o.status, {n: _written(v) for n, v in (o.found or {}).items()}] for o in outcomes]
        if rows:
            self._write([list(numbers[: len(rows)]), rows])

    def _write(self, line: Any) -> None:
        try:
            self._file.write(json.dumps(line).encode() + b"\n")
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


def _piece(line: Any) -> tuple[list[int], list[Outcome]]:
    numbers, rows = line
    return numbers, [
        Outcome(status, {n: _read_back(v) for n, v in found.items()} or None) for status, found in rows
    ]


def _written(value: Reading) -> Any:
    """A reading as JSON has it: numbers and texts as they are, others with their kind."""
    if isinstance(value, np.ndarray):
        parts = [value.real.tolist(), value.imag.tolist()] if value.dtype.kind == "c" else [value.tolist()]
        return {"array": parts}
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    return value


def _read_back(value: Any) -> Reading:
    if not isinstance(value, dict):
        return value if isinstance(value, str) else float(value)
    if "complex" in value:
        return complex(*value["complex"])
    real, *imaginary = (np.array(part, dtype=float) for part in value["array"])
    if not imaginary:
        return real
    both = np.empty(len(real), dtype=complex)
    both.real, both.imag = real, imaginary[0]
    return both
