"""This module defines the read-only dicts that a simulator returns; the errors of assignments name a remedy."""

from __future__ import annotations

from typing import Any, NoReturn, TypeVar

from hybridsim.errors import UsageError

Value = TypeVar("Value")


class ReadOnly(dict[str, Value]):
    """A dict that cannot be changed; copies of this dict are ordinary dicts.

    Parameters
    ----------
    title : name of the attribute that returns the dict, such as "sim.state".
    remedy : what to do instead of an assignment.
    """

    __slots__ = ("_remedy", "_title")

    def __init__(self, values: dict[str, Value], title: str, remedy: str) -> None:
        super().__init__(values)
        self._title, self._remedy = title, remedy

    def _refuse(self, name: object, *value: object) -> NoReturn:
        operation = f"set to {value[0]!r}" if value else "deleted"
        raise UsageError(f"{self._title}[{name!r}] cannot be {operation}", remedy=self._remedy)

    def _refuse_all(self, *_: object, **__: object) -> NoReturn:
        raise UsageError(f"{self._title} cannot be changed", remedy=self._remedy)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle the values as an ordinary dict."""
        return dict, (dict(self),)

    __setitem__ = __delitem__ = _refuse
    update = pop = popitem = setdefault = clear = __ior__ = _refuse_all
