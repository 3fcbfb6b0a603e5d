"""A dictionary of what a solution holds for each component, which says what there is where a name is unknown."""

from __future__ import annotations

from typing import Never, TypeVar

from hybridsim.errors import UsageError, nearest

T = TypeVar("T")


class ByName(dict[str, T]):
    """A dict whose unknown keys are refused with the known ones."""

    def __missing__(self, name: object) -> Never:
        raise UsageError(
            f"the model has no component {name!r}", remedy=nearest(str(name), self, kind="components")
        )
