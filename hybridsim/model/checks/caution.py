"""This module defines warnings about valid models."""

from __future__ import annotations

from dataclasses import dataclass

from hybridsim.errors import HybridsimError, Place


@dataclass(frozen=True)
class Caution:
    """A warning about a valid model, with its message, place and remedy."""

    message: str
    place: Place | None
    remedy: str

    def __str__(self) -> str:
        return str(HybridsimError(self.message, place=self.place, remedy=self.remedy))

    @property
    def sentence(self) -> str:
        """The warning in one line, with file and line number but without the source text."""
        where = self.place.prefix if self.place else ""
        return f"{where}{self.message}: {self.remedy.rstrip('.')}"
