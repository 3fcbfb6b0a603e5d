"""This module reads elements of control loops from TOML."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hybridsim.model.elements.element import KINDS, Element
from hybridsim.model.toml.table import Table

_TEXTS = ("initial", "clock")


def read_elements(root: Table) -> Iterable[Element]:
    """Yield the elements of a file."""
    for name, kind, table in root.of_kinds("elements", "element", KINDS):
        required, optional = KINDS[kind]
        table.only("kind", *required, *optional)
        missing = [key for key in required if key not in table.data]
        if missing:
            table.fail(f"'{missing[0]}' is missing", f"an element of kind {kind} needs {', '.join(required)}")
            continue
        fields: dict[str, Any] = {key: table.text(key) for key in _TEXTS if key in table.data}
        if "ticks" in table.data:
            fields["ticks"] = table.count("ticks")
        rest = [key for key in (*required, *optional) if key in table.data and key not in fields]
        fields |= {key: table.expression(key) for key in rest}
        yield Element(name, kind, **fields, place=table.place)
