"""This module defines a dictionary by component name that suggests similar names for a wrong key."""

from __future__ import annotations

from typing import Any, Never, TypeVar

from hybridsim.errors import UsageError, nearest

T = TypeVar("T")


class ByName(dict[str, T]):
    """A dict that suggests similar keys in the error for an unknown key.

    Parameters
    ----------
    remark : a restriction of all values, which is printed with them.
    """

    def __init__(self, *entries: Any, remark: str = "") -> None:
        super().__init__(*entries)
        self.remark = remark

    def __repr__(self) -> str:
        return f"{super().__repr__()} ({self.remark})" if self.remark else super().__repr__()

    def __missing__(self, name: object) -> Never:
        raise UsageError(
            f"the model has no component {name!r}", remedy=nearest(str(name), self, kind="components")
        )
