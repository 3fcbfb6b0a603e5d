"""This module decides whether a run approaches a periodic orbit that was found from a state of the run.

Newton's method may converge to an orbit that the run never reaches. The run approaches the orbit if it repeats the
orbit's sequence of events while its distance from the orbit becomes small. `hybridsim.ensemble.approach` decides the
same in compiled code.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hybridsim.analysis.steady.motion import Motion, Point, point_at_end
from hybridsim.analysis.steady.settling import relative
from hybridsim.analysis.steady.shooting import Orbit, across, newton_step, rates_at_end
from hybridsim.analysis.variations.sensitivities import derivatives
from hybridsim.ensemble.nearness import CLOSE, LINEAR, MOST, NEARER
from hybridsim.errors import SimulationError
from hybridsim.solution import Solution

Word = tuple[tuple[str, ...], ...]


def is_approached(motion: Motion, last: Point, orbit: Orbit, scale: np.ndarray, section: int | None) -> bool:
    """Return whether the run that continues from a point approaches an orbit found by Newton's method.

    Parameters
    ----------
    scale : (n + d,) size of each state and discrete state.
    section : None if the period is known.
    """
    around = motion.run(orbit.start, orbit.period)
    rates = rates_at_end(around) if section is not None else np.zeros(0)
    word, point, length = _word(around), last, orbit.period
    points = [last.values]

    def step() -> float | None:
        nonlocal point, length
        try:
            solution = motion.run(point, length)
        except SimulationError:
            return None
        if _word(solution) != word:
            return None
        point = replace(point_at_end(solution), at=point.at)
        away, late = across(point.values - orbit.start.values, rates, scale)
        length = orbit.period - late
        points.append(point.values)
        return relative(away, scale)

    distances = followed(step, relative(last.values - orbit.start.values, scale))
    if not distances or is_near(distances):
        return bool(distances)
    motion.carry(around)
    before, after = points[-2:]
    move, _ = newton_step(derivatives(around, ()).by_start, after - before, scale, section, rates)
    left = across(before + move - orbit.start.values, rates, scale)[0]
    return relative(left, scale) <= LINEAR * distances[-1]


def followed(step: Callable[[], float | None], first: float) -> list[float]:
    """Return the distances of a run from an orbit at repeated periods, until they are near it.

    They are empty if a sequence of events is not that of the orbit.

    Parameters
    ----------
    step : follows the run for one period of the orbit; returns the distance, or None if the events differ.
    first : the distance at the start.
    """
    distances = [first]
    while len(distances) <= MOST and (len(distances) == 1 or not is_near(distances)):
        distance = step()
        if distance is None:
            return []
        distances.append(distance)
    return distances


def is_near(distances: list[float]) -> bool:
    """Return whether the last distance from an orbit is small, absolutely or relative to the first one."""
    return distances[-1] <= max(NEARER * distances[0], CLOSE)


def _word(solution: Solution) -> Word:
    """Return the sequence of events of a run, without their times."""
    events = (e for e in solution.events if e.kind != "near-grazing")
    return tuple((e.component, e.kind, e.source, e.target) for e in events)
