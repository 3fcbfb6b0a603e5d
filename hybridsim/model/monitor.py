"""An event that changes no mode: it records, resets or ends the run where a scalar changes its side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hybridsim.expr import Expression
from hybridsim.model.declared import Declared
from hybridsim.model.frozen_map import FrozenMap

DIRECTIONS = ("up", "down", "both")
ACTIONS = ("record", "terminate", "reset")


@dataclass(frozen=True)
class Monitor(Declared):
    """Fires where ``expr`` changes its side over (t0, t1]; a zero at t0 does not fire.

    Parameters
    ----------
    direction : "up" (negative to positive), "down" or "both".
    action : "record", "terminate", or "reset" with ``reset`` evaluated at x-.
    """

    name: str
    expr: Expression
    direction: str = "both"
    action: str = "record"
    reset: Mapping[str, Expression] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("name", "direction", "action")
        self._expressions("expr", functions=True)
        self._maps("reset", functions=True)
