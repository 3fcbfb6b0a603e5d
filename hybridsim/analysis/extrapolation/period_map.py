"""This module defines the interface of a map over a forcing period, which `settling` follows."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np


class PeriodMap(Protocol):
    """A map from the states (n,) at the start of a period to the states at its end; the map also gives the modes."""

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
        """The mode changes of each component over the last period and its final modes, as bytes for comparison."""

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

    def slight_slip(self, periods: int, scale: np.ndarray, most: float) -> str:
        """Return a contact that slips slightly over the next periods, or ""; see `has_slight_slip`.

        The map must be restored afterwards.
        """
