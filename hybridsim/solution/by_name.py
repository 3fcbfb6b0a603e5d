"""This module defines a dictionary by component whose error for an unknown name lists the known names."""

from __future__ import annotations

from typing import Never, TypeVar

from hybridsim.errors import UsageError, nearest

T = TypeVar("T")


class ByName(dict[str, T]):
    """A dict whose error for an unknown key suggests the known keys."""

    def __missing__(self, name: object) -> Never:
        raise UsageError(
            f"the model has no component {name!r}", remedy=nearest(str(name), self, kind="components")
        )
