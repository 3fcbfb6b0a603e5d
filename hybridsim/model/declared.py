"""What all parts of a model have in common: frozen, converted from plain numbers and texts, with a place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, field
from inspect import Signature, signature
from numbers import Complex, Real
from typing import Any

from hybridsim.calls import refuse_unless_taken
from hybridsim.errors import ExpressionError, ModelError, Place, UsageError
from hybridsim.expr import Expression, of_function, parse, parse_reset
from hybridsim.model.frozen_map import FrozenMap


class _Refusing(type):
    """Constructors that say what they take where they are called with something else."""

    @property
    def __signature__(cls) -> Signature:
        """What help and editors show; without it they would show that of the call below."""
        _, *parameters = signature(cls.__init__).parameters.values()  # type: ignore[misc]  # of this very class
        return Signature(parameters)

    def __call__(cls, *args: Any, **keywords: Any) -> Any:
        place = keywords.get("place")
        if not (place is None or isinstance(place, Place)):
            raise UsageError(
                f"{cls.__name__}: place is {place!r}", remedy="give hs.Place(...), or leave it out"
            )
        try:
            return super().__call__(*args, **keywords)
        except TypeError:
            refuse_unless_taken(cls.__name__, signature(cls), args, keywords, "place")
            raise


@dataclass(frozen=True)
class Declared(metaclass=_Refusing):
    """Base of every part of a model; ``place`` says where it was declared and takes no part in comparisons.

    Constructors take a number or a text wherever an `Expression` is wanted, a dict wherever a mapping is, and
    a list wherever a tuple is.
    """

    place: Place | None = field(default=None, compare=False, repr=False, kw_only=True)

    def _texts(self, *fields: str, known: Iterable[str] = ()) -> None:
        """See to it that names and words are texts; None stays None where it is the default.

        known: the words there are.
        """
        for name in fields:
            value = getattr(self, name)
            if not (isinstance(value, str) or (value is None and self._has_default(name))):
                remedy = "give " + (", ".join(map(repr, known)) if known else "a text")
                raise self._fault(f"{name} is {value!r}", remedy)

    def _expressions(self, *fields: str, functions: bool = False) -> None:
        """Parse what was given as text or number; None stays None where it is the default.

        functions: whether a Python function may stand there as well.
        """
        for name in fields:
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, self._parsed(value, name, functions))
            elif not self._has_default(name):
                raise self._fault(f"{name} is None", "give a number or an expression")

    def _parsed(self, value: Any, field: str, functions: bool, is_reset: bool = False) -> Expression:
        if functions and callable(value):
            return of_function(value, self.place)
        try:
            return parse_reset(value, self.place) if is_reset else parse(value, self.place)
        except ExpressionError as fault:
            message = f"{self._title}: {field}: {fault.message}"
            raise ExpressionError(message, place=fault.place, remedy=fault.remedy) from None

    def _maps(self, *fields: str, functions: bool = False) -> None:
        """Freeze mappings of expressions (or, if so, Python functions); a value of None stays None.

        In those named reset a text may begin with '+=': an amount to add.
        """
        for name in fields:
            items = getattr(self, name)
            if not isinstance(items, Mapping) or not all(isinstance(key, str) for key in items):
                raise self._fault(f"{name} is {items!r}", "give a mapping from names to expressions")
            parsed = {
                key: None if v is None else self._parsed(v, f"{name}[{key!r}]", functions, name == "reset")
                for key, v in items.items()
            }
            object.__setattr__(self, name, FrozenMap(parsed))

    def _sizes(self, *fields: str) -> None:
        """Make mappings from names to typical sizes; validation says whether these are above zero."""
        for name in fields:
            items = getattr(self, name)
            if not isinstance(items, Mapping) or not all(isinstance(key, str) for key in items):
                raise self._fault(f"{name} is {items!r}", "give a mapping from names to numbers")
            sizes = {key: self._real(f"{name}[{key!r}]", value) for key, value in items.items()}
            object.__setattr__(self, name, FrozenMap(sizes))

    def _real(self, what: str, value: object) -> float:
        """A real number as a double; one beyond all doubles is infinite."""
        if not isinstance(value, Real):
            raise self._fault(f"{what} is {value!r}", "give a number, or leave it out")
        try:
            return float(value)
        except OverflowError:
            return math.inf

    def _functions(self, *fields: str) -> None:
        """See to it that functions are callable; None stays None."""
        for name in fields:
            value = getattr(self, name)
            if not (value is None or callable(value)):
                raise self._fault(f"{name} is {value!r}", "give a Python function of (t, x, p)")

    def _flags(self, *fields: str) -> None:
        """See to it that switches are truth values."""
        for name in fields:
            value = getattr(self, name)
            if type(value).__name__ != "bool":  # NumPy's truth values have the same name
                raise self._fault(f"{name} is {value!r}", "give True or False")
            object.__setattr__(self, name, bool(value))

    def _parts(self, field: str, kind: type[Declared]) -> None:
        """Make a tuple of parts of one kind; a single one becomes a tuple of one."""
        parts = as_tuple(getattr(self, field))
        for part in parts:
            if not isinstance(part, kind):
                raise self._fault(f"{field} holds {part!r}", f"give hs.{kind.__name__}(...) objects")
        object.__setattr__(self, field, parts)

    def _numbers(self, *fields: str) -> None:
        """Make tuples of numbers."""
        for name in fields:
            given = getattr(self, name)
            try:
                object.__setattr__(self, name, tuple(_as_double(number) for number in as_tuple(given)))
            except (TypeError, ValueError, OverflowError):
                raise self._fault(f"{name} is {given!r}", "give numbers") from None

    def _has_default(self, field: str) -> bool:
        return self.__dataclass_fields__[field].default is not MISSING

    @property
    def _title(self) -> str:
        name = getattr(self, "name", None)
        return f"{type(self).__name__} {name}" if isinstance(name, str) else type(self).__name__

    def _fault(self, message: str, remedy: str) -> UsageError:
        """What is wrong with an argument of the constructor."""
        return UsageError(f"{self._title}: {message}", place=self.place, remedy=remedy)

    def error(self, message: str, remedy: str | None = None) -> ModelError:
        """An error about this part, at its place."""
        return ModelError(message, place=self.place, remedy=remedy)


def as_tuple(value: Any) -> tuple[Any, ...]:
    """A single thing becomes a tuple of one; a text and an array without dimensions count as single things."""
    if isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping)):
        try:
            return tuple(value)
        except TypeError:  # an array without dimensions calls itself iterable
            pass
    return (value,)


def _as_double(number: Any) -> float:
    """A number as a double; NumPy would drop the imaginary part of a complex one."""
    if isinstance(number, Complex) and not isinstance(number, Real):
        raise TypeError(number)
    return float(number)
