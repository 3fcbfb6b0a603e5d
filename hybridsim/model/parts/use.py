"""This module defines the use of one model as a part of another model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from numbers import Integral
from os import PathLike
from typing import TYPE_CHECKING, Any

from hybridsim.errors import ExpressionError
from hybridsim.model.flattening.indexed import IndexedExpression, parse_indexed
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.frozen_map import FrozenMap
from hybridsim.model.parts.law_of_use import LawOfUse

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model

# Largest number of copies of a part; a chain of a thousand blocks is better declared by `hs.MechanicalSystem`.
MAX_REPEAT = 1_000


@dataclass(frozen=True)
class Use(Declared):
    """A model that is a part of a larger model, which calls the quantity x of this part ``NAME.x``.

    The part is an ordinary model. Its inputs of kind "connected" receive expressions of the whole model. Every quantity
    of a part can be used in the whole model by its name with a dot.

    A part that is repeated 20 times is named NAME1 to NAME20. Its values may use the index i. ``NAME[i-1].x`` is a
    quantity of a neighbour. A condition on i alone is decided first, so a neighbour that does not exist may stand in
    the other branch.

    Parameters
    ----------
    name : str
        Name of the part.
    model : Model, str or path
        The model, or the name or path of one.
    parameters : mapping of str to str or float, optional
        New values of parameters of the part, numbers or expressions of the parameters of the whole model.
    start : mapping of str to str or float, optional
        New initial values of states and discrete states of the part.
    connect : mapping of str to str or float, optional
        Expression of each connected input of the part.
    repeat : int, optional
        Number of copies. The values of the mappings may then be lists with one value per copy.
    laws : mapping of str to FrictionLaw, str or tuple, optional
        Another law for contacts of the part, as in `Model.with_law`, or a pair of a law and the values of its
        parameters. The values are expressions of the whole model.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> tank = hs.Model("tank", states=[hs.State("h", 1, "inflow - h")], inputs=[hs.Input("inflow", "connected")])
    >>> upper = hs.Use("upper", tank, connect={"inflow": 0})
    >>> lower = hs.Use("lower", tank, start={"h": 0}, connect={"inflow": "upper.h"})
    >>> [state.name for state in hs.Model("cascade", use=[upper, lower]).states]
    ['upper.h', 'lower.h']
    """

    name: str
    model: Model
    parameters: Mapping[str, tuple[IndexedExpression, ...]] = field(default_factory=FrozenMap)
    start: Mapping[str, tuple[IndexedExpression, ...]] = field(default_factory=FrozenMap)
    connect: Mapping[str, tuple[IndexedExpression, ...]] = field(default_factory=FrozenMap)
    repeat: int | None = None
    laws: Mapping[str, tuple[LawOfUse, ...]] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("name")
        model: object = self.model
        if not (isinstance(model, Declared) and hasattr(model, "contacts")):
            from hybridsim.model.library import loaded

            object.__setattr__(self, "model", loaded(model))  # type: ignore[arg-type]  # it refuses other objects
        repeat: object = self.repeat
        if repeat is not None:
            number = 0 if isinstance(repeat, bool) or not isinstance(repeat, Integral) else int(repeat)
            if not 1 <= number <= MAX_REPEAT:
                remedy = f"use a whole number from 1 to {MAX_REPEAT}, or omit `repeat`"
                raise self._fault(f"`repeat` cannot be {repeat!r}", remedy)
            object.__setattr__(self, "repeat", number)
        for name in ("parameters", "start", "connect", "laws"):
            items = getattr(self, name)
            entries = "laws" if name == "laws" else "expressions"
            if not isinstance(items, Mapping) or not all(isinstance(key, str) for key in items):
                raise self._fault(f"`{name}` cannot be {items!r}", f"use a dict of names and {entries}")
            single = self._law if name == "laws" else self._parsed_value
            values = {key: self._values(f"{name}[{key!r}]", value, single) for key, value in items.items()}
            object.__setattr__(self, name, FrozenMap(values))

    def _values(self, field: str, value: Any, single: Callable[[str, Any], Any]) -> tuple[Any, ...]:
        """Return one value for all copies, or one for each copy; a pair (law, parameters) is a single value."""
        is_pair = isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], Mapping)
        listed = value if isinstance(value, list | tuple) and not is_pair else [value]
        if len(listed) != 1 and len(listed) != self.repeat:
            copies = f"{self.repeat} copies" if self.repeat else "one copy"
            raise self._fault(f"`{field}` has {len(listed)} values for {copies}", "use one value per copy")
        return tuple(single(field, one) for one in listed)

    def _parsed_value(self, field: str, value: Any) -> IndexedExpression:
        try:
            return parse_indexed(value, self.place)
        except ExpressionError as fault:
            message = f"{self._title}, {field}: {fault.message}"
            raise ExpressionError(message, place=fault.place, remedy=fault.remedy) from None

    def _law(self, field: str, value: Any) -> LawOfUse:
        """Return a law with the values of its parameters, from a law, a name, a path, or a pair with values."""
        if isinstance(value, LawOfUse):
            return value
        law, values = value if isinstance(value, tuple) and len(value) == 2 else (value, {})
        if isinstance(law, str | PathLike):
            from hybridsim.model.library import load_law

            law = load_law(law)
        if not isinstance(law, FrictionLaw) or not isinstance(values, Mapping):
            remedy = "use a law, or a pair (law, parameters), such as ('coulomb', {'mu': 0.3})"
            raise self._fault(f"`{field}` cannot be {value!r}", remedy)
        arguments = {name: self._parsed_value(f"{field}, {name}", one) for name, one in values.items()}
        return LawOfUse(law, FrozenMap(arguments), self.place)

    def numbers(self) -> tuple[int | None, ...]:
        """Return the numbers 1, 2, ... of the copies, or a single None for a part that is not repeated."""
        return (None,) if self.repeat is None else tuple(range(1, self.repeat + 1))
