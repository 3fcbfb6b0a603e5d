"""What happens at one instant: guards that were located at zero, and what resets then led to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from hybridsim.engine.jets import UNIT
from hybridsim.integrators.base import Integrator

if TYPE_CHECKING:
    from hybridsim.engine.outcome import Change
    from hybridsim.engine.pieces import Occurrence, Segment
    from hybridsim.engine.settle import Settling
    from hybridsim.engine.system import System

LOCATED = (
    1e6  # times its rounding: a guard that was searched for is closer to zero, what a reset moves is not
)
_STEPS = 2.0  # of a method that drives its own runs: it dates events to its steps
BY_RESET = "reset"  # the guard of a change to the side of a surface on which a reset has put the state


def fired_guards(
    system: System, segment: Segment, together: list[Occurrence], method: Integrator
) -> list[int]:
    """Numbers of the guards that came to zero at one instant, in the modes of the segment before.

    Not those that something else at this instant moved: where the segment ends they are not at zero.
    """
    named = set()
    for o in together:
        c = next((k for k, a in enumerate(system.automata) if a.name == o.component), -1)
        if c < 0 or not o.guard:
            continue
        automaton, mode = system.automata[c], int(segment.z[c])
        if o.source == automaton.modes[mode] and o.guard in automaton.guard_names[mode]:
            named.add(automaton.guards[mode][automaton.guard_names[mode].index(o.guard)])
    if not named or (len({o.component for o in together}) == 1 and not system.model.inputs):
        return sorted(named)
    s, x = float(segment.s[-1]), segment.x[-1]
    s_error = 2.0 * math.ulp(float(np.abs(segment.s).max()))
    if type(method).run is not Integrator.run:
        s_error += _STEPS * abs(float(segment.s[-1] - segment.s[-2]))
    slopes = np.abs(system.flow(s, x, segment.p, segment.z)) if system.n else np.zeros(0)
    x_error = 4.0 * UNIT * np.abs(segment.x).max(axis=0) + s_error * slopes
    series = system.series(s, x, segment.p, segment.z, x_error, s_error)
    return [g for g in sorted(named) if not abs(series.guards[g, 0]) > LOCATED * series.guard_bounds[g, 0]]


def resets_before(settling: Settling, change: Change) -> str:
    """The resets before a change at its instant, in words, with what they set; empty where there were none."""
    system = settling.system
    said: dict[str, None] = {}
    for one in settling.changes:
        if one is change:
            break
        automaton = system.automata[one.component]
        if automaton.has_surface or one.x_minus is change.x_minus:  # of the same round
            continue
        moved = changes_in_words(system.names, one.x_minus, one.x_plus)
        if moved:
            said[f"the reset of guard {one.guard} of {automaton.name} ({moved})"] = None
    return " and ".join(said)


def changes_in_words(
    names: Sequence[str],
    before: np.ndarray,
    after: np.ndarray,
    error: np.ndarray | float = 0.0,
    texts: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """States that changed by more than their error: name, from, to, and a text about it where there is one."""
    moved = np.abs(after - before) > 2.0 * error
    return ", ".join(
        f"{name} from {a:.6g} to {b:.6g}{texts.get(name, '')}"
        for name, a, b, has_moved in zip(names, before, after, moved, strict=True)
        if has_moved
    )
