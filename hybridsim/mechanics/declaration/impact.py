"""This module defines a unilateral contact of a mechanical system: a linear gap with restitution."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hybridsim.mechanics.declaration.direction import finite, weights
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.impact import ROUNDING


@dataclass(frozen=True)
class MechanicalImpact(Declared):
    """A unilateral contact of a `MechanicalSystem`, such as a stop, a clearance, or two colliding neighbours.

    ::

        g = gap + direction . q >= 0,   its force p >= 0 acts as + direction p,
        0 <= P,   u+ >= e max(-u-, 0),  at least one of the two with equality, u = direction . q'  (`hybridsim.Impact`)

    Parameters
    ----------
    name : str
        The name of the normal force.
    direction : array or mapping of int to float
        The weights (n,), or a mapping from numbers of coordinates to weights: +1 for the body that the force
        pushes along its coordinate, -1 for the one behind it.
    gap : float
        The gap at q = 0.
    restitution : float
        The coefficient e, from 0 (no rebound) to 1 (no loss).
    place : Place, optional
        The place of the declaration, for error messages.

    Raises
    ------
    UsageError
        For a number that is not finite, a zero direction, or a restitution outside [0, 1].

    Notes
    -----
    For many contacts that close, use time stepping: ``hs.simulate(system, t_span, integrator="moreau",
    step=...)``.

    Examples
    --------
    >>> MechanicalImpact("p", {0: 1.0, 1: -1.0}, gap=0.1, restitution=0.5).direction
    ((0, 1.0), (1, -1.0))
    """

    name: str
    direction: Any
    gap: float
    restitution: float
    weights: int = field(init=False, default=0, repr=False, compare=False)  # number of weights given in a row

    def __post_init__(self) -> None:
        self._texts("name")
        for what in ("gap", "restitution"):
            object.__setattr__(self, what, finite(self, what, getattr(self, what)))
        if not -ROUNDING <= self.restitution <= 1.0 + ROUNDING:
            raise self._fault(
                f"`restitution` cannot be {self.restitution!r}",
                "use a number from 0 (no rebound) to 1 (no loss)",
            )
        object.__setattr__(self, "restitution", min(max(self.restitution, 0.0), 1.0))
        pairs, count = weights(self, self.direction)
        object.__setattr__(self, "direction", pairs)
        object.__setattr__(self, "weights", count)
