"""This module reads two columns of a CSV file as the table of an input."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from hybridsim.errors import ModelError, Place, nearest

# Limit of the file size; a table with a million rows has about 40 MB.
MAX_BYTES = 64_000_000


def read_columns(path: Path, columns: Sequence[str | int]) -> tuple[tuple[float, ...], ...]:
    """Return two columns of a CSV file as numbers.

    The separator is a comma, a semicolon or a tab. Empty lines and lines that start with # are skipped. The first line
    contains names if a column is selected by name, or if none of the columns selected by index has a number there.
    Other columns are ignored.

    Parameters
    ----------
    columns : name, or index from 0, of each selected column.

    Raises
    ------
    ModelError
        For a missing file or column, or a cell that is not a number, with file and line.
    """
    rows = _rows(path)
    head = [cell.strip() for cell in rows[0][1]] if rows else []
    names = head if _are_names(head, columns) else None
    if len(rows) < (2 if names else 1):
        remedy = "write time and value in each row"
        raise ModelError("the table has no rows of numbers", place=Place(str(path)), remedy=remedy)
    indices = [_index(column, names, len(head), path) for column in columns]
    found: list[tuple[float, ...]] = []
    for index in indices:
        found.append(tuple(_cell(row, index, line, path) for line, row in rows[1 if names else 0 :]))
    return tuple(found)


def _are_names(head: list[str], columns: Sequence[str | int]) -> bool:
    """Return whether the first line contains column names."""
    if any(isinstance(column, str) for column in columns):
        return not all(map(_is_number, head))
    return not any(0 <= column < len(head) and _is_number(head[column]) for column in map(int, columns))


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    try:
        size = path.stat().st_size
        if not path.is_file():  # a device or a pipe may have no end
            raise ModelError(f"{path} is not a regular file", remedy="use a CSV file")
        if size > MAX_BYTES:
            raise ModelError(
                f"{path} has {size} bytes, but at most {MAX_BYTES} are allowed",
                remedy="reduce the number of rows",
            )
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise ModelError(f"the file {path} does not exist", remedy="correct the path") from None
    except UnicodeDecodeError:
        raise ModelError(f"{path} is not a text file in UTF-8", remedy="write the table as CSV") from None
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or str(fault)
        raise ModelError(f"{path} cannot be read: {reason}", remedy="use a CSV file") from None
    content_lines = [
        (n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")
    ]
    if not content_lines:
        return []
    separator = max(",;\t", key=content_lines[0][1].count)
    rows = csv.reader((line for _, line in content_lines), delimiter=separator)
    try:
        return [(n, row) for (n, _), row in zip(content_lines, rows, strict=True)]
    except (csv.Error, ValueError) as fault:
        raise ModelError(
            f"{path} is not a valid CSV file: {fault}",
            remedy="write one row per line, without line breaks in cells",
        ) from None


def _index(column: str | int, names: list[str] | None, width: int, path: Path) -> int:
    place = Place(str(path), 1)
    if isinstance(column, int):
        if not 0 <= column < width:
            raise ModelError(
                f"column {column} does not exist",
                place=place,
                remedy=f"the file has columns 0 to {width - 1}",
            )
        return column
    if names is None:
        raise ModelError(
            f"column '{column}' does not exist, because the first line has no names",
            place=place,
            remedy="use indices",
        )
    if column not in names:
        raise ModelError(
            f"column '{column}' does not exist", place=place, remedy=nearest(column, names, kind="columns")
        )
    return names.index(column)


def _cell(row: list[str], index: int, line: int, path: Path) -> float:
    text = row[index].strip() if index < len(row) else ""
    if not _is_number(text):
        what = f"'{text}' is not a number" if text else f"column {index} is empty"
        raise ModelError(
            what, place=Place(str(path), line), remedy="write a number in both columns of every row"
        )
    return float(text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
