"""This module reads TOML tables, checks types, and collects all errors with their lines."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hybridsim.errors import ExpressionError, ModelError, Place, near, nearest
from hybridsim.expr import Expression, parse, parse_reset
from hybridsim.model.toml.positions import Path

_ZERO = parse(0)


@dataclass
class Source:
    """The text of a TOML file, the positions of its keys, and the errors and further files found so far."""

    file: str | None
    lines: list[str]
    positions: Mapping[Path, tuple[int, int]]
    errors: list[ModelError] = field(default_factory=list)
    files: list[str] = field(default_factory=list)  # further files that the text refers to

    def place(self, path: Path) -> Place:
        """Return the place of a key, or of the nearest enclosing table with a known line."""
        while path and path not in self.positions:
            path = path[:-1]
        if not path:
            return Place(self.file)
        line, column = self.positions[path]
        return Place(self.file, line, column, self.lines[line - 1])


class Table:
    """A TOML table; wrong types are reported and replaced by a placeholder, so that reading continues."""

    def __init__(self, source: Source, path: Path, data: Mapping[str, Any], kind: str) -> None:
        self.source = source
        self.path = path
        self.data = data
        self.kind = kind
        self.place = source.place(path)
        self._misspelt: set[str] = set()  # known keys that unknown keys resemble

    def fail(self, message: str, remedy: str, *keys: str | int) -> None:
        """Report an error at this table or at one of its keys."""
        place = self.source.place((*self.path, *keys))
        self.source.errors.append(ModelError(f"{self.kind}: {message}", place=place, remedy=remedy))

    def only(self, *known: str) -> None:
        """Report every key that is not among the known keys."""
        for key in self.data:
            if key not in known:
                self._misspelt.update(near(key, known))
                self.fail(f"unknown key '{key}'", nearest(key, known, kind="keys"), key)

    def only_in(self, *known: str, others: Sequence[str], remedy: str) -> None:
        """Report every unknown key; the keys `others`, which belong in another table, get the given remedy."""
        others = [key for key in others if key not in known]
        if others:
            self.fail(f"unknown {', '.join(map(repr, others))}", remedy, others[0])
        self.only(*known, *others)

    def require(self, key: str, remedy: str) -> bool:
        """Return whether a key exists, and report it if it is missing and not misspelt."""
        if key not in self.data and key not in self._misspelt:
            self.fail(f"'{key}' is missing", remedy)
        return key in self.data

    def text(self, key: str, default: str = "") -> str:
        return str(self._typed(key, str, "a string in quotes", default))

    def flag(self, key: str) -> bool:
        return bool(self._typed(key, bool, "true or false", False))

    def count(self, key: str) -> int | None:
        value = self.data.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int):
            self.fail(f"'{key}' cannot be {_shown(value)}", "use a whole number", key)
            return None
        return value

    def real(self, key: str) -> float | None:
        value = self.data.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self.fail(f"'{key}' cannot be {_shown(value)}", "use a number", key)
            return None
        return _real(value)

    def reals(self, key: str) -> dict[str, float]:
        """Return a table of numbers, or an empty table if the key is missing."""
        found = self._typed(key, dict, "a table of numbers", {})
        table = Table(self.source, (*self.path, key), found, f"{self.kind}, {key}")
        return {name: value for name in found if (value := table.real(name)) is not None}

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return a list of numbers; a wrong list is reported and returned as empty."""
        found = self._typed(key, list, "a list of numbers", [])
        wrong = [value for value in found if isinstance(value, bool) or not isinstance(value, (int, float))]
        if wrong:
            self.fail(f"'{key}' contains {_shown(wrong[0])}", "use a list of numbers", key)
            return ()
        return tuple(_real(value) for value in found)

    def values(self, key: str) -> tuple[Any, ...]:
        """Return a list of numbers and expressions; without expressions it is read as by `numbers`."""
        found = self._typed(key, list, "a list of numbers", [])
        if not any(isinstance(value, str) for value in found):
            return self.numbers(key)
        return tuple(self.parsed(value, key, index) for index, value in enumerate(found))

    def rows(self, key: str) -> tuple[tuple[float, ...], ...]:
        """Return a list of lists of numbers; a wrong list is reported and returned as empty."""
        found = self._typed(key, list, "a list of lists of numbers", [])
        for row in found:
            if not isinstance(row, list) or any(
                isinstance(v, bool) or not isinstance(v, (int, float)) for v in row
            ):
                self.fail(f"'{key}' contains {_shown(row)}", "use a list of lists of numbers", key)
                return ()
        return tuple(tuple(_real(value) for value in row) for row in found)

    def expression(self, key: str, remedy: str | None = None) -> Expression | None:
        """Return the expression of a key, or None; a missing key is reported if a remedy is given."""
        if key not in self.data:
            if remedy is None:
                return None
            self.require(key, remedy)
            return _ZERO
        return self.parsed(self.data[key], key)

    def required(self, key: str, remedy: str) -> Expression:
        return self.expression(key, remedy) or _ZERO

    def parsed(self, value: Any, *keys: str | int, form: Callable[[Any, Place], Any] = parse) -> Any:
        """Parse the TOML value at a key of this table as an expression."""
        place = self.source.place((*self.path, *keys))
        try:
            return form(value, Place(place.file, place.line))
        except ExpressionError as fault:
            what = ".".join(str(key) for key in keys if key != "value")
            message = f"{self.kind}{', ' + what if what else ''}: {fault.message}"
            if fault.place is None or fault.place.text is None:
                fault = ExpressionError(fault.message, place=place, remedy=fault.remedy)
            self.source.errors.append(ExpressionError(message, place=fault.place, remedy=fault.remedy))
            return form(0, place)

    def mapping(self, key: str, kind: str = "expressions") -> dict[str, Any]:
        """Return a table unchanged, or an empty table if the key is missing."""
        return dict(self._typed(key, dict, f"a table of {kind}", {}))

    def expressions(self, key: str) -> dict[str, Expression]:
        """Return a table of expressions, or an empty table if the key is missing."""
        found = self._typed(key, dict, "a table of expressions", {})
        return {name: self.parsed(value, key, name) for name, value in found.items()}

    def resets(self, key: str) -> dict[str, Expression]:
        """Return a table of resets, or an empty table if the key is missing."""
        found = self._typed(key, dict, "a table of expressions", {})
        return {name: self.parsed(value, key, name, form=parse_reset) for name, value in found.items()}

    def entries(self, key: str, kind: str, shorthand: str | None = None) -> Iterator[tuple[str, Table]]:
        """Yield named sub-tables; a plain value becomes a table with the key ``shorthand``."""
        for name, value in self._typed(key, dict, "a table", {}).items():
            table = self.sub(value, f"{kind} {name}", shorthand, key, name)
            if table is not None:
                yield name, table

    def of_kinds(self, key: str, kind: str, known: Collection[str]) -> Iterator[tuple[str, str, Table]]:
        """Yield named sub-tables with their values of the key ``kind``; an unknown kind is reported."""
        for name, table in self.entries(key, kind):
            found = table.text("kind")
            if found in known:
                yield name, found, table
            else:
                what = f"unknown kind '{found}'" if found else "'kind' is missing"
                table.fail(what, nearest(found, known, kind="kinds"), "kind")

    def sub(self, value: Any, kind: str, shorthand: str | None, *keys: str | int) -> Table | None:
        """Return the sub-table at a key, or None after reporting a wrong type."""
        if not isinstance(value, dict):
            if shorthand is None or isinstance(value, list):
                self.fail(f"{kind} cannot be {_shown(value)}", "use a table { ... }", *keys)
                return None
            value = {shorthand: value}
        return Table(self.source, (*self.path, *keys), value, kind)

    def _typed(self, key: str, kind: type, required_kind: str, default: Any) -> Any:
        value = self.data.get(key, default)
        if not isinstance(value, kind):
            self.fail(f"'{key}' cannot be {_shown(value)}", f"use {required_kind}", key)
            return default
        return value


def _real(value: float) -> float:
    """Return a number as float; numbers beyond the range of floats become infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def _shown(value: Any) -> str:
    names = {
        bool: "true or false",
        dict: "a table",
        list: "a list",
        str: "a string",
        int: "a number",
        float: "a number",
    }
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    what = names.get(type(value), type(value).__name__)
    return f"{what} ({text if len(text) <= 40 else text[:37] + '...'})"
