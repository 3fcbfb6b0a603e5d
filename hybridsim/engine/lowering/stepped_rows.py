"""This module writes the function of a generated module for time stepping with impacts.

For m surfaces in the order of the module and n states the output contains, one after the other: u_k (m,), the
rate of a gap or a relative velocity; d(u_k)/dx (m, n); d(rates)/d(unknown_k) (m, n); and the growth of
friction force k per unit of normal force d. The last are (m, m) each for slip above, slip below, and the
upper and lower limit of stick.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hybridsim.engine.lowering.lower import Lowering


def stepped(lowering: Lowering) -> list[tuple[str, Any]]:
    """Return the text of the function ``stepped``, or nothing without unilateral contacts."""
    if not any(lowering.components[c].surface.is_unilateral for c in lowering.unknown):
        return []
    return [(f"out[{i}]", value) for i, value in enumerate(_values(lowering))]


def _values(lowering: Lowering) -> Iterator[Any]:
    sp = lowering.sp
    yield from lowering.held_rates.values()
    for rate in lowering.held_rates.values():
        yield from (sp.diff(rate, x) for x in lowering.states)
    for u in lowering.unknown.values():
        yield from (sp.diff(rate, u) for rate in lowering.open_rates)
    for bound in range(4):
        for c in lowering.unknown:
            force = _bound(lowering, c, bound)
            for d, u in lowering.unknown.items():
                is_load = c != d and lowering.components[d].surface.is_unilateral
                yield sp.diff(force, u) if is_load else sp.Integer(0)


def _bound(lowering: Lowering, c: int, bound: int) -> Any:
    """Return a friction force or a stick limit as a function of the normal forces.

    A guard of stick is the distance to its limit: without the force itself it is the limit.
    """
    component = lowering.components[c]
    surface = component.surface
    if surface.unique or surface.is_unilateral:
        return lowering.sp.Integer(0)
    if bound < 2:
        mode = component.mode(surface.below if bound else surface.above)
        return lowering.inlined(mode.set[surface.unknown])
    distance = lowering.inlined(component.mode(surface.hold).guards[bound - 2].expr)
    return distance if bound == 2 else -distance
