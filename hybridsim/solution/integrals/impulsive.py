"""This module finds quantities that contain the force of an impact, and computes the impulses of this force."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from hybridsim.errors import UsageError
from hybridsim.model.parts.impact import OPEN

_ROUNDING = (
    1e-6  # of the change of the states at an impact: a smaller part that no impulse explains is rounding
)


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
        remedy=f"measure the sum of its impulses, 'impulse.{impact}', or compute them from the velocities before and "
        f"after the impacts, sol.event_states({impact!r}, side='-') and sol.event_states({impact!r}), times the mass",
    )


def is_struck(event: Any) -> bool:
    """Return whether an event of an impact is a collision: its gap closes, and not only its force ends."""
    return bool(event.guard == "gap" and event.source == OPEN)


def impulse_of(solution: Any, impact: str) -> float:
    """Return the sum of the impulses of an impact during a run of a `Model`.

    The impulses of the contacts that take part in a collision follow from the change of the states.

    Raises
    ------
    UsageError
        If several sets of impulses fit, or if a reset changes the states at the same instant.
    """
    system = solution._system
    names = [automaton.name for automaton in system.automata]
    impacts = {name for name, is_unilateral in zip(names, system.is_unilateral, strict=True) if is_unilateral}
    total = 0.0
    for t, happened in groupby(solution.events, key=lambda event: event.t):
        events = list(happened)
        struck = {names.index(e.component) for e in events if e.component in impacts and is_struck(e)}
        if struck:
            total += _impulses(solution, t, events, struck).get(names.index(impact), 0.0)
    return total


def _impulses(solution: Any, t: float, events: Sequence[Any], struck: set[int]) -> dict[int, float]:
    """Return the impulses of all contacts that take part in collisions at time t, by their numbers."""
    system, trajectory = solution._system, solution._of_model
    index, s = trajectory.segment_at(np.array([t]), "-")
    segment, before = solution._segments[int(index[0])], events[0].x_minus
    _, changes, loads = system.impulses(float(s[0]), before, segment.p, np.maximum(segment.z, 0))
    place = {c: k for k, c in enumerate(system.surface_of)}
    normal = [
        c
        for c in place
        if system.is_unilateral[c] and (c in struck or segment.z[c] == system.automata[c].hold)
    ]
    columns = [place[c] for c in normal]
    rubbing = [c for c in place if not system.is_unilateral[c] and loads[:, place[c]][:, columns].any()]
    rows, moved = changes[[place[c] for c in (*normal, *rubbing)]], events[-1].x_plus - before
    found = np.linalg.lstsq(rows.T, moved, rcond=None)[0]
    names = ", ".join(system.automata[c].name for c in normal)
    if np.linalg.matrix_rank(rows) < len(rows):
        raise UsageError(
            f"the impulses of {names} at t = {t:.9g} are not unique, because their contacts depend on each other",
            remedy="measure the velocities, such as 'maximum.v'",
        )
    on_surfaces = {system.automata[c].name for c in place}
    resets = [e.component for e in events if e.component not in on_surfaces and (e.x_minus != e.x_plus).any()]
    if resets or np.abs(moved - found @ rows).max() > _ROUNDING * np.abs(moved).max():
        raise UsageError(
            f"the impulse of {names} at t = {t:.9g} is unknown, because a reset changes the states at the same instant",
            remedy="do the reset at another time",
        )
    return dict(zip((*normal, *rubbing), found.tolist(), strict=True))
