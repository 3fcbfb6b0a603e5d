"""This module finds friction along a gap: contacts whose velocity is proportional to the gap's rate.

An example is a sliding block that meets a stop. Both contacts would then hold one velocity. If both
velocities are zero together (the rate of the gap is a*v), the share of the friction in a push is not
determined. Here the stop takes the whole push while both hold, and a pull acts against the friction: the gap
opens if the pull exceeds the limit of stick. The motion is the same for any other share. If the velocities
differ (a stop beside a belt), the two never hold together.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.engine.lowering.program import Assign, Item, Switch
from hybridsim.errors import ModelError
from hybridsim.expr.simplify import simplified


class StopCoupling(NamedTuple):
    """The numbers of two components: a gap, and a friction contact whose velocity is proportional to the gap's rate."""

    gap: int
    along: int
    factor: Any  # rate of the gap over the relative velocity; a number, not zero
    is_one: bool  # the rate of the gap is zero when the contact sticks


def stop_couplings(
    lowering: LoweringState, surfaces: dict[int, Any], gap_rates: dict[int, Any]
) -> list[StopCoupling]:
    """Return all pairs of a gap and a contact whose velocity is proportional to the rate of the gap."""
    sp, found = lowering.sp, []
    for p, rate in gap_rates.items():
        for c, velocity in surfaces.items():
            surface = lowering.components[c].surface
            if c == p or surface.is_unilateral or surface.unique:
                continue
            of_rate = {i: slope for i, slope in lowering.gradient(rate).items() if slope != 0}
            of_velocity = {i: slope for i, slope in lowering.gradient(velocity).items() if slope != 0}
            if not of_rate.keys() <= of_velocity.keys():
                continue
            factors = {simplified(of_rate.get(i, sp.Integer(0)) / b) for i, b in of_velocity.items()}
            if len(factors) != 1:
                continue
            (factor,) = factors
            if factor.is_Number and factor != 0:
                apart = simplified(rate - factor * velocity)
                found.append(StopCoupling(p, c, factor, apart == 0))
    return found


def without_share(
    lowering: LoweringState, pairs: list[StopCoupling], c: int, d: int, entry: Any, of_held: Any
) -> tuple[list[Item], Any]:
    """Return a coefficient of contact `c`: `of_held` while the gap of a coupled stop is closed, otherwise `entry`."""
    items: list[Item] = []
    for tie in pairs:
        if tie.along == c:
            name = f"tied_{tie.gap}_{c}_{d}" if d >= 0 else f"tied_{tie.gap}_{c}_right"
            modes = lowering.components[tie.gap].modes
            hold = lowering.components[tie.gap].surface.hold
            branches = tuple((Assign(name, of_held if m.name == hold else entry),) for m in modes)
            items.append(Switch(tie.gap, branches))
            entry = lowering.sp.Symbol(name, real=True)
    return items, entry


def coupling_help(
    lowering: LoweringState, pairs: list[StopCoupling], p: int, effect: dict[tuple[int, int], Any]
) -> tuple[list[Item], Any]:
    """Return program items and the largest pull that sticking friction can take before the gap opens."""
    sp, total = lowering.sp, lowering.sp.Integer(0)
    items: list[Item] = []
    for tie in pairs:
        if tie.gap != p or not tie.is_one:
            continue
        component, unknown = lowering.components[tie.along], lowering.unknown[tie.along]
        held = component.mode(component.surface.hold)
        guard = held.guards[0 if tie.factor > 0 else 1]
        limit = lowering.inlined(guard.expr).subs(unknown, 0)
        if limit.free_symbols & set(lowering.unknown.values()):
            raise ModelError(
                f"the load of {component.name} depends on the normal force of an impact, and {component.name} acts "
                f"along the gap of {lowering.components[p].name}: this combination is not supported",
                place=component.place,
                remedy="use an hs.MechanicalSystem with moreau",
            )
        share = -sp.sign(tie.factor) * effect[p, tie.along] / effect[p, p]
        name = f"help_{p}_{tie.along}"
        values = tuple(
            (Assign(name, share * limit if m.name == held.name else sp.Integer(0)),) for m in component.modes
        )
        items.append(Switch(tie.along, values))
        total += sp.Symbol(name, real=True)
    return items, total


def reported_forces(lowering: LoweringState, pairs: list[StopCoupling]) -> dict[Any, Any]:
    """Return the forces to report, by name; the part of a stop force that pulls is reported as friction."""
    sp, found = lowering.sp, {}
    for tie in pairs:
        if tie.is_one:
            p, f = lowering.unknown[tie.gap], lowering.unknown[tie.along]
            share = lowering.effect[tie.gap, tie.gap] / lowering.effect[tie.gap, tie.along]
            found[p] = sp.Max(p, 0)
            found[f] = found.get(f, f) + share * sp.Min(p, 0)
    return found
