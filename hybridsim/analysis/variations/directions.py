"""What is changed at the start of a run, and what becomes of that by its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hybridsim.analysis.variations.off_zero import OffZero


@dataclass(frozen=True)
class Directions:
    """What is changed: M directions in the states, the discrete states and the parameters.

    x (n, M), discrete (d, M), parameters (P, M): the derivatives at the start of the run.
    """

    x: np.ndarray
    discrete: np.ndarray
    parameters: np.ndarray

    def both_ways(self, chosen: np.ndarray) -> Directions:
        """Some of them, and then the same backward."""
        rows = self.x[:, chosen], self.discrete[:, chosen], self.parameters[:, chosen]
        return Directions(*(np.concatenate([row, -row], axis=1) for row in rows))


@dataclass(frozen=True)
class Carried:
    """Derivatives at the end of a run, and of the time of each event on the way.

    x (n, M), discrete (d, M); times: of each instant at which something happened, with its derivatives (M,);
    off: what is exactly at its zero and is moved off it by some directions;
    lost: times (M,) from which on directions lead to another run, or infinity.
    """

    x: np.ndarray
    discrete: np.ndarray
    times: list[tuple[float, np.ndarray]]
    off: list[OffZero]
    lost: np.ndarray
