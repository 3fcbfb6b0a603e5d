"""This module computes rates during sliding from the condition ds/dt = 0 instead of from forces.

While s(x) = 0 is held, the one rate on which the relay acts follows from the others, f_k = -(ds/dt + sum of
g_i f_i over i != k)/g_k with g the gradient of s. A sum of forces would carry their rounding errors: a
decaying speed along x + v = 0 would become noise of either sign in the end, and friction would detect endless
reversals.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hybridsim.engine.lowering.held_states import HeldStates
from hybridsim.engine.lowering.lowering_state import LoweringState
from hybridsim.errors import ModelError


def shared_rates(
    lowering: LoweringState, i: int, der: list[Any], held: HeldStates
) -> Iterator[tuple[int, Any]]:
    """Yield each relay that determines the rate of state `i` while it slides, together with this rate.

    The relay's held state must be evaluated from its surface and must be another state. Of the rates in ds/dt
    the relay must act only on this one, and the derivative of s by this state must not depend on states.
    """
    sp, x = lowering.sp, lowering.states[i]
    for c, unknown in lowering.unknown.items():
        is_pinned = held.pins.get((c, 0), i) != i
        if not (is_pinned and lowering.components[c].surface.unique) or c in lowering.partners:
            continue
        s = held.surfaces[c, 0]
        slopes = lowering.gradient(s)
        moved = [k for k in slopes if unknown in lowering.open_rates[k].free_symbols]
        if moved == [i] and not slopes[i].free_symbols & set(lowering.states):
            rest = sp.diff(s, lowering.s) + sp.diff(s, lowering.t)
            rest += sp.Add(*(slope * der[k] for k, slope in slopes.items() if k != i))
            yield c, -rest / sp.diff(s, x)


def refuse_changed_rates(lowering: LoweringState, surfaces: dict[int, Any]) -> None:
    """Reject modes that change the rate of a state that a surface reads: the holding force would be wrong."""
    changing: dict[str, Any] = {}  # name of a state -> first component that changes its rate
    for component in lowering.components:
        for mode in component.modes:
            changing = dict.fromkeys(mode.der, component) | changing
    for c, s in surfaces.items():
        for i in lowering.gradient(s):
            state = lowering.model.states[i]
            if state.name in changing:
                raise ModelError(
                    f"the rate of the {lowering.title(c)} '{lowering.written(c)}' of {lowering.components[c].name} "
                    f"depends on {state.name}, but modes of {changing[state.name].name} change the derivative of "
                    f"{state.name}",
                    place=changing[state.name].place,
                    remedy=f'set a variable in the modes, set = {{ w = "..." }}, and use it in the derivative of '
                    f"{state.name}",
                )
