"""Two columns of a CSV file: the table of an input."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from hybridsim.errors import ModelError, Place, nearest

# A table of a million rows has some 40 MB; more than that is no hand-made signal but a mistaken file.
MAX_BYTES = 64_000_000


def read_columns(path: Path, columns: Sequence[str | int]) -> tuple[tuple[float, ...], ...]:
    """Columns of a CSV file as numbers.

    Comma, semicolon or tab separates. Lines that are empty or begin with # are skipped. The first line holds the names
    if a column is asked for by its name, or if there is no number in any column that is asked for by its index; what
    stands in other columns decides nothing.

    Parameters
    ----------
    columns : name, or index from 0, of each column wanted.

    Raises
    ------
    ModelError
        With file and line: no such file or column, a cell that is no number.
    """
    rows = _rows(path)
    head = [cell.strip() for cell in rows[0][1]] if rows else []
    names = head if _are_names(head, columns) else None
    if len(rows) < (2 if names else 1):
        remedy = "give time and value in each row."
        raise ModelError("the table has no rows of numbers", place=Place(str(path)), remedy=remedy)
    indices = [_index(column, names, len(head), path) for column in columns]
    found: list[tuple[float, ...]] = []
    for index in indices:
        found.append(tuple(_cell(row, index, line, path) for line, row in rows[1 if names else 0 :]))
    return tuple(found)


def _are_names(head: list[str], columns: Sequence[str | int]) -> bool:
    """Whether the first line holds names."""
    if any(isinstance(column, str) for column in columns):
        return not all(map(_is_number, head))
    return not any(0 <= column < len(head) and _is_number(head[column]) for column in map(int, columns))


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    try:
        size = path.stat().st_size
        if not path.is_file():  # a device or a pipe may have no end
            raise ModelError(f"{path} is no file", remedy="give a CSV file.")
        if size > MAX_BYTES:
            raise ModelError(f"{path} has {size} bytes, {MAX_BYTES} are allowed", remedy="thin it out.")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise ModelError(f"there is no file {path}", remedy="correct the path.") from None
    except UnicodeDecodeError:
        raise ModelError(f"{path} is no text in UTF-8", remedy="write the table as CSV.") from None
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or str(fault)
        raise ModelError(f"{path} cannot be read: {reason}", remedy="give a CSV file.") from None
    kept = [
        (n, line) for n, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")
    ]
    if not kept:
        return []
    separator = max(",;\t", key=kept[0][1].count)
    rows = csv.reader((line for _, line in kept), delimiter=separator)
    try:
        return [(n, row) for (n, _), row in zip(kept, rows, strict=True)]
    except (csv.Error, ValueError) as fault:
        raise ModelError(
            f"{path} is no CSV file: {fault}", remedy="one row a line, no line breaks in cells."
        ) from None


def _index(column: str | int, names: list[str] | None, width: int, path: Path) -> int:
    place = Place(str(path), 1)
    if isinstance(column, int):
        if not 0 <= column < width:
            raise ModelError(
                f"there is no column {column}", place=place, remedy=f"it has columns 0 to {width - 1}."
            )
        return column
    if names is None:
        raise ModelError(
            f"there is no column '{column}', the first line is numbers", place=place, remedy="use indices."
        )
    if column not in names:
        raise ModelError(
            f"there is no column '{column}'", place=place, remedy=nearest(column, names, kind="columns")
        )
    return names.index(column)


def _cell(row: list[str], index: int, line: int, path: Path) -> float:
    text = row[index].strip() if index < len(row) else ""
    if not _is_number(text):
        what = f"'{text}' is no number" if text else f"column {index} is empty"
        raise ModelError(
            what, place=Place(str(path), line), remedy="every row needs a number in each column used."
        )
    return float(text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
