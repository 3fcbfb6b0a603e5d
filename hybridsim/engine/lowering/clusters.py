"""This module groups contacts that act on each other, and finds loads from normal forces."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.engine.lowering.program_names import declared_name
from hybridsim.errors import ModelError
from hybridsim.expr.simplify import simplified


def normal_loads(
    lowering: LoweringState, unknown: dict[int, Any], definitions: dict[Any, Any]
) -> dict[tuple[int, int], dict[str, Any]]:
    """Return the derivatives of slip forces with respect to normal forces.

    A normal force that only the contact's guards use has an entry without modes.
    """
    normal = {u: d for d, u in unknown.items() if lowering.components[d].surface.is_unilateral}
    found: dict[tuple[int, int], dict[str, Any]] = {}
    for c, component in enumerate(lowering.components):
        if c in normal.values() or not normal:
            continue
        for m in component.modes:
            values = {n: lowering.inline(lowering.convert(e), definitions) for n, e in m.set.items()}
            guards = [lowering.inline(lowering.convert(g.expr), definitions) for g in m.guards]
            used = {u for e in (*values.values(), *guards) for u in e.free_symbols} & normal.keys()
            for u in used:
                slopes = {n: simplified(lowering.sp.diff(e, u)) for n, e in values.items() if e.has(u)}
                own = unknown.get(c)
                if set(slopes) - {declared_name(own) if own is not None else None} or any(
                    e.free_symbols & set(unknown.values()) for e in slopes.values()
                ):
                    raise ModelError(
                        f"{component.name} may use the normal force {declared_name(u)} of an impact only as its "
                        "load, and its slip force and stick limits must be proportional to this load",
                        place=component.place,
                        remedy="use a friction law that is linear in its load; apart from the load, use "
                        f"{declared_name(u)} only in rates of states",
                    )
                if own is not None:
                    by_mode = found.setdefault((c, normal[u]), {})
                    if slopes:
                        by_mode[m.name] = slopes[declared_name(own)]
    return found


def clusters_of(
    order: list[int], effect: dict[tuple[int, int], Any], loads: Container[tuple[int, int]]
) -> list[list[int]]:
    """Group the components that affect each other's surfaces or loads."""

    def act(c: int, d: int) -> bool:
        return effect[c, d] != 0 or (c, d) in loads

    clusters: list[list[int]] = []
    for c in order:
        linked = [g for g in clusters if any(act(c, d) or act(d, c) for d in g)]
        clusters = [g for g in clusters if g not in linked] + [sorted([c, *(d for g in linked for d in g)])]
    return clusters
