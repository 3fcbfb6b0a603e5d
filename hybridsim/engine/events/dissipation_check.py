"""Reject contacts whose force acts along their relative velocity, which is usually a sign error."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System
from hybridsim.errors import ModelError

_MAX_ACCEPTED_STARTS = 64  # accepted starts that are remembered for each structure


_accepted = per_structure(lambda system: set[tuple[Any, ...]]())


def _what_effects_read(
    system: System, t0: float, x: np.ndarray, discrete: np.ndarray, z: np.ndarray
) -> tuple[Any, ...]:
    """Return all numbers that determine the effects of contact forces on the relative velocities."""
    values = tuple(system.values.values())
    if system.effects_read is not None:
        return tuple([values[i] for i in system.effects_read])
    return (*values, t0, x.tobytes(), discrete.tobytes(), z.tobytes())


def require_dissipation(
    system: System, t0: float, x: np.ndarray, discrete: np.ndarray, z: np.ndarray
) -> None:
    """Raise ModelError for a contact whose force acts along its relative velocity."""
    accepted, key = _accepted(system), _what_effects_read(system, t0, x, discrete, z)
    if key in accepted:
        return
    try:
        effects = system.effects(0.0, x, system.vector(Instant(t0), discrete), np.maximum(z, 0))
    except (ZeroDivisionError, ValueError, OverflowError):
        return  # not a number at the start; the run itself reports where
    for c, effect in effects.items():
        automaton = system.automata[c]
        if automaton.is_unilateral:
            if effect <= 0.0:
                raise ModelError(
                    f"impact {automaton.name}: the force {automaton.name} closes the gap instead of opening it (the "
                    f"effect of the force on the second derivative of the gap is {effect:.6g}, but must be positive)",
                    place=system.model.all_components()[c].place,
                    remedy=f"reverse the sign of {automaton.name} in the rates, or the sign of the gap",
                )
        elif effect >= 0.0 and not system.automata[c].is_unique:
            name = system.automata[c].name
            place = system.model.all_components()[c].place
            raise ModelError(
                f"contact {name}: the force {name} acts along the relative velocity, not against it (the effect of "
                f"the force on the relative acceleration is {effect:.6g}, but must be negative)",
                place=place,
                remedy=f"write '- {name}' in the derivative of the velocity, or reverse the sign of the velocity",
            )
    if len(accepted) >= _MAX_ACCEPTED_STARTS:
        accepted.clear()
    accepted.add(key)
