"""A report read back: its elements, and the data of its script as arrays."""

from __future__ import annotations

import json
from base64 import b64decode
from html.parser import HTMLParser
from typing import Any

import numpy as np

VOID = {"meta", "br", "input", "hr", "img", "link"}


class ParsedPage(HTMLParser):
    """Elements in order as (tag, attributes, text); fails on a tag that is not closed."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None], list[str]]] = []
        self._open: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.feed(text)
        self.close()
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = (tag, dict(attrs), [])
        self.elements.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs), []))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        for _, _, texts in self._open:
            texts.append(data)

    def all(self, tag: str) -> list[tuple[dict[str, str | None], str]]:
        return [(attributes, "".join(texts)) for name, attributes, texts in self.elements if name == tag]

    def text_of(self, identifier: str) -> str:
        (found,) = ["".join(texts) for _, attrs, texts in self.elements if attrs.get("id") == identifier]
        return found

    def has(self, identifier: str) -> bool:
        return any(attributes.get("id") == identifier for _, attributes, _ in self.elements)

    @property
    def data(self) -> dict[str, Any]:
        return dict(json.loads(self.text_of("data")))


def unpacked(packed: dict[str, str]) -> np.ndarray:
    """The array of a value of the data, little-endian as browsers read it."""
    return np.frombuffer(b64decode(packed["bytes"]), dtype="<" + packed["kind"])
