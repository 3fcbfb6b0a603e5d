"""This module defines directions of change at the start of a run, and derivatives in each direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hybridsim.analysis.variations.off_zero import OffZero
from hybridsim.analysis.variations.values.table_slopes import TableValue
from hybridsim.analysis.variations.zeros.zero_function import StaysZero


@dataclass(frozen=True)
class Directions:
    """M directions of change in the states, the discrete states and the parameters.

    x (n, M), discrete (d, M): the derivatives at the start of the run.
    parameters (P + V, M): those of the parameters, and of V values of tables.
    """

    x: np.ndarray
    discrete: np.ndarray
    parameters: np.ndarray
    tables: tuple[TableValue, ...] = ()

    def both_ways(self, chosen: np.ndarray) -> Directions:
        """Return some of the directions, followed by the opposite directions."""
        rows = self.x[:, chosen], self.discrete[:, chosen], self.parameters[:, chosen]
        x, discrete, parameters = (np.concatenate([row, -row], axis=1) for row in rows)
        return Directions(x, discrete, parameters, self.tables)


@dataclass(frozen=True)
class Carried:
    """Derivatives at the end of a run, and derivatives of the times of its events.

    x (n, M), discrete (d, M); times: each instant with an event, and its derivatives (M,);
    off: functions exactly at zero that some directions move off zero;
    lost: times (M,) from which on directions lead to another run, or infinity;
    starts: derivatives of states and discrete states at the start of each segment;
    shifts: derivatives (M,) of the time at which each segment starts, exactly zero if it does not move;
    stays_zero: functions that stay zero along a segment, each with the number of the segment.
    """

    x: np.ndarray
    discrete: np.ndarray
    times: list[tuple[float, np.ndarray]]
    off: list[OffZero]
    lost: np.ndarray
    starts: list[tuple[np.ndarray, np.ndarray]]
    shifts: list[np.ndarray]
    stays_zero: Sequence[tuple[int, StaysZero]] = ()
