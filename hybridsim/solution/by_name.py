"""This module defines a dictionary by component name that suggests similar names for a wrong key."""

from __future__ import annotations

from typing import Never, TypeVar

from hybridsim.errors import UsageError, nearest

T = TypeVar("T")


class ByName(dict[str, T]):
    """A dict that suggests similar keys in the error for an unknown key."""

    def __missing__(self, name: object) -> Never:
        raise UsageError(
            f"the model has no component {name!r}", remedy=nearest(str(name), self, kind="components")
        )
