"""This module reads inputs from TOML: waves, chirps and tables."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hybridsim.errors import ModelError, nearest
from hybridsim.model.parts.inputs import KINDS, OPTIONAL, REQUIRED, Input
from hybridsim.model.toml.table import Table
from hybridsim.model.toml.table_file import read_columns

_TEXTS = ("shape", "interpolation", "unit")
_NUMBERS = ("times", "values")


def read_inputs(root: Table, folder: Path) -> Iterable[Input]:
    """Yield the inputs of a file; paths of tables are relative to ``folder``."""
    for name, table in root.entries("inputs", "input"):
        kind = table.text("kind")
        if kind not in KINDS:
            what = f"unknown kind '{kind}'" if kind else "'kind' is missing"
            table.fail(what, nearest(kind, KINDS, kind="kinds"), "kind")
            continue
        known = (*REQUIRED[kind], *OPTIONAL[kind])
        extra = ("file", "columns") if kind == "table" else ()
        table.only("kind", *known, *extra)
        if "file" in table.data:
            numbers = _from_file(table, folder)
        else:
            for key in REQUIRED[kind]:
                table.require(key, f"an input of kind '{kind}' needs {', '.join(REQUIRED[kind])}")
            numbers = {key: _numbers(table, key) for key in _NUMBERS if key in table.data}
        texts = {key: table.text(key) for key in _TEXTS if key in table.data}
        rest = [key for key in known if key not in (*_TEXTS, *_NUMBERS) and key in table.data]
        expressions = {key: table.expression(key) for key in rest}
        fields: dict[str, Any] = {**numbers, **texts, **expressions}
        yield Input(name, kind, **fields, place=table.place)


def _numbers(table: Table, key: str) -> tuple[float, ...]:
    entry = table.data[key]
    numbers = entry if isinstance(entry, list) else [entry]
    for index, value in enumerate(numbers):
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            table.fail(f"'{key}' contains {value!r}", "use a list of numbers", key, index)
            return ()
    return tuple(float(value) for value in numbers)


def _from_file(table: Table, folder: Path) -> dict[str, tuple[float, ...]]:
    for key in _NUMBERS:
        if key in table.data:
            table.fail(f"'file' and '{key}' cannot be combined", f"remove 'file' or '{key}'", key)
    columns = table.data.get("columns")
    is_pair = isinstance(columns, list) and len(columns) == 2
    if columns is not None and not (is_pair and all(isinstance(column, (str, int)) for column in columns)):
        table.fail(f"'columns' cannot be {columns!r}", "use two names or indices, [time, value]", "columns")
        return {}
    path = folder / table.text("file")
    try:
        times, values = read_columns(path, columns)
    except ModelError as fault:
        where = fault.place.prefix if fault.place else ""
        table.fail(
            where + fault.message,
            f"{fault.remedy}; paths are relative to the folder {folder.resolve()}",
            "file",
        )
        return {}
    return {"times": times, "values": values}
