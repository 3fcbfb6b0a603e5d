"""This module reads parts from TOML: [use.NAME], with the files of the parts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim.errors import ModelError
from hybridsim.model.flattening.indexed import IndexedExpression, parse_indexed
from hybridsim.model.parts.frozen_map import FrozenMap
from hybridsim.model.parts.use import MAX_REPEAT, Use
from hybridsim.model.toml.table import Table

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model

MAX_DEPTH = 20  # levels of parts in parts; it bounds the recursion of reading


class PartFiles:
    """The files of parts of one model, each of which is read once.

    Parameters
    ----------
    build : function that builds a model from a text and its path.
    path : path of the model that contains the parts, or None for a text.
    """

    def __init__(self, build: Callable[[str, str, PartFiles], Model], path: str | None) -> None:
        self._build = build
        self._models: dict[str, Model | None] = {}
        self.others: list[str] = []  # files of laws and tables
        self._open = [] if path is None else [path]

    @property
    def files(self) -> tuple[str, ...]:
        """The files that were read in addition to the file of the model."""
        return (*self._models, *self.others)

    def model(self, table: Table, folder: Path) -> Model | None:
        """Return the model of a part, or None after reporting why it cannot be read."""
        from hybridsim.model.library import path_of, read_text

        name = table.text("model")
        if not isinstance(table.data["model"], str):
            return None  # reported
        try:
            path = path_of(name, folder)
            key = os.path.realpath(path)
            if key in self._models:
                return self._models[key]
            above = [os.path.realpath(other) for other in self._open]
            if key in above:
                circle = [*self._open[above.index(key) :], str(path)]
                table.fail(f"a circle of parts: {' > '.join(circle)}", "remove one of these parts", "model")
                return None
            if len(above) > MAX_DEPTH:
                table.fail(f"more than {MAX_DEPTH} parts inside each other", "use fewer levels", "model")
                return None
            text = read_text(path)
        except ModelError as fault:
            where = fault.place.prefix if fault.place else ""
            table.fail(where + fault.message, fault.remedy or "", "model")
            return None
        self._models[key] = None
        self._open.append(str(path))
        try:
            self._models[key] = self._build(text, str(path), self)
        except ModelError as fault:
            table.source.errors.extend(fault.inside(f"use.{table.path[-1]}"))
        self._open.pop()
        return self._models[key]


def read_uses(root: Table, folder: Path, files: PartFiles) -> Iterator[Use]:
    """Yield the parts of a file; paths of their models are relative to ``folder``."""
    for name, table in root.entries("use", "use"):
        table.only("model", "parameters", "start", "connect", "repeat")
        if not table.require("model", 'write model = "FILE.toml", or the name of a packaged model'):
            continue
        part = files.model(table, folder)
        repeat = table.count("repeat")
        if repeat is not None and not 1 <= repeat <= MAX_REPEAT:
            table.fail(f"'repeat' cannot be {repeat}", f"use a whole number from 1 to {MAX_REPEAT}", "repeat")
            repeat = None
        parameters, start, connect = (
            FrozenMap(_values(table, field, repeat)) for field in ("parameters", "start", "connect")
        )
        if part is not None:
            yield Use(name, part, parameters, start, connect, repeat, place=table.place)


def _values(
    table: Table, field: str, repeat: int | None
) -> Iterator[tuple[str, tuple[IndexedExpression, ...]]]:
    """Yield the names and values of a table; a table inside this table gives names with dots, such as hub.x."""
    for keys, value in _leaves(table.mapping(field), ()):
        name = ".".join(keys)
        listed = value if isinstance(value, list) else [value]
        if isinstance(value, list) and len(value) != repeat:
            copies = f"{repeat} copies" if repeat else "one copy"
            table.fail(
                f"{field}, {name}: {len(value)} values for {copies}", "write one value per copy", field, *keys
            )
            continue
        parsed = []
        for k, single in enumerate(listed):
            place: tuple[str | int, ...] = (*keys, k) if isinstance(value, list) else keys
            parsed.append(table.parsed(single, field, *place, form=parse_indexed))
        yield name, tuple(parsed)


def _leaves(values: Mapping[str, Any], keys: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*keys, key))
        else:
            yield (*keys, key), value
