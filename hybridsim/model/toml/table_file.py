"""This module reads two columns of a CSV file as the table of an input or of a friction law."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from hybridsim.errors import ModelError, Place, nearest
from hybridsim.model.toml.table import Table

# Limit of the file size; a table with a million rows has about 40 MB.
MAX_BYTES = 64_000_000


def numbers_from_file(
    table: Table, folder: Path, keys: tuple[str, str], first_title: str
) -> dict[str, tuple[float, ...]]:
    """Read the columns of a table from a CSV file, and return the numbers under the two given keys.

    Parameters
    ----------
    first_title : the word for the numbers of the first column.
    may_lack : whether empty cells and "nan" become NaN, except in the first column.
    """
    for key in keys:
        if key in table.data:
            table.fail(f"'file' and '{key}' cannot be combined", f"remove 'file' or '{key}'", key)
    columns = table.data.get("columns")
    is_pair = isinstance(columns, list) and len(columns) == 2
    if columns is not None and not (is_pair and all(isinstance(column, (str, int)) for column in columns)):
        remedy = f"use two names or indices, [{first_title}, values]"
        table.fail(f"'columns' cannot be {columns!r}", remedy, "columns")
        return {}
    path = folder / table.text("file")
    try:
        found = read_columns(path, columns, first_title)
    except ModelError as fault:
        where = fault.place.prefix if fault.place else ""
        remedy = f"{fault.remedy}; paths are relative to the folder {folder.resolve()}"
        table.fail(where + fault.message, remedy, "file")
        return {}
    table.source.files.append(str(path))
    return dict(zip(keys, found, strict=True))


def read_columns(
    path: Path, columns: Sequence[str | int] | None, first_title: str = "times", may_lack: bool = False
) -> tuple[tuple[float, ...], ...]:
    """Return two columns of a CSV file as numbers: times (or arguments), which must not decrease, and values.

    The separator is a comma, a semicolon or a tab. Numbers have a decimal point; a decimal comma is an error. Empty
    lines and lines that start with # are skipped. The first line contains names if a column is selected by name, or if
    none of the columns selected by index has a number there. Other columns are ignored.

    Parameters
    ----------
    columns : name, or index from 0, of each selected column; None for a file with two columns of numbers.
    first_title : the word for the numbers of the first column.

    Raises
    ------
    ModelError
        For a missing file or column, a cell that is not a finite number, times that decrease, columns separated by
        spaces, or commas that may be decimal ones, with file and line.
    """
    rows = _rows(path)
    head = [cell.strip() for cell in rows[0][1]] if rows else []
    has_choice, columns = columns is not None, columns or (0, 1)
    names = head if _are_names(head, columns) else None
    if len(rows) < (2 if names else 1):
        remedy = f"write {first_title} in the first column and values in the second"
        raise ModelError("the table has no rows of numbers", place=Place(str(path)), remedy=remedy)
    _refuse_decimal_commas(rows, names, path)
    _refuse_spaces(rows, path)
    body = rows[1 if names else 0 :]
    numeric = [k for k, cell in enumerate(body[0][1]) if _is_number(cell.strip())]
    if not has_choice and len(numeric) > 2:
        which = ", ".join(names[k] if names and k < len(names) else str(k) for k in numeric)
        raise ModelError(
            f"the table has {len(numeric)} columns of numbers: {which}",
            place=Place(str(path), body[0][0]),
            remedy=f"choose the {first_title} and the values with `columns`",
        )
    indices = [_index(column, names, len(head), Place(str(path), rows[0][0])) for column in columns]
    found = tuple(
        tuple(_cell(row, index, line, path, may_lack and k > 0) for line, row in body)
        for k, index in enumerate(indices)
    )
    first = found[0]
    for (line, _), before, after in zip(body[1:], first[:-1], first[1:], strict=True):
        if after < before:
            message = f"the {first_title} decrease from {before!r} to {after!r}"
            raise ModelError(
                message, place=Place(str(path), line), remedy=f"sort the rows by the {first_title}"
            )
    return found


def column_names(path: Path) -> list[str]:
    """Return the names in the first line of a CSV file.

    Raises
    ------
    ModelError
        For a file that cannot be read, or a first line without names.
    """
    rows = _rows(path)
    head = [cell.strip() for cell in rows[0][1]] if rows else []
    if not head or any(map(_is_number, head)):
        place = Place(str(path), rows[0][0] if rows else 1)
        raise ModelError(
            "the first line has no column names", place=place, remedy="write a first line such as t,x,v"
        )
    return head


def _are_names(head: list[str], columns: Sequence[str | int]) -> bool:
    """Return whether the first line contains column names."""
    if any(isinstance(column, str) for column in columns):
        return not all(map(_is_number, head))
    cells = (head[column] for column in map(int, columns) if 0 <= column < len(head))
    return not any(_is_number(cell.replace(",", "").replace("_", "")) for cell in cells)  # 0,5 is no name


def _refuse_decimal_commas(rows: list[tuple[int, list[str]]], names: list[str] | None, path: Path) -> None:
    """Raise an error for rows whose commas may be decimal commas and not separators.

    Such a row has more numbers than the first line has cells. Or the first line has no names, and each second cell may
    contain the digits after the comma of the number in the cell before it.
    """
    remedy = "write numbers with a decimal point; separate columns by commas, semicolons or tabs"
    head = rows[0][1]
    for line, row in rows:
        if any(map(_is_number, row[len(head) :])):
            what = f"the row has {len(row)} cells, but the first line of the table has {len(head)}"
            raise ModelError(what, place=Place(str(path), line), remedy=remedy)
    in_halves = names is None and len(head) >= 4 and len(head) % 2 == 0
    if in_halves and all(map(_is_split, (row for _, row in rows))):
        what = f"the row '{','.join(head)}' has {len(head)} whole numbers, or {len(head) // 2} with decimal commas"
        raise ModelError(
            what,
            place=Place(str(path), rows[0][0]),
            remedy=f"{remedy}; if these are whole numbers, write the names of the columns in the first line",
        )


def _refuse_spaces(rows: list[tuple[int, list[str]]], path: Path) -> None:
    """Raise an error for a table whose columns are separated by spaces alone."""
    line, last = rows[-1]
    cells = last[0].split() if len(last) == 1 else []
    if len(cells) > 1 and all(map(_is_number, cells)):
        raise ModelError(
            f"spaces separate the columns of the row '{last[0].strip()}'",
            place=Place(str(path), line),
            remedy="separate columns by commas, semicolons or tabs",
        )


def _is_split(row: list[str]) -> bool:
    """Return whether cells of a row alternate between whole numbers and digits, as numbers with decimal commas do."""
    cells = [cell.strip() for cell in row]
    return all(cell.isdecimal() for cell in cells[1::2]) and all(
        cell.removeprefix("-").removeprefix("+").isdecimal() for cell in cells[::2]
    )


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
    first, last = content_lines[0][1], content_lines[-1][1]
    in_both = [
        separator for separator in ";\t" if separator in first and separator in last
    ]  # numbers have none
    separator = in_both[0] if in_both else max(",;\t", key=first.count)
    rows = csv.reader((line for _, line in content_lines), delimiter=separator)
    try:
        return [(n, row) for (n, _), row in zip(content_lines, rows, strict=True)]
    except (csv.Error, ValueError) as fault:
        raise ModelError(
            f"{path} is not a valid CSV file: {fault}",
            remedy="write one row per line, without line breaks in cells",
        ) from None


def _index(column: str | int, names: list[str] | None, width: int, place: Place) -> int:
    """Return the index of a column; `place` is the first line of the table."""
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


def _cell(row: list[str], index: int, line: int, path: Path, may_lack: bool) -> float:
    text = row[index].strip() if index < len(row) else ""
    if may_lack and text.lower() in ("", "nan"):
        return math.nan
    if not _is_number(text):
        what = f"'{text}' is not a number" if text else f"column {index} is empty"
        remedy = "write a number in both columns of every row"
        if _is_number(text.replace(",", ".")):
            remedy = f"write a decimal point: {text.replace(',', '.')}"
        raise ModelError(what, place=Place(str(path), line), remedy=remedy)
    if not math.isfinite(float(text)):
        raise ModelError(
            f"'{text}' is not a finite number",
            place=Place(str(path), line),
            remedy="remove this row from the file",
        )
    return float(text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text  # Python reads 1_0 as 10
