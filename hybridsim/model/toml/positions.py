"""This module finds the line and column of every key in a TOML text."""

from __future__ import annotations

from collections.abc import Mapping

Path = tuple[str | int, ...]
_BLANK = " \t"


def positions(text: str) -> Mapping[Path, tuple[int, int]]:
    """Return the line (from 1) and column (from 0) of every key and array element in a TOML text.

    The text must be valid TOML, which `tomllib` has checked. Escapes in quoted keys are not resolved.
    """
    return _Scanner(text).scan()


class _Scanner:
    """Reads the keys of a TOML text and skips the values; `at` is the current offset."""

    def __init__(self, text: str) -> None:
        self.text = text + "\n"
        self.at = 0
        self.line = 1
        self.found: dict[Path, tuple[int, int]] = {}
        self.elements: dict[Path, int] = {}

    def scan(self) -> dict[Path, tuple[int, int]]:
        table: Path = ()
        while self.skip(_BLANK + "\r\n"):
            if self.text[self.at] == "[":
                table = self.header()
            else:
                self.pair(table)
        return self.found

    def skip(self, characters: str) -> bool:
        """Skip the given characters and comments; return False at the end of the text."""
        while self.at < len(self.text):
            character = self.text[self.at]
            if character == "#":
                self.move(self.text.index("\n", self.at))
            elif character in characters:
                self.move(self.at + 1)
            else:
                return True
        return False

    def move(self, to: int) -> None:
        self.line += self.text.count("\n", self.at, to)
        self.at = to

    def note(self, path: Path) -> None:
        """Store the place of the last part of a key, unless this part already has a place."""
        column = self.at - (self.text.rfind("\n", 0, self.at) + 1)
        self.found.setdefault(path, (self.line, column))

    def header(self) -> Path:
        array = self.text.startswith("[[", self.at)
        self.move(self.at + (2 if array else 1))
        path = self.key(())
        if array:
            count = self.elements[path] = self.elements.get(path, -1) + 1
            path = (*path, count)
            self.note(path)
        self.skip(_BLANK + "]")
        return path

    def pair(self, table: Path) -> None:
        path = self.key(table)
        self.move(self.at + 1)  # the equals sign
        self.value(path)

    def key(self, path: Path) -> Path:
        """Read a simple or dotted key in the table at a path, and store the place of every part."""
        while True:
            self.skip(_BLANK)
            start = self.at
            quote = self.text[start]
            line, column = self.line, start - (self.text.rfind("\n", 0, start) + 1)
            if quote in "\"'":
                self.string(quote)
                path = (*path, self.text[start + 1 : self.at - 1])
            else:
                while self.text[self.at] not in " \t.=]\n":
                    self.at += 1
                path = (*path, self.text[start : self.at])
            self.found.setdefault(path, (line, column))
            self.skip(_BLANK)
            if self.text[self.at] != ".":
                return path
            self.move(self.at + 1)

    def value(self, path: Path) -> None:
        self.skip(_BLANK)
        character = self.text[self.at]
        if character in "\"'":
            triple = character * 3
            self.string(triple if self.text.startswith(triple, self.at) else character)
        elif character == "{":
            self.move(self.at + 1)
            while self.skip(_BLANK + ",\r\n") and self.text[self.at] != "}":
                self.pair(path)
            self.move(self.at + 1)
        elif character == "[":
            self.move(self.at + 1)
            index = 0
            while self.skip(_BLANK + ",\r\n") and self.text[self.at] != "]":
                self.note((*path, index))
                self.value((*path, index))
                index += 1
            self.move(self.at + 1)
        else:
            while self.text[self.at] not in ",]}#\n":
                self.at += 1

    def string(self, quote: str) -> None:
        """Skip a string, including escaped quotes and extra quotes at its end."""
        end = self.at + len(quote)
        while not self.text.startswith(quote, end):
            end += 2 if self.text[end] == "\\" and quote[0] == '"' else 1
        end += len(quote)
        if len(quote) == 3:
            while self.text[end] == quote[0]:
                end += 1
        self.move(end)
