"""Limits of series of events that derivatives are not carried through."""

from __future__ import annotations

import math

from hybridsim.engine.gathering import LIMIT
from hybridsim.errors import UsageError
from hybridsim.solution.solution import Solution

# A series that was followed to its last thousand roundings of the time has all its derivatives in the events passed.
_ROUNDINGS = 4096.0


def refuse_limits(solution: Solution) -> None:
    """Refuse a run with a series of events that ended short of rounding."""
    components = {component.name: component for component in solution.components}
    before = solution.t_start
    for event in solution.events:
        if event.kind != "transition":
            continue
        component = components[event.component]
        names = [guard.name for guard in component.mode(event.source).guards]
        if event.guard == LIMIT and LIMIT in names and component.limit:
            raise UsageError(
                f"the guard {LIMIT} of {event.component} has the name of the changes that are made where its "
                f"events accumulate, as at t = {event.t!r}: its own are not told apart from them",
                remedy="give the guard another name",
            )
        if event.guard == LIMIT and LIMIT not in names:
            if event.t - before > _ROUNDINGS * math.ulp(event.t):
                raise UsageError(
                    f"the events that accumulate at t = {event.t!r} were not followed to rounding: derivatives are "
                    "not carried through them",
                    remedy="take differences of runs",
                )
        elif event.t > before:
            before = event.t
