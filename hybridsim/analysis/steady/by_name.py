"""This module gives the values of a measure by the names of the quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property

from hybridsim.errors import UsageError, nearest


class UnknownName(UsageError, KeyError):
    """Raised if a measure is requested by an unknown name."""


class ByName(Mapping[str, float]):
    """The values of one measure by the names of the quantities, computed on demand.

    Quantities that cannot be read are not items of it; accessing them raises an error with the reason.

    Parameters
    ----------
    listed : returns the names of all quantities, and of those that cannot be read.
    measure : returns a value by the name of a quantity.
    kind : of the quantities, for errors.
    known : values that are known already, by the name of a quantity.
    """

    def __init__(
        self,
        listed: Callable[[], tuple[Iterable[str], frozenset[str]]],
        measure: Callable[[str], float],
        kind: str,
        known: Mapping[str, float] | None = None,
    ) -> None:
        self._listed, self._measure, self._kind, self._known = listed, measure, kind, known or {}

    @cached_property
    def _unreadable(self) -> frozenset[str]:
        return self._listed()[1]

    @cached_property
    def _names(self) -> tuple[str, ...]:
        names, unreadable = self._listed()
        return tuple(name for name in names if name not in unreadable)

    def __getitem__(self, name: str) -> float:
        if isinstance(name, str) and name in self._known:
            return self._known[name]
        if not isinstance(name, str) or (name not in self._names and name not in self._unreadable):
            raise UnknownName(
                f"the steady state has no {self._kind} {name!r}",
                remedy=nearest(str(name), self._names, kind=self._kind),
            )
        return self._measure(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return repr(dict(self))
