"""This module defines monitors, which record, reset or end a run at a zero of a scalar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hybridsim.expr import Expression
from hybridsim.model.parts.component import DIRECTIONS
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.frozen_map import FrozenMap

ACTIONS = ("record", "terminate", "reset")


@dataclass(frozen=True)
class Monitor(Declared):
    """An event at each zero crossing of ``expr`` in (t0, t1]; a zero at t0 does not count.

    It fires when the value changes its sign, and when it reaches zero and remains zero, like a velocity at a stop.

    Parameters
    ----------
    name : str
        Name of the monitor and its events.
    expr : str or float
        The monitored scalar.
    direction : str, optional
        "up" (from below zero), "down" (from above) or "both".
    action : str, optional
        "record", "terminate", or "reset" with ``reset`` evaluated at x-.
    reset : mapping of str to str or float, optional
        New value of each changed state or discrete state, as an expression, or ``"+= amount"``. Amounts added at
        the same instant are summed.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> stop = hs.Monitor("half", "x - 0.5", direction="down", action="terminate")
    >>> model = hs.Model("decay", states=[hs.State("x", 1, "-x")], monitors=[stop])
    >>> f"{hs.simulate(model, (0, 2)).t_end:.9f}"  # log(2)
    '0.693147181'
    """

    name: str
    expr: Expression
    direction: str = "both"
    action: str = "record"
    reset: Mapping[str, Expression] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("name")
        self._texts("direction", known=DIRECTIONS)
        self._texts("action", known=ACTIONS)
        self._expressions("expr", functions=True)
        self._maps("reset", functions=True)
