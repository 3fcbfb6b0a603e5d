"""This module defines the interface of a fixed-step method: its kernels for one run."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np


class March(ABC):
    """The kernels of one fixed-step method for one run.

    step, halvings: length of a step, and how often it is halved to locate the zero of a guard or monitor.
    pinned: whether held states are evaluated from their constraints. has_sides_only: whether there is no
    third mode and the holding mode marks an exact zero. counts: evaluations of rates and of guards.
    """

    step: float
    halvings: int
    pinned: bool
    has_sides_only: bool
    counts: np.ndarray

    @abstractmethod
    def run(
        self,
        guard_numbers: np.ndarray,
        bound: float,
        p: np.ndarray,
        start: tuple[np.ndarray, np.ndarray],
        fresh: np.ndarray,
        rows: tuple[np.ndarray, np.ndarray, np.ndarray],
    ) -> tuple[int, int]:
        """Take steps from local time 0 up to the bound, or until an event needs the Python code.

        guard_numbers: guards of components without a surface. fresh: monitors that have just fired. Row k of rows =
        (times, states, modes) holds the start of step k and the modes during it; the last row is the end.
        Return (number of rows, reason).
        """

    @abstractmethod
    def trial(self, s: float, tau: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the state after one step of length `tau`."""

    def refused(self) -> str:
        """Return the message for a call that ended because a restitution is invalid."""
        return ""

    def warnings(self) -> list[str]:
        """Return the warnings of this method about the run."""
        return []
