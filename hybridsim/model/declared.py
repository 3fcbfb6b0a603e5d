"""What all parts of a model have in common: frozen, converted from plain numbers and texts, with a place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from hybridsim.errors import ModelError, Place
from hybridsim.expr import parse
from hybridsim.model.frozen_map import FrozenMap


@dataclass(frozen=True)
class Declared:
    """Base of every part of a model; ``place`` says where it was declared and takes no part in comparisons.

    Constructors take a number or a text wherever an `Expression` is wanted, a dict wherever a mapping is, and
    a list wherever a tuple is.
    """

    place: Place | None = field(default=None, compare=False, repr=False, kw_only=True)

    def _expressions(self, *fields: str) -> None:
        """Parse what was given as text or number; None stays None."""
        for name in fields:
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, parse(value, self.place))

    def _maps(self, *fields: str) -> None:
        """Freeze mappings of expressions; a value of None stays None."""
        for name in fields:
            items = dict(getattr(self, name))
            parsed = {key: None if text is None else parse(text, self.place) for key, text in items.items()}
            object.__setattr__(self, name, FrozenMap(parsed))

    def _tuples(self, *fields: str) -> None:
        for name in fields:
            object.__setattr__(self, name, as_tuple(getattr(self, name)))

    def error(self, message: str, remedy: str | None = None) -> ModelError:
        """An error about this part, at its place."""
        return ModelError(message, place=self.place, remedy=remedy)


def as_tuple(value: Any) -> tuple[Any, ...]:
    """A single thing becomes a tuple of one; a text counts as a single thing."""
    if isinstance(value, Iterable) and not isinstance(value, (str, Mapping)):
        return tuple(value)
    return (value,)
