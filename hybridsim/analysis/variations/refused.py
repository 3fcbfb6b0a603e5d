"""This module rejects runs for which derivatives are not computed."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.events.zeno.limits import LIMIT
from hybridsim.engine.record.event_block import EventBlock
from hybridsim.engine.record.segments import Occurrence
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
    is_reserved = any(
        guard.name == LIMIT
        for component in solution.components
        for mode in component.modes
        for guard in mode.guards
    )
    before = solution.t_start
    for block in solution._of_model.record.occurrences.blocks:
        if isinstance(block, EventBlock) and not is_reserved:  # an accumulation is never in such a block
            instants, _ = block.transitions(0)
            before = max(before, float(instants[-1].sum())) if len(instants) else before
            continue
        for one in block:
            if one.kind == "transition":
                before = max(before, _refuse_limit(one, components[one.component], before))


def _refuse_limit(one: Occurrence, component: Any, before: float) -> float:
    """Return the time of the latest ordinary event; raise an error for an accumulation that was not resolved."""
    names = [guard.name for guard in component.mode(one.source).guards]
    t = float(one.instant)
    if one.guard != LIMIT:
        return t
    if LIMIT in names and component.limit:
        raise UsageError(
            f"the guard {LIMIT} of {one.component} has a name that is reserved for accumulations "
            f"of events, so the guard cannot be distinguished from the accumulation at t = {t:.9g}",
            remedy="rename the guard",
        )
    if LIMIT not in names and t - before > _ROUNDINGS * math.ulp(t):
        raise UsageError(
            f"events accumulate at t = {t:.9g} and were not resolved to rounding error, so the run has no derivatives",
            remedy="use finite differences between runs",
        )
    return t if LIMIT in names else before
