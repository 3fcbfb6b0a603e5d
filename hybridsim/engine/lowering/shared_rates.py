"""Rates that a relay gives while it slides along its surface: from the surface, not from the forces that keep it.

While s(x) = 0 is kept, the one rate that the relay acts on follows from the others, f_k = -(ds/dt + sum of g_i f_i over
i != k)/g_k with g the slopes of s. Added up from forces it would be as wrong as these are rounded: a speed that dies
out along x + v = 0 would be noise of either sign in the end, and friction would see it turn around without end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from hybridsim.errors import ModelError

if TYPE_CHECKING:
    from hybridsim.engine.lowering.held_states import HeldStates
    from hybridsim.engine.lowering.lower import Lowering


def kept_rates(lowering: Lowering, i: int, der: list[Any], held: HeldStates) -> Iterator[tuple[int, Any]]:
    """The relays that give the rate of a state while they slide, each with the rate.

    Of those whose state is evaluated from their surface, another than this one; which act on this rate alone of all
    that the rate of the surface has; and whose slope along this state no state changes.
    """
    sp, x = lowering.sp, lowering.states[i]
    for c, unknown in lowering.unknown.items():
        is_pinned = held.pins.get((c, 0), i) != i
        if not (is_pinned and lowering.components[c].surface.unique) or c in lowering.partners:
            continue
        s = held.surfaces[c, 0]
        slopes = {k: sp.diff(s, y) for k, y in enumerate(lowering.states) if y in s.free_symbols}
        moved = [k for k in slopes if unknown in lowering.open_rates[k].free_symbols]
        if moved == [i] and not slopes[i].free_symbols & set(lowering.states):
            rest = sp.diff(s, lowering.s) + sp.diff(s, lowering.t)
            rest += sp.Add(*(slope * der[k] for k, slope in slopes.items() if k != i))
            yield c, -rest / sp.diff(s, x)


def refuse_changed_rates(lowering: Lowering, surfaces: dict[int, Any]) -> None:
    """Refuse modes that change a rate by which a surface moves: what holds it is solved for from the declared one."""
    for c, s in surfaces.items():
        for x, state in zip(lowering.states, lowering.model.states, strict=True):
            changing = [d for d in lowering.components if any(state.name in m.der for m in d.modes)]
            if changing and x in s.free_symbols:
                raise ModelError(
                    f"modes of {changing[0].name} change the derivative of {state.name}, and so the rate of the "
                    f"{lowering.title(c)} '{lowering.written(c)}' of {lowering.components[c].name}",
                    place=changing[0].place,
                    remedy=f'set a variable in the modes, set = {{ w = "..." }}, and use it in the derivative of '
                    f"{state.name}",
                )
