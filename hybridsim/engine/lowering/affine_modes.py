"""Find the modes in which the flow of a lowered model is linear in its states."""

from __future__ import annotations

from typing import Any

from sympy import Symbol

from hybridsim.engine.lowering.lowering_state import LoweringState


def affine_modes(
    lowering: LoweringState, der: list[Any], definitions: dict[Any, Any], surfaces: dict[int, Any]
) -> dict[str, tuple[bool, ...]]:
    """Return the modes in which the flow is linear in the states, including the solved unknowns."""
    free = set(lowering.states) | {
        lowering.symbols[n] for c in lowering.components for m in c.modes for n in m.set
    }
    free |= {lowering.symbols[c.surface.unknown] for c in lowering.components if c.surface}

    known: dict[Any, bool] = {}  # by the expression with numbered names, which copies of a part share

    def affine(e: Any) -> bool:
        names = sorted(e.free_symbols, key=str)
        moving, fixed = [s for s in names if s in free], [s for s in names if s not in free]
        numbered = {s: _numbered("moving", i) for i, s in enumerate(moving)}
        pattern = e.xreplace(numbered | {s: _numbered("fixed", i) for i, s in enumerate(fixed)})
        if pattern not in known:
            inner = dict.fromkeys(numbered.values())
            known[pattern] = all(not lowering.sp.diff(pattern, a).free_symbols & inner.keys() for a in inner)
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


def _numbered(kind: str, i: int) -> Any:
    """Return the symbol in place of a name."""
    return Symbol(f"{kind}_{i}", real=True)
