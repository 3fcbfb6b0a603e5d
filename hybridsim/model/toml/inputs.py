"""This module reads inputs from TOML: waves, chirps and tables."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hybridsim.model.parts.inputs import KINDS, OPTIONAL, REQUIRED, Input
from hybridsim.model.toml.table import Table
from hybridsim.model.toml.table_file import numbers_from_file
from hybridsim.model.units.seconds import REMEDY, in_seconds

_TEXTS = ("shape", "interpolation", "unit", "time_unit")
_NUMBERS = ("times", "values")


def read_inputs(root: Table, folder: Path) -> Iterable[Input]:
    """Yield the inputs of a file; paths of tables are relative to ``folder``."""
    for name, kind, table in root.of_kinds("inputs", "input", KINDS):
        known = (*REQUIRED[kind], *OPTIONAL[kind])
        extra = ("file", "columns") if kind == "table" else ()
        table.only("kind", *known, *extra)
        if "file" in table.data:
            numbers = numbers_from_file(table, folder, _NUMBERS, "times")
        else:
            for key in REQUIRED[kind]:
                table.require(key, f"an input of kind '{kind}' needs {', '.join(REQUIRED[kind])}")
            numbers = {key: _numbers(table, key) for key in _NUMBERS if key in table.data}
        texts = {key: table.text(key) for key in _TEXTS if key in table.data}
        if in_seconds((), texts.get("time_unit", "s")) is None:
            wrong = texts.pop("time_unit")
            if table.data["time_unit"] == wrong:  # another type is reported already
                table.fail(f"'time_unit' cannot be '{wrong}'", REMEDY, "time_unit")
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
