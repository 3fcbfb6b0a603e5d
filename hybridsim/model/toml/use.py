"""This module reads parts from TOML: [use.NAME], with the files of the parts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybridsim.errors import ModelError, nearest
from hybridsim.model.flattening.indexed import IndexedExpression, parse_indexed
from hybridsim.model.parts.frozen_map import FrozenMap
from hybridsim.model.parts.law_of_use import LawOfUse
from hybridsim.model.parts.use import MAX_REPEAT, Use
from hybridsim.model.toml.laws import Laws, read_law
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


def read_uses(root: Table, folder: Path, files: PartFiles, laws: Laws) -> Iterator[Use]:
    """Yield the parts of a file; paths of models are relative to ``folder``, and ``laws`` are those of the file."""
    for name, table in root.entries("use", "use"):
        table.only("model", "parameters", "start", "connect", "laws", "repeat")
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
            changed = FrozenMap(_laws(table, part, repeat, laws, folder))
            yield Use(name, part, parameters, start, connect, repeat, changed, place=table.place)


def _values(
    table: Table, field: str, repeat: int | None
) -> Iterator[tuple[str, tuple[IndexedExpression, ...]]]:
    """Yield the names and values of a table; a table inside this table gives names with dots, such as hub.x."""
    for keys, value in _leaves(table.mapping(field), ()):
        single = _of_copies(table, value, repeat, field, *keys)
        if single:
            yield ".".join(keys), tuple(table.parsed(one, *at, form=parse_indexed) for at, one in single)


def _laws(
    table: Table, part: Model, repeat: int | None, laws: Laws, folder: Path
) -> Iterator[tuple[str, tuple[LawOfUse, ...]]]:
    """Yield the contacts of a part that get another law, each with this law."""
    for keys, value in _contacts(table, part, table.mapping("laws", "laws"), ()):
        found, copies = [], _of_copies(table, value, repeat, "laws", *keys)
        for at, one in copies:
            own = table.sub(one, f"{table.kind}, laws.{'.'.join(keys)}", "name", *at)
            law = None if own is None else read_law(own, keys[-1], laws, folder, parse_indexed)
            if own is not None and law is not None:
                found.append(LawOfUse(law[0], FrozenMap(law[1]), own.place))
        if copies and len(found) == len(copies):
            yield ".".join(keys), tuple(found)


def _contacts(
    table: Table, part: Model, values: Mapping[str, Any], keys: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the keys of each contact in `laws` with its entry; an unknown contact is reported."""
    contacts = [contact.name for contact in part.contacts]
    for key, value in values.items():
        path = (*keys, key)
        name = ".".join(path)
        if name in contacts:
            yield path, value
        elif isinstance(value, dict) and any(contact.startswith(f"{name}.") for contact in contacts):
            yield from _contacts(table, part, value, path)
        else:
            message = f"laws: the model '{part.name}' has no contact '{name}'"
            table.fail(message, nearest(name, contacts, kind="contacts"), "laws", *path)


def _of_copies(
    table: Table, value: Any, repeat: int | None, field: str, *keys: str
) -> list[tuple[tuple[str | int, ...], Any]]:
    """Return one value for all copies, or one for each copy, with its keys; a wrong number of values is reported."""
    if not isinstance(value, list):
        return [((field, *keys), value)]
    if len(value) == repeat:
        return [((field, *keys, k), single) for k, single in enumerate(value)]
    copies, name = f"{repeat} copies" if repeat else "one copy", ".".join(keys)
    table.fail(f"{field}, {name}: {len(value)} values for {copies}", "write one value per copy", field, *keys)
    return []


def _leaves(values: Mapping[str, Any], keys: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*keys, key))
        else:
            yield (*keys, key), value
