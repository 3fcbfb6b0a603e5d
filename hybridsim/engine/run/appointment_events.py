"""Decide whether located guards fire, from the motion just after an input jump or a schedule at the same time.

A guard fires only if it is negative just after. A zero located by the motion before may turn back or stay at zero, such
as a load that touches zero.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hybridsim.engine.events.choice.verdict import side_after, side_before
from hybridsim.engine.events.corner_sides import take_corners
from hybridsim.engine.events.resolve import EventResolution
from hybridsim.engine.run.located import Located
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.system import System


def events_before_appointment(
    system: System, instant: Instant, found: Located, schedules: tuple[int, ...], forward: bool
) -> Located:
    """Remove from a located event the guards that do not fire after the input jump, or that wait for a schedule.

    Guards that do not become negative on the new pieces of inputs are dropped. The rest is resolved on these pieces,
    while conditions and resets read the inputs before a jump. A load at zero waits for schedules that are due.
    """
    if schedules:
        waiting = _ending_components(system, found)
        fired = {g: n for g, n in found.fired.items() if system.owner[g] not in waiting}
        found = replace(found, fired=fired, waiting=waiting)
    if not system.signals:
        return found
    discrete, error = system.discrete(found.at.p), math.ulp(float(instant))
    p, before = (system.vector(instant, discrete, side) for side in (forward, not forward))
    at = replace(found.at, s=0.0, p=p, s_error=max(found.at.s_error, error))
    resolution = EventResolution(system, replace(at, z=at.z.copy()), at.z.copy(), forward)
    resolution.fired[list(found.fired)] = True
    take_corners(resolution)
    series, side_of = resolution.series_of(resolution.at.z), side_after if forward else side_before
    is_open = ~system.active(resolution.at.z) | np.isin(
        system.owner, system.led
    )  # corners have been decided already
    fired = {
        g: place
        for g, place in found.fired.items()
        if is_open[g] or side_of(series.guards[g], series.guard_bounds[g], 0)[0] < 0
    }
    for k in np.flatnonzero(found.monitors.leads):
        if side_of(series.monitors[k], series.monitor_bounds[k], 0)[0] == found.monitors.before[k]:
            found.monitors.leads[k] = 0  # it turns back
    return replace(found, at=at, fired=fired, inputs=before)


def _ending_components(system: System, found: Located) -> frozenset[int]:
    """Return the components with a located guard whose transition would end the run."""
    modes = zip(system.automata, found.at.z.tolist())
    ends = [
        c
        for c, (automaton, mode) in enumerate(modes)
        if any(
            message and g in found.fired for g, message in zip(automaton.guards[mode], automaton.fatal[mode])
        )
    ]
    return frozenset(ends)
