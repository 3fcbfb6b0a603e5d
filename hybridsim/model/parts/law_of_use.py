"""This module defines the friction law that the use of a part gives to a contact of the part."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from hybridsim.errors import Place
from hybridsim.model.flattening.indexed import IndexedExpression
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.parts.frozen_map import FrozenMap


@dataclass(frozen=True)
class LawOfUse:
    """A law and the values of its parameters, which are expressions of the model that contains the part."""

    law: FrictionLaw
    arguments: Mapping[str, IndexedExpression] = field(default_factory=FrozenMap)
    place: Place | None = field(default=None, compare=False, repr=False)


def law_of_use(
    value: Any, parsed: Callable[[str, Any], IndexedExpression], place: Place | None
) -> LawOfUse | None:
    """Return the law that an argument of `Use` describes, or None if it is not a law.

    Parameters
    ----------
    value : a law, the name or path of a law, or a pair of these and a mapping of values.
    parsed : returns the expression of a parameter's name and value.
    """
    if isinstance(value, LawOfUse):
        return value
    law, values = value if isinstance(value, tuple) and len(value) == 2 else (value, {})
    if isinstance(law, str):
        from hybridsim.model.library import load_law

        law = load_law(law)
    if not isinstance(law, FrictionLaw) or not isinstance(values, Mapping):
        return None
    return LawOfUse(law, FrozenMap({name: parsed(name, single) for name, single in values.items()}), place)
