"""This module says what a map from period to period has to offer so that `settling` can follow it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np


class PeriodMap(Protocol):
    """The map of the states (n,) at the beginning of a period to those at its end, with the modes in between."""

    period: float
    periods: int  # followed so far

    @property
    def x(self) -> np.ndarray:
        """The present states (n,)."""

    @property
    def modes(self) -> np.ndarray:
        """The present modes of all components."""

    @property
    def changes(self) -> bytes:
        """The changes of mode of each component over the last period, and the modes at its end, to be compared."""

    @property
    def slips(self) -> dict[tuple[int, int], int]:
        """How often each contact began to slip in each direction over the last period."""

    def snapshot(self) -> Any:
        """Return a copy of the states and modes, for `restore`."""

    def restore(self, snapshot: Any) -> None:
        """Return to earlier states and modes."""

    def put(self, x: np.ndarray) -> None:
        """Set the states (n,) and keep the modes."""

    def advance(self) -> Any:
        """Follow the motion for one period."""

    def measure(self) -> tuple[np.ndarray, bool]:
        """Follow the motion for one period, and return the scale (n,) of each state and whether nothing moves."""
