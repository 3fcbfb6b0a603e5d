"""Limits of series of events that derivatives are not carried through."""

from __future__ import annotations

import math

from hybridsim.engine.gathering import LIMIT
from hybridsim.errors import UsageError
from hybridsim.solution.solution import Solution

# A series that was followed to its last thousand roundings of the time has all its derivatives in the events passed.
_ROUNDINGS = 4096.0


def refuse_limits(solution: Solution) -> None:
    """Refuse a run with a series that ended short of rounding, or in a reset that depends on anything."""
    components = {component.name: component for component in solution.components}
    before = solution.t_start
    for event in solution.events:
        if event.kind != "transition":
            continue
        component = components[event.component]
        names = [guard.name for guard in component.mode(event.source).guards]
        if event.guard == LIMIT and LIMIT not in names:
            reset = component.limit.reset if component.limit else {}
            if any(expression.names for expression in reset.values()):
                raise UsageError(
                    f"the limit of {event.component} at t = {event.t!r} resets {', '.join(reset)} by an expression: "
                    "derivatives are not carried through that",
                    remedy="take differences of runs",
                )
            if event.t - before > _ROUNDINGS * math.ulp(event.t):
                raise UsageError(
                    f"the events that accumulate at t = {event.t!r} were not followed to rounding: derivatives are "
                    "not carried through them",
                    remedy="take differences of runs",
                )
        elif event.t > before:
            before = event.t
