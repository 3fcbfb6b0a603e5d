"""This module finds the quantities that contain the force of an impact, which has an impulse at each impact."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hybridsim.errors import UsageError


def impact_behind(model: Any, quantities: Iterable[str]) -> str | None:
    """Return the name of an impact of a `Model` whose force is contained in one of the quantities, or None.

    A `MechanicalSystem` has none, because its forces are means over a step, which contain the impulses.
    """
    if hasattr(model, "M"):
        return None
    impacts, behind = {impact.name for impact in model.impacts}, dict[str, set[str]]()
    expressions = [*model.definitions, *((output.name, output.expr) for output in model.outputs)]
    for name, expression in (*expressions, *((contact.name, contact.normal) for contact in model.contacts)):
        behind.setdefault(name, set()).update(expression.names)
    found, left = set[str](), set(quantities)
    while left:
        found |= left
        left = {name for one in left for name in behind.get(one, ())} - found
    return min(found & impacts, default=None)


def refuse_impulses(solution: Any, quantities: Iterable[str], what: str) -> None:
    """Raise an error if one of the quantities has impulses in a run, because an integral over time omits them."""
    names = list(quantities)
    impact = impact_behind(solution.model, names)
    if impact is None or not len(solution.event_times(impact)):
        return
    own = next(name for name in names if impact_behind(solution.model, [name]) is not None)
    reason = "it is" if own == impact else "it contains"
    raise UsageError(
        f"{what} of {own} would omit impulses: {reason} the force of impact {impact}",
        remedy="compute the impulses from the velocities before and after the impacts, "
        f"sol.event_states({impact!r}, side='-') and sol.event_states({impact!r}), times the mass",
    )
