"""This module defines the base class of all parts of a model, which checks constructor arguments."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from inspect import Signature, signature
from numbers import Complex, Real
from typing import Any

from hybridsim.calls import refuse_unless_taken
from hybridsim.errors import ExpressionError, ModelError, Place, UsageError
from hybridsim.expr import Expression, of_function, parse, parse_reset
from hybridsim.model.parts.frozen_map import FrozenMap


class _Refusing(type):
    """The metaclass that turns wrong constructor arguments into `UsageError` with a list of arguments."""

    @property
    def __signature__(cls) -> Signature:
        """The signature of the constructor, which help and editors display."""
        _, *parameters = signature(cls.__init__).parameters.values()  # type: ignore[misc]  # of this very class
        return Signature(parameters)

    def __call__(cls, *args: Any, **keywords: Any) -> Any:
        place = keywords.get("place")
        if not (place is None or isinstance(place, Place)):
            raise UsageError(
                f"{cls.__name__}: `place` cannot be {place!r}", remedy="use hs.Place(...), or omit `place`"
            )
        try:
            return super().__call__(*args, **keywords)
        except TypeError:
            refuse_unless_taken(cls.__name__, signature(cls), args, keywords, "place")
            raise


@dataclass(frozen=True)
class Declared(metaclass=_Refusing):
    """Base class of every part of a model; ``place`` records its declaration and is ignored by comparisons.

    Constructors accept a number or a string for an `Expression`, a dict for a mapping, and a list for a tuple.
    """

    place: Place | None = field(default=None, compare=False, repr=False, kw_only=True)

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if "__repr__" not in cls.__dict__:  # otherwise the class would get one that lists all fields
            cls.__repr__ = Declared.__repr__  # type: ignore[method-assign]  # what a method of the class would be

    def __repr__(self) -> str:
        """Return the constructor's call, without arguments that have their defaults."""
        declared = [entry.name for entry in fields(self) if entry.repr and not self._is_default(entry)]
        return f"{type(self).__name__}({', '.join(f'{name}={_shown(getattr(self, name))}' for name in declared)})"

    def _is_default(self, entry: Field[Any]) -> bool:
        value = getattr(self, entry.name)
        default = entry.default_factory() if entry.default_factory is not MISSING else entry.default
        if isinstance(value, Mapping | tuple) and isinstance(default, Mapping | tuple):
            return len(value) == len(default) == 0
        if isinstance(value, Expression):
            return value.text == str(default)
        return type(value) is type(default) and bool(value == default)

    def _texts(self, *fields: str, known: Iterable[str] = ()) -> None:
        """Check that the fields are strings; None is accepted if it is the default.

        `known` lists the allowed words for the remedy.
        """
        for name in fields:
            value = getattr(self, name)
            if not (isinstance(value, str) or (value is None and self._has_default(name))):
                remedy = "use " + (" or ".join(map(repr, known)) if known else "a string")
                raise self._fault(f"`{name}` cannot be {value!r}", remedy)

    def _expressions(self, *fields: str, functions: bool = False) -> None:
        """Parse the fields from strings or numbers; None is kept if it is the default.

        With `functions`, a Python function is accepted too.
        """
        for name in fields:
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, self._parsed(value, name, functions))
            elif not self._has_default(name):
                raise self._fault(f"`{name}` cannot be None", "use a number or an expression")

    def _parsed(self, value: Any, field: str, functions: bool, is_reset: bool = False) -> Expression:
        if functions and callable(value):
            return of_function(value, self.place)
        try:
            return parse_reset(value, self.place) if is_reset else parse(value, self.place)
        except ExpressionError as fault:
            message = f"{self._title}, {field}: {fault.message}"
            raise ExpressionError(message, place=fault.place, remedy=fault.remedy) from None

    def _maps(self, *fields: str, functions: bool = False) -> None:
        """Convert mappings of expressions to frozen mappings; a value of None is kept.

        In a mapping named reset, a text may begin with '+=', which adds the amount.
        """
        for name in fields:
            items = getattr(self, name)
            if not isinstance(items, Mapping) or not all(isinstance(key, str) for key in items):
                raise self._fault(f"`{name}` cannot be {items!r}", "use a dict of names and expressions")
            parsed = {
                key: None if v is None else self._parsed(v, f"{name}[{key!r}]", functions, name == "reset")
                for key, v in items.items()
            }
            object.__setattr__(self, name, FrozenMap(parsed))

    def _sizes(self, *fields: str) -> None:
        """Convert mappings of nominal sizes to floats; validation checks that they are positive."""
        for name in fields:
            items = getattr(self, name)
            if not isinstance(items, Mapping) or not all(isinstance(key, str) for key in items):
                raise self._fault(f"`{name}` cannot be {items!r}", "use a dict of names and numbers")
            sizes = {key: self._real(f"{name}[{key!r}]", value) for key, value in items.items()}
            object.__setattr__(self, name, FrozenMap(sizes))

    def _real(self, field: str, value: object) -> float:
        """Return a real number as float; numbers beyond the range of floats become infinite."""
        if not isinstance(value, Real):
            raise self._fault(f"`{field}` cannot be {value!r}", f"use a number, or omit `{field}`")
        try:
            return float(value)
        except OverflowError:
            return math.inf

    def _functions(self, *fields: str) -> None:
        """Check that the fields are callable or None."""
        for name in fields:
            value = getattr(self, name)
            if not (value is None or callable(value)):
                raise self._fault(f"`{name}` cannot be {value!r}", "use a Python function of (t, x, p)")

    def _flags(self, *fields: str) -> None:
        """Check that the fields are bools."""
        for name in fields:
            value = getattr(self, name)
            if type(value).__name__ != "bool":  # includes numpy.bool
                raise self._fault(f"`{name}` cannot be {value!r}", "use True or False")
            object.__setattr__(self, name, bool(value))

    def _parts(self, field: str, kind: type[Declared]) -> None:
        """Convert a field to a tuple of parts of one class; a single part becomes a tuple."""
        parts = as_tuple(getattr(self, field))
        for part in parts:
            if not isinstance(part, kind):
                raise self._fault(f"`{field}` contains {part!r}", f"use hs.{kind.__name__}(...) objects")
        object.__setattr__(self, field, parts)

    def _numbers(self, *fields: str) -> None:
        """Convert the fields to tuples of floats."""
        for name in fields:
            object.__setattr__(self, name, self._doubles(name, getattr(self, name)))

    def _rows(self, field: str) -> None:
        """Convert a field to a tuple of rows, each of which is a tuple of floats."""
        rows = as_tuple(getattr(self, field))
        object.__setattr__(self, field, tuple(self._doubles(field, row) for row in rows))

    def _doubles(self, field: str, entries: Any) -> tuple[float, ...]:
        try:
            return tuple(_as_double(number) for number in as_tuple(entries))
        except (TypeError, ValueError, OverflowError):
            raise self._fault(f"`{field}` cannot be {entries!r}", "use numbers") from None

    def _has_default(self, field: str) -> bool:
        return self.__dataclass_fields__[field].default is not MISSING

    @property
    def _title(self) -> str:
        name = getattr(self, "name", None)
        return f"{type(self).__name__} {name}" if isinstance(name, str) else type(self).__name__

    def _fault(self, message: str, remedy: str) -> UsageError:
        """Return the error for a wrong argument of a constructor."""
        return UsageError(f"{self._title}: {message}", place=self.place, remedy=remedy)

    def error(self, message: str, remedy: str | None = None) -> ModelError:
        """Return an error about this part, with the place of its declaration."""
        return ModelError(message, place=self.place, remedy=remedy)


def as_tuple(value: Any) -> tuple[Any, ...]:
    """Return a tuple; a single object becomes a tuple with one element."""
    if isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping)):
        try:
            return tuple(value)
        except TypeError:  # a zero-dimensional array has the type Iterable but no items
            pass
    return (value,)


def _as_double(number: Any) -> float:
    """Return a number as float, and reject complex numbers."""
    if isinstance(number, Complex) and not isinstance(number, Real):
        raise TypeError(number)
    return float(number)


def _shown(value: Any) -> str:
    """Return an argument as it is written in a call: an expression is its text."""
    if isinstance(value, Expression):
        return repr(value.text)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key!r}: {_shown(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, tuple):
        inner = ", ".join(map(_shown, value))
        return f"({inner},)" if len(value) == 1 else f"({inner})"
    return repr(value)
