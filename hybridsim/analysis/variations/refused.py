"""This module rejects runs for which derivatives are not computed."""

from __future__ import annotations

import math

from hybridsim.engine.events.zeno.limits import LIMIT
from hybridsim.errors import UsageError
from hybridsim.solution.solution import Solution

# A series that was followed to its last thousand roundings of time has all its derivatives in the passed
# events.
_ROUNDINGS = 4096.0


def refuse(solution: Solution) -> None:
    """Reject runs of which derivatives cannot be computed."""
    if solution._save != "all":
        raise UsageError(
            f"the run was made with keep={solution._save!r}, but derivatives need the whole run",
            remedy="repeat the run with keep='all'",
        )
    if solution.t_end <= solution.t_start:
        raise UsageError("`solution` does not run forward in time", remedy="use a run with t1 > t0")
    _refuse_limits(solution)


def _refuse_limits(solution: Solution) -> None:
    """Raise an error for a run in which accumulating events were not resolved down to rounding errors."""
    components = {component.name: component for component in solution.components}
    before = solution.t_start
    for event in solution.events:
        if event.kind != "transition":
            continue
        component = components[event.component]
        names = [guard.name for guard in component.mode(event.source).guards]
        if event.guard == LIMIT and LIMIT in names and component.limit:
            raise UsageError(
                f"the guard {LIMIT} of {event.component} has a name that is reserved for accumulations "
                f"of events, so the guard cannot be distinguished from the accumulation at t = {event.t:.9g}",
                remedy="rename the guard",
            )
        if event.guard == LIMIT and LIMIT not in names:
            if event.t - before > _ROUNDINGS * math.ulp(event.t):
                raise UsageError(
                    f"events accumulate at t = {event.t:.9g} and were not resolved to rounding error, so the "
                    "run has "
                    "no derivatives",
                    remedy="use finite differences between runs",
                )
        elif event.t > before:
            before = event.t
