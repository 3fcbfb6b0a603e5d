"""This module describes events of one instant: guards at zero, and effects of resets."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from hybridsim.engine.events.outcome import Change
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.record.segments import Occurrence, Segment
from hybridsim.engine.series.bounded import UNIT
from hybridsim.engine.system.system import System
from hybridsim.integrators.contract import Integrator

LOCATED = (
    1e6  # multiple of its rounding error; a located guard is closer to zero, a guard moved by a reset is not
)
_STEPS = 2.0  # in steps of a method that drives its own runs, because it assigns events to its steps
BY_RESET = (
    "reset"  # the guard name of a change that a reset made by moving the state to one side of a surface
)


def at_same_instant(occurrences: Sequence[Occurrence], k: int) -> list[Occurrence]:
    """Return the records of all events at the instant of the k-th event, in order."""
    first, last = k, k + 1
    while first > 0 and occurrences[first - 1].instant == occurrences[k].instant:
        first -= 1
    while last < len(occurrences) and occurrences[last].instant == occurrences[k].instant:
        last += 1
    return list(occurrences[first:last])


def fired_guards(
    system: System, segment: Segment, together: list[Occurrence], method: Integrator
) -> list[int]:
    """Return the numbers of the guards that reached zero at one instant, in the modes just before the instant.

    Guards that another event of this instant moved are left out: they are not at zero at the end of the
    segment.
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


def resets_before(resolution: EventResolution, change: Change) -> str:
    """Describe the resets that preceded a change at the same instant, with the values that they set."""
    system = resolution.system
    resets: dict[str, None] = {}
    for one in resolution.changes:
        if one is change:
            break
        automaton = system.automata[one.component]
        if automaton.has_surface or one.x_minus is change.x_minus:  # of the same round
            continue
        moved = changes_text(system.names, one.x_minus, one.x_plus)
        if moved:
            resets[f"the reset of guard {one.guard} of {automaton.name} ({moved})"] = None
    return " and ".join(resets)


def changes_text(
    names: Sequence[str],
    before: np.ndarray,
    after: np.ndarray,
    error: np.ndarray | float = 0.0,
    texts: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Describe each state that changed by more than its error, by its old and new values."""
    moved = np.abs(after - before) > 2.0 * error
    return ", ".join(
        f"{name} from {a:.6g} to {b:.6g}{texts.get(name, '')}"
        for name, a, b, has_moved in zip(names, before, after, moved, strict=True)
        if has_moved
    )
