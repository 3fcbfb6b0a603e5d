"""This module compares the derivatives on the two sides of a guard or surface that a run touches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybridsim.analysis.variations.carried import Carrier
from hybridsim.analysis.variations.directions import Carried, Directions
from hybridsim.analysis.variations.off_zero import OffZero
from hybridsim.analysis.variations.zeros.zero_function import StaysZero
from hybridsim.errors import UsageError

_AGREE = 1e-7  # of their sizes: derivatives on both sides that differ by less are equal
_ROUNDING = 1e-11  # of the states' sizes, for a change of everything by its own size


class OneSide:
    """Derivatives of a run. On a guard or surface, they are one-sided derivatives, on the side that the run takes."""

    def __init__(self, carrier: Carrier, directions: Directions) -> None:
        self._carrier, self._directions = carrier, directions
        self._carried = carrier.carry(directions)

    def at_end(self) -> np.ndarray:
        """Return the derivatives (n + d, M) of the states and discrete states at the end of the run."""
        return np.concatenate([self._carried.x, self._carried.discrete])

    def of_times(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the times (E,) of the events, and their derivatives (E, M)."""
        return _times(self._carried, self._directions.parameters.shape[1])

    def within(self, number: int, stops: np.ndarray, is_after: bool) -> np.ndarray:
        """Return the derivatives (k, n + d, M) at ascending local times (k,) of one segment.

        is_after : whether a time of an event means the state after it.
        """
        return self._carrier.between(self._carried, self._directions, number, stops)

    def shift(self, number: int) -> np.ndarray:
        """Return the derivatives (M,) of the time at which a segment starts, or zero after the last segment."""
        return _shift(self._carried, number)

    def own_sizes(self) -> np.ndarray:
        """Return, for each direction, the smallest step that changes a state or constant by its own size."""
        found: np.ndarray = self._carrier.own_sizes(self._directions)
        return found

    def stays_zero(self) -> Sequence[tuple[int, StaysZero]]:
        """Return the functions that stay zero along a segment, each with the number of the segment."""
        return ()

    def differing(self) -> list[tuple[str, np.ndarray]]:
        """Return the functions at zero whose two sides differ later, each with a mask (M,) of directions."""
        return [(zero_text(one), one.moves) for one in self._carried.off if one.parts]


class BothSides(OneSide):
    """Derivatives of a run; they are NaN if they differ on the two sides of a guard or surface that is exactly zero.

    Each direction that moves a function off its zero is carried forward and backward, on its own side.
    """

    def __init__(self, carrier: Carrier, directions: Directions) -> None:
        super().__init__(carrier, directions)
        off = self._carried.off
        width = directions.parameters.shape[1]
        moves = np.any([one.moves for one in off], axis=0) if off else np.zeros(width, dtype=bool)
        self._chosen = np.flatnonzero(moves)
        self._sides, self._both = directions.both_ways(self._chosen), None
        self._first = min((one.t for one in off), default=np.inf)
        if len(self._chosen):
            try:
                self._both = carrier.carry(self._sides, sided=True)
            except UsageError:  # one event on the side of the run is several events on the other side
                self._both = None

    def at_end(self) -> np.ndarray:
        end = super().at_end()
        if len(self._chosen):
            if self._both is None:
                end[:, self._chosen] = np.nan
            else:
                sides = np.concatenate([self._both.x, self._both.discrete])
                end[:, self._chosen] = self._agreeing_states(sides, self._lost(self._both) < np.inf)
        return end

    def of_times(self) -> tuple[np.ndarray, np.ndarray]:
        at, shifts = super().of_times()
        if not len(self._chosen):
            return at, shifts
        if self._both is None:
            shifts[:, self._chosen] = np.nan
            return at, shifts
        _, sides = _times(self._both, 2 * len(self._chosen))
        shifts[:, self._chosen] = self._agreeing_times(sides, at[:, None] > self._lost(self._both))
        return at, shifts

    def shift(self, number: int) -> np.ndarray:
        found = super().shift(number).copy()
        if len(self._chosen) and number < len(self._carrier.solution._segments):
            t = float(self._carrier.solution._segments[number].start)
            if self._both is None:
                found[self._chosen] = np.where(t > self._first, np.nan, found[self._chosen])
            else:
                sides = _shift(self._both, number)
                found[self._chosen] = self._agreeing_times(sides[None], t > self._lost(self._both))[0]
        return found

    def within(self, number: int, stops: np.ndarray, is_after: bool) -> np.ndarray:
        found = super().within(number, stops, is_after)
        if not len(self._chosen):
            return found
        found = found.copy()
        times = float(self._carrier.solution._segments[number].origin) + stops

        def passed(lost: np.ndarray | float) -> np.ndarray:
            return times[:, None] >= lost if is_after else times[:, None] > lost

        if self._both is None:
            found[:, :, self._chosen] = np.where(
                passed(self._first)[:, :, None], np.nan, found[:, :, self._chosen]
            )
            return found
        sides = self._carrier.between(self._both, self._sides, number, stops)
        for k, lost in enumerate(passed(self._lost(self._both))):
            found[k][:, self._chosen] = self._agreeing_states(sides[k], lost)
        return found

    def stays_zero(self) -> Sequence[tuple[int, StaysZero]]:
        return self._carried.stays_zero

    def differing(self) -> list[tuple[str, np.ndarray]]:
        differs = np.isnan(self.at_end()).any(axis=0) | np.isnan(self.of_times()[1]).any(axis=0)
        parted = [(zero_text(one), one.moves & differs) for one in self._carried.off]
        return [(name, mask) for name, mask in parted if mask.any()]

    def _lost(self, both: Carried) -> np.ndarray:
        count = len(self._chosen)
        return np.minimum(both.lost[:count], both.lost[count:])

    def _agreeing_states(self, sides: np.ndarray, lost: np.ndarray) -> np.ndarray:
        return self._agreeing(sides, _ROUNDING * self._carrier.sizes() / self.own_sizes()[self._chosen], lost)

    def _agreeing_times(self, sides: np.ndarray, lost: np.ndarray) -> np.ndarray:
        solution = self._carrier.solution
        least = _ROUNDING * (solution.t_end - solution.t_start) / self.own_sizes()[self._chosen]
        return self._agreeing(sides, least, lost)

    def _agreeing(self, sides: np.ndarray, least: np.ndarray, lost: np.ndarray) -> np.ndarray:
        """Return the derivatives that are equal in forward and backward directions, and NaN for all others."""
        count = len(self._chosen)
        one, other = sides[:, :count], -sides[:, count:]
        apart = np.abs(one - other) > _AGREE * (np.abs(one) + np.abs(other)) + least
        return np.where(apart | lost, np.nan, 0.5 * (one + other))


def zero_text(one: OffZero | StaysZero) -> str:
    """Return the description of a function at zero for warnings."""
    return f"at t = {one.t:.9g} {one.name} is exactly at its zero"


def _shift(carried: Carried, number: int) -> np.ndarray:
    moved = carried.shifts[number] if number < len(carried.shifts) else np.zeros_like(carried.shifts[0])
    return moved


def _times(carried: Carried, width: int) -> tuple[np.ndarray, np.ndarray]:
    at = np.array([t for t, _ in carried.times])
    return at, np.array([shift for _, shift in carried.times]).reshape(len(at), width)
