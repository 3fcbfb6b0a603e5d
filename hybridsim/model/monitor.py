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
    """Fires where ``expr`` leaves its side of zero over (t0, t1], whatever the action; a zero at t0 does not fire.

    So it fires where its value changes its sign, or comes to zero and stays there, as a velocity does at a stop.

    Parameters
    ----------
    name : str
        What its events are called.
    expr : str or float
        What is watched.
    direction : str, optional
        "up" (from below zero), "down" (from above) or "both".
    action : str, optional
        "record", "terminate", or "reset" with ``reset`` evaluated at x-.
    reset : mapping of str to str or float, optional
        State or discrete state to the expression that gives its new value, or to ``"+= amount"``, which adds:
        amounts of one instant are summed in any order.
    place : Place, optional
        Where it is written, for the messages of errors.

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
