"""This module writes functions of a generated module for impacts: impulses, gaps and restitutions.

For m surfaces in the order of the module and n states the output contains, one after the other: d(u_k)/dx (m,
n) with u_k the rate of a gap or a relative velocity; d(rates)/d(unknown_k) (m, n); and the growth of friction
force k per unit of load d at the onset of slip, forward and backward, (m, m) each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from hybridsim.engine.lowering.lower import Lowering
from hybridsim.expr.symbolic import to_sympy
from hybridsim.model.parts.impact import SPEED

Rows = list[tuple[str, Any]]
Force = Callable[[Lowering, Any, int], Any]


def speed_name(k: int) -> str:
    """Return the name of the approach speed at surface `k` in the generated program."""
    return f"speed_{k}"


def impulses(lowering: Lowering) -> Rows:
    """Return the code of the function ``impulses``, or no code if the model has no unilateral contacts."""
    if not _unilateral(lowering):
        return []
    return [(place, value) for place, value in numbered(slopes_and_growth(lowering, _onset, 2)) if value != 0]


def gap_slopes(lowering: Lowering) -> Rows:
    """Return the text of the function ``gap_slopes``, which computes d(gap)/dx for all gaps."""
    n = len(lowering.states)
    gaps = [(k, lowering.inlined(lowering.components[c].surface.function)) for k, c in _unilateral(lowering)]
    return [
        (f"out[{k * n + i}]", slope)
        for k, gap in gaps
        for i, slope in lowering.gradient(gap).items()
        if slope != 0
    ]


def restitutions(lowering: Lowering) -> Rows:
    """Return the text of the function ``restitutions``, which computes one value per impact."""
    rows = []
    for k, c in _unilateral(lowering):
        names = {**lowering.symbols, SPEED: lowering.sp.Symbol(speed_name(k), real=True)}
        rows.append((f"out[{k}]", to_sympy(lowering.components[c].surface.restitution, names)))
    return rows


def _unilateral(lowering: Lowering) -> list[tuple[int, int]]:
    """Return the surface number and the component number of each unilateral contact."""
    order = enumerate(lowering.held_rates)
    return [(k, c) for k, c in order if lowering.components[c].surface.is_unilateral]


def numbered(values: Iterable[Any]) -> Rows:
    """Return the lines of code that write values one after the other."""
    return [(f"out[{i}]", value) for i, value in enumerate(values)]


def slopes_and_growth(lowering: Lowering, force: Force, count: int) -> Iterator[Any]:
    """Yield derivatives that impacts need: of the unknowns, of the rates and of the friction forces.

    force : a friction force by component, surface and number, from 0 to `count`.
    """
    sp = lowering.sp
    for rate in lowering.held_rates.values():
        yield from (sp.diff(rate, x) for x in lowering.states)
    for u in lowering.unknown.values():
        yield from (sp.diff(rate, u) for rate in lowering.open_rates)
    for number in range(count):
        for c in lowering.unknown:
            component = lowering.components[c]
            is_chosen = not (component.surface.unique or component.surface.is_unilateral)
            found = force(lowering, component, number) if is_chosen else sp.Integer(0)
            for d, u in lowering.unknown.items():
                is_load = c != d and lowering.components[d].surface.is_unilateral
                yield sp.diff(found, u) if is_load else sp.Integer(0)


def _onset(lowering: Lowering, component: Any, number: int) -> Any:
    """Return the friction force at the onset of slip, forward and backward, as a function of the load."""
    surface = component.surface
    guards = component.mode(surface.hold).guards
    jump = lowering.inlined(surface.jump_below if number else surface.jump_above)
    return lowering.inlined(guards[number].expr) + (jump if number else -jump)
