"""This module reads the shapes of a drawing from TOML."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hybridsim.model.parts.shape import KINDS, Point, Shape
from hybridsim.model.toml.table import Table

_TEXTS = ("mode_of", "text")


def read_drawing(root: Table) -> Iterable[Shape]:
    """Yield the shapes of a file."""
    for name, kind, table in root.of_kinds("drawing", "shape", KINDS):
        required, optional = KINDS[kind]
        known = (*required, *optional)
        table.only("kind", *known)
        for key in required:
            table.require(key, f"a shape of kind {kind} needs {', '.join(required)}")
        fields = {key: _field(table, key) for key in known if key in table.data}
        yield Shape(name, kind, **{k: v for k, v in fields.items() if v is not None}, place=table.place)


def _field(table: Table, key: str) -> Any:
    """Return the value of a key as an argument of `Shape`; a wrong value is reported."""
    if key in _TEXTS:
        return table.text(key)
    if key in ("at", "vector"):
        return _point(table, table.data[key], key)
    if key in ("ends", "points"):
        items = table.data[key]
        use = "two points or names of shapes" if key == "ends" else "a list of points [x, y]"
        if not isinstance(items, list) or (key == "ends" and len(items) != 2):
            table.fail(f"'{key}' cannot be {items!r}", f"use {use}", key)
            return None
        found = [
            item if key == "ends" and isinstance(item, str) else _point(table, item, key, index)
            for index, item in enumerate(items)
        ]
        return None if None in found else found
    value = table.data[key]
    if key == "size" and isinstance(value, list):
        if len(value) == 2:
            return [table.parsed(item, key, index) for index, item in enumerate(value)]
        table.fail(f"'size' cannot be {value!r}", "use a number, or [width, height]", key)
        return None
    return table.expression(key)


def _point(table: Table, value: Any, *keys: str | int) -> Point | None:
    if isinstance(value, list) and len(value) == 2:
        first, second = (table.parsed(item, *keys, index) for index, item in enumerate(value))
        return first, second
    table.fail(f"'{keys[0]}' cannot contain {value!r}", "use a point [x, y]", *keys)
    return None
