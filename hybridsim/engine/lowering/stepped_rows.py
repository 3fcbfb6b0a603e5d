"""This module writes the function `stepped` of a generated module, which time stepping with impacts calls.

For m surfaces in the order of the module and n states the output contains, one after the other: u_k (m,), the
rate of a gap or a relative velocity; d(u_k)/dx (m, n); d(rates)/d(unknown_k) (m, n); and the growth of
friction force k per unit of normal force d. The last are (m, m) each for slip above, slip below, and the
upper and lower limit of stick.
"""

from __future__ import annotations

from typing import Any

from hybridsim.engine.lowering.impulse_rows import Rows, numbered, slopes_and_growth
from hybridsim.engine.lowering.lower import Lowering


def stepped(lowering: Lowering) -> Rows:
    """Return the code of the function ``stepped``, or no code if the model has no unilateral contacts."""
    if not any(lowering.components[c].surface.is_unilateral for c in lowering.unknown):
        return []
    slopes = slopes_and_growth(lowering, _bound, 4)
    return numbered([*lowering.held_rates.values(), *slopes])


def _bound(lowering: Lowering, component: Any, bound: int) -> Any:
    """Return a friction force or a stick limit as a function of the normal forces.

    A guard of stick is the distance to its limit: without the force itself it is the limit.
    """
    surface = component.surface
    if bound < 2:
        mode = component.mode(surface.below if bound else surface.above)
        return lowering.inlined(mode.set[surface.unknown])
    distance = lowering.inlined(component.mode(surface.hold).guards[bound - 2].expr)
    return distance if bound == 2 else -distance
