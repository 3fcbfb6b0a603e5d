"""This module defines the friction law that a use of a part sets for one of the part's contacts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hybridsim.errors import Place
from hybridsim.model.flattening.indexed import IndexedExpression
from hybridsim.model.laws.law import FrictionLaw
from hybridsim.model.parts.frozen_map import FrozenMap


@dataclass(frozen=True)
class LawOfUse:
    """A law with values of its parameters; the values are expressions of the model that contains the part."""

    law: FrictionLaw
    arguments: Mapping[str, IndexedExpression] = field(default_factory=FrozenMap)
    place: Place | None = field(default=None, compare=False, repr=False)
