"""This module evaluates the derivatives of a run's states and quantities at any time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybridsim.analysis.variations.both_sides import OneSide
from hybridsim.analysis.variations.carried import Carrier
from hybridsim.analysis.variations.directions import Directions
from hybridsim.analysis.variations.off_zero import rates_of
from hybridsim.analysis.variations.quantities import QuantityDerivatives
from hybridsim.arguments import as_times
from hybridsim.errors import UsageError, nearest
from hybridsim.presentation.readable import Readable
from hybridsim.solution import Solution


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
            found[chosen] = self._quantities.of(names, self.solution._segments[number], s[chosen], Y)
        return found

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
        found: np.ndarray = self._quantities.of((name,), segment, stops, Y, shift)[0, 0]
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
        return self._sides.differing()
