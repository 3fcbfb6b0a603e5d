"""This module defines the dense output of fixed steps: cubic Hermite polynomials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybridsim.engine.system.system import System


@dataclass(frozen=True)
class StepDense:
    """Steps in one mode, with local times (m + 1,), states (m + 1, n) and cubic dense output."""

    system: System
    p: np.ndarray
    z: np.ndarray
    s: np.ndarray
    x: np.ndarray

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,)."""
        index = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        used, place = np.unique(index, return_inverse=True)
        left, right = self._slopes(used), self._slopes(used + 1)
        h = (self.s[index + 1] - self.s[index])[:, None]
        theta = (s - self.s[index])[:, None] / h
        x0, x1, d0, d1 = self.x[index], self.x[index + 1], left[place] * h, right[place] * h
        rest = 1.0 - theta
        # relative to x0, so that constant states stay constant bit for bit
        return x0 + (x1 - x0) * theta**2 * (3.0 - 2.0 * theta) + d0 * rest**2 * theta - d1 * theta**2 * rest

    def _slopes(self, rows: np.ndarray) -> np.ndarray:
        states = np.ascontiguousarray(self.x[rows])
        return self.system.rows("flow", self.system.n, self.s[rows], states, self.p, self.z)
