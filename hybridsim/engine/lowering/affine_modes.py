"""Find the modes in which the flow of a lowered model is linear in its states."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.lowering.lowering_state import LoweringState, pattern_of


def affine_modes(
    lowering: LoweringState, der: list[Any], definitions: dict[Any, Any], surfaces: dict[int, Any]
) -> dict[str, tuple[bool, ...]]:
    """Return the modes in which the flow is linear in the states, including the solved unknowns."""
    free = set(lowering.states) | {
        lowering.symbols[n] for c in lowering.components for m in c.modes for n in m.set
    }
    free |= {lowering.symbols[c.surface.unknown] for c in lowering.components if c.surface}

    known: dict[Any, bool] = {}  # by pattern

    def affine(e: Any) -> bool:
        pattern, numbered = pattern_of(e, free)
        if pattern not in known:
            inner = {place for s, place in numbered.items() if s in free}
            slopes = (lowering.sp.diff(pattern, a) for a in sorted(inner, key=str))
            known[pattern] = all(not slope.free_symbols & inner for slope in slopes)
        return known[pattern]

    def linear(c: int, m: Any) -> bool:
        surface = lowering.components[c].surface
        if surface and m.name == surface.hold and not affine(surfaces[c]):
            return False
        return all(
            affine(lowering.inline(lowering.convert(e), definitions))
            for e in [*m.set.values(), *m.der.values()]
        )

    base = all(affine(lowering.inline(d, definitions)) for d in der)
    return {
        component.name: tuple(base and linear(c, m) for m in component.modes)
        for c, component in enumerate(lowering.components)
    } | {"": (base,)}
