"""Find surfaces that are zero within rounding although no event was located at the surfaces."""

from __future__ import annotations

import numpy as np

from hybridsim.engine.events.choice.event_verdicts import EventVerdicts
from hybridsim.engine.events.outcome import Change


def vanishing_surfaces(resolution: EventVerdicts, cluster: tuple[int, ...]) -> set[int]:
    """Return the components of a cluster whose surfaces are zero within rounding.

    No step crosses a surface that stays at zero because another component keeps its function constant, such as a relay
    on the speed of a contact that sticks. Its component leaves when the other component lets go.
    """
    system, at = resolution.system, resolution.at
    series = system.series(at.s, at.x, at.p, np.maximum(at.z, 0), at.x_error, at.s_error, at.is_put)
    near = np.abs(series.surfaces[:, 0]) <= series.surface_bounds[:, 0]
    return {c for k, c in enumerate(system.surface_of) if near[k]} & set(cluster)


def past_zero(resolution: EventVerdicts, cluster: tuple[int, ...]) -> set[int]:
    """Return the components of a cluster whose surfaces have changed sign without a located crossing.

    A step that is repeated to end at an event may end past a surface that it did not cross before, because of its
    error. That surface was crossed first.
    """
    system, at = resolution.system, resolution.at
    series = system.series(at.s, at.x, at.p, np.maximum(at.z, 0), at.x_error, at.s_error, at.is_put)
    found = set()
    for c, value in zip(system.surface_of, series.surfaces[:, 0], strict=True):
        automaton, mode = system.automata[c], at.z[c]
        if automaton.is_unilateral:
            continue  # a gap has no other side
        if value < 0.0 if mode == automaton.above else value > 0.0 and mode == automaton.below:
            found.add(c)
    return found & set(cluster)


def cross(resolution: EventVerdicts, components: set[int]) -> None:
    """Move components to the other side of their surfaces, before the located event is resolved."""
    at = resolution.at
    resolution.fired[:] = False
    for c in sorted(components):
        automaton, mode = resolution.system.automata[c], int(at.z[c])
        at.z[c] = automaton.below if mode == automaton.above else automaton.above
        name = automaton.guard_names[mode][0]
        resolution.changes.append(Change(c, name, mode, int(at.z[c]), at.x, at.x))
