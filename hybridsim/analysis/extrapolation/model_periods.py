"""This module defines the map over a forcing period of an ordinary model, which `settling` follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybridsim.analysis.extrapolation.settling import Settling
from hybridsim.analysis.steady.motion import Motion, Point, point_at_end
from hybridsim.analysis.steady.on_guard import slight_slip
from hybridsim.analysis.steady.settling import RESTS, Passings, forced_scale_of
from hybridsim.analysis.steady.shooting import Orbit
from hybridsim.analysis.variations.sizes import ranges
from hybridsim.engine.system.system_cache import system_of
from hybridsim.errors import SimulationError
from hybridsim.solution import Solution


class ModelPeriods:
    """The map of the states and discrete states (n + d,) of a model over one period of its forcing.

    Parameters
    ----------
    motion : runs of the model.
    point : the start, at a phase of the forcing without events.
    """

    def __init__(self, motion: Motion, point: Point, period: float) -> None:
        self.motion, self.point, self.period, self.periods = motion, point, period, 0
        self._last = np.zeros((0, 0), dtype=np.int64)  # modes of the segments of the last period

    @property
    def x(self) -> np.ndarray:
        """The present states (n + d,)."""
        return self.point.values

    @property
    def modes(self) -> np.ndarray:
        """The present modes of all components."""
        return self.point.numbers

    @property
    def changes(self) -> bytes:
        """The mode changes of each component over the last period and its final modes, as bytes for comparison."""
        return b"".join(_sequence(column).tobytes() + b"|" for column in self._last.T)

    @property
    def slips(self) -> dict[tuple[int, int], int]:
        """How often each contact began to slip in each direction over the last period."""
        system, found = system_of(self.motion.model), {}
        for c in system.surface_of:
            begun = _sequence(self._last[:, c])[1:].tolist()
            found.update({(c, m): begun.count(m) for m in set(begun) - {system.automata[c].hold}})
        return found

    def snapshot(self) -> Point:
        """Return the present point, for `restore`."""
        return self.point

    def restore(self, snapshot: Point) -> None:
        """Return to an earlier point."""
        self.point = snapshot

    def put(self, x: np.ndarray) -> None:
        """Set the states (n + d,) and keep the modes."""
        self.point = self.point.moved(x - self.point.values)

    def advance(self) -> Solution:
        """Follow the motion for one period, and return the run."""
        solution = self.motion.run(self.point, self.period)
        self.point = replace(point_at_end(solution), at=self.point.at)
        self._last = np.array(list(solution._segments.modes()))
        self.periods += 1
        return solution

    def measure(self) -> tuple[np.ndarray, bool]:
        """Follow the motion for one period, and return the scale (n + d,) of each state and whether nothing moves."""
        solution = self.advance()
        low, high = ranges(solution, solution.t_start)
        self.motion.sizes = np.maximum(np.abs(low), np.abs(high))
        scale = forced_scale_of(solution, solution.t_start)
        return scale, bool((high - low <= RESTS * self.motion.sizes).all())

    def slight_slip(self, periods: int, scale: np.ndarray, most: float) -> str:
        """Return a contact that slips slightly over the next periods, or ""; see `has_slight_slip`."""
        return slight_slip(self.motion.run(self.point, periods * self.period), scale, most)


def _sequence(modes: np.ndarray) -> np.ndarray:
    """Return the modes (K,) of a component without consecutive repetitions."""
    return modes[np.append(True, modes[1:] != modes[:-1])]


def extrapolated(motion: Motion, passings: Passings, period: float, tol: float, periods: int) -> Orbit | None:
    """Return the orbit on which a motion settles, or None if it does not settle within a number of periods.

    A contact that slips less from period to period approaches its place like 1/k. Newton's method cannot find such
    an orbit, because the derivative of the period map is singular there.
    """
    followed = ModelPeriods(motion, passings.last, period)
    try:
        found = Settling(followed, tol, 1, periods).run(None)
    except SimulationError:
        return None
    if found.multiple is None:
        return None
    multiple = found.multiple
    return Orbit(followed.point, multiple * period, multiple, found.passings.residual(multiple))
