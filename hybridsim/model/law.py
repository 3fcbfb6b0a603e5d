"""A friction law: how large the force is in slip, and how much stick can carry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hybridsim.expr import Expression
from hybridsim.model.declared import Declared, as_tuple
from hybridsim.model.frozen_map import FrozenMap

SPEED = "v"
NORMAL = "N"


@dataclass(frozen=True)
class FrictionLaw(Declared):
    """Magnitude of the friction force as a declaration.

        slip :  |f| = slip(v, N),  v >= 0 the magnitude of the relative velocity
        stick:  |f| <= stick(N)

    Parameters
    ----------
    slip : expression of ``v``, ``N`` (normal load) and the law's own parameters.
    stick : expression of ``N`` and the law's own parameters.
    parameters : name to default (a number or an expression of the others); a default of None, or a plain
        sequence of names, makes them arguments that every contact has to give.

    Examples
    --------
    >>> FrictionLaw("coulomb", slip="mu*N", stick="mu*N", parameters=["mu"]).parameters
    {'mu': None}
    """

    name: str
    slip: Expression
    stick: Expression
    parameters: Mapping[str, Expression | None] = field(default_factory=FrozenMap)
    title: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("slip", "stick")
        given: object = self.parameters
        if not isinstance(given, Mapping):
            object.__setattr__(self, "parameters", dict.fromkeys(as_tuple(given)))
        self._maps("parameters")
