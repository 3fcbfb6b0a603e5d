"""This module evaluates the derivatives of a run's states and quantities at any time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybridsim.analysis.variations.both_sides import OneSide, zero_text
from hybridsim.analysis.variations.carried import Carrier
from hybridsim.analysis.variations.directions import Directions
from hybridsim.analysis.variations.off_zero import rates_of
from hybridsim.analysis.variations.quantities import QuantityDerivatives
from hybridsim.analysis.variations.zeros.zero_function import StaysZero
from hybridsim.arguments import as_times
from hybridsim.engine.record.segments import Segment
from hybridsim.errors import UsageError, nearest
from hybridsim.presentation.readable import Readable
from hybridsim.solution import Solution

_SAME = (
    1e-9  # of their sizes: values and derivatives on the two sides of a zero that differ by less are equal
)
_ROUNDING = 1e-11  # of the size of a quantity, for a change of everything by its own size
_FRACTIONS = np.array([0.0, 0.11, 0.53, 0.89, 1.0])  # of a segment: times at which the two sides are compared


@dataclass(frozen=True)
class Derivatives(Readable):
    """Derivatives of m quantities of a run at fixed times, with respect to initial state and parameters.

    Parameters
    ----------
    names : tuple of str
        Names of the quantities.
    by_start : array
        (m, n + d) derivatives with respect to the states and discrete states at the start, or
        (k, m, n + d) for k times.
    by_parameter : array
        (m, P) derivatives with respect to the chosen parameters, or (k, m, P) for k times.
    """

    names: tuple[str, ...]
    by_start: np.ndarray
    by_parameter: np.ndarray

    def __repr__(self) -> str:
        shapes = f"by_start {self.by_start.shape}, by_parameter {self.by_parameter.shape}"
        return f"Derivatives of {', '.join(self.names)}: {shapes}"


class OverTime:
    """Derivatives of one run at any time."""

    def __init__(self, solution: Solution, directions: Directions, sides: type[OneSide]) -> None:
        self._made_of = solution, directions, sides
        self.solution, self._sides = solution, sides(Carrier(solution, directions.tables), directions)
        self._quantities = QuantityDerivatives(solution, directions)
        self._known = (*solution.names, *solution.quantities)
        self._starts = len(directions.x) + len(directions.discrete)
        self.width = directions.parameters.shape[1]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the run without its derivatives, which are computed again on loading."""
        return OverTime, self._made_of

    def at(self, t: Any, names: Sequence[str], side: str) -> Derivatives:
        """Return the derivatives of some states or quantities at a time, or at several times."""
        self.require(names)
        found = self.along(as_times(t), names, side)
        if np.ndim(t) == 0:
            found = found[0]
        return Derivatives(tuple(names), found[..., : self._starts], found[..., self._starts :])

    def require(self, names: Sequence[str]) -> None:
        """Raise `UsageError` for a name that is not a state or quantity."""
        for name in names:
            if name not in self._known:
                raise UsageError(
                    f"model {self.solution.model.name} has no quantity {name!r}, but `names` contains it",
                    remedy=nearest(str(name), self._known, kind="quantities"),
                )

    def along(self, times: np.ndarray, names: Sequence[str], side: str) -> np.ndarray:
        """Return the derivatives (k, m, M) of states or quantities in all directions."""
        times, side = self.solution._within(times, side)
        index, s = self.solution._of_model.segment_at(times, side)
        found = np.empty((len(times), len(names), self.width))
        for number in np.unique(index).tolist():
            chosen = np.flatnonzero(index == number)
            chosen = chosen[np.argsort(s[chosen], kind="stable")]
            Y = self._sides.within(number, s[chosen], side == "+")
            found[chosen] = self._of(names, number, s[chosen], Y)
        return found

    def _of(
        self, names: Sequence[str], number: int, s: np.ndarray, Y: np.ndarray, shift: np.ndarray | None = None
    ) -> np.ndarray:
        """Return derivatives (k, m, M) of quantities; those that differ on the two sides of a zero are NaN."""
        segment = self.solution._segments[number]
        found = self._quantities.of(names, segment, s, Y, shift)
        for place, one in self._sides.stays_zero():
            if place == number:
                found = np.where(self._differs(names, segment, one, s, Y, found) & one.moves, np.nan, found)
        return found

    def _differs(
        self,
        names: Sequence[str],
        segment: Segment,
        one: StaysZero,
        s: np.ndarray,
        Y: np.ndarray,
        found: np.ndarray,
    ) -> np.ndarray:
        """Return whether quantities or their derivatives `found` (k, m, M) differ on the other side of a zero."""
        other, x = replace(segment, z=one.z), segment.dense(s)
        here, there = (
            np.array(self.solution._of_model.values_at(names, at, s, x)).T for at in (segment, other)
        )
        sizes = np.abs(here) + np.abs(there)
        least = _ROUNDING * sizes[:, :, None] / self._sides.own_sizes()
        beyond = self._quantities.of(names, other, s, Y)
        apart = np.abs(found - beyond) > _SAME * (np.abs(found) + np.abs(beyond)) + least
        return np.asarray(apart | (np.abs(here - there) > _SAME * sizes)[:, :, None])

    def moving(
        self, name: str, number: int, s: float, is_after: bool, shift: np.ndarray | None
    ) -> np.ndarray:
        """Return the derivatives (M,) of a quantity at a point, whose time has the derivatives `shift` (M,)."""
        system, segment = self.solution._system, self.solution._segments[number]
        stops = np.array([s])
        Y = self._sides.within(number, stops, is_after)
        if shift is not None and shift.any():
            x = segment.dense(stops)[0]
            Y = Y.copy()
            Y[0, : system.n] += np.outer(rates_of(system, s, x, segment.p, segment.z), shift)
        found: np.ndarray = self._of((name,), number, stops, Y, shift)[0, 0]
        return found

    def shift(self, number: int) -> np.ndarray:
        """Return the derivatives (M,) of the time at which a segment starts, or zero after the last segment."""
        return self._sides.shift(number)

    def own_sizes(self) -> np.ndarray:
        """Return, for each direction, the smallest step that changes a state or constant by its own size."""
        return self._sides.own_sizes()

    def at_end(self) -> np.ndarray:
        """Return the derivatives (n + d, M) of the states and discrete states at the end of the run."""
        return self._sides.at_end()

    def of_times(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the times (E,) of the events, and their derivatives (E, M)."""
        return self._sides.of_times()

    def differing(self) -> list[tuple[str, np.ndarray]]:
        """List the functions at zero with different derivatives on both sides, each with a mask (M,) of directions."""
        found = dict(self._sides.differing())
        names = [output.name for output in self.solution.model.outputs]
        for number, one in self._sides.stays_zero() if names else ():
            segment = self.solution._segments[number]
            stops = segment.s[0] + _FRACTIONS * (segment.s[-1] - segment.s[0])
            Y = self._sides.within(number, stops, True)
            slopes = self._quantities.of(names, segment, stops, Y)
            differs = self._differs(names, segment, one, stops, Y, slopes).any(axis=(0, 1)) & one.moves
            if differs.any():
                found[zero_text(one)] = found.get(zero_text(one), False) | differs
        return list(found.items())
