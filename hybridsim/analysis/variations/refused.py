"""This module rejects runs and parameters for which derivatives are not computed."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.events.zeno.limits import LIMIT
from hybridsim.errors import UsageError
from hybridsim.model import Model
from hybridsim.solution.solution import Solution

# A series that was followed to its last thousand roundings of time has all its derivatives in the passed
# events.
_ROUNDINGS = 4096.0


def refuse_limits(solution: Solution) -> None:
    """Reject a run in which accumulating events were not followed down to rounding errors."""
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


def refuse_inputs(model: Model, G: np.ndarray) -> None:
    """Reject parameters on which the shape of an input depends, because its derivatives are unknown."""
    moving = {p.name for p, row in zip(model.parameters, G, strict=True) if row.any()}
    starts = {part.name: part.start.names for part in model.discrete}
    for declared in model.inputs:
        names = {n for e in declared.expressions.values() for n in e.names}
        used = sorted(moving & names.union(*(starts.get(name, ()) for name in names)))
        if used:
            raise UsageError(
                f"{declared.subject} depends on {used[0]}, but its derivative with respect to {used[0]} is unknown",
                remedy=f"do not request derivatives by {used[0]}, or write the input as an expression of t"
                if declared.kind != "step"
                else f"do not request derivatives by {used[0]}, or let a schedule reset a discrete state instead",
            )
