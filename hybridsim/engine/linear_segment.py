"""The closed form of one segment of linear modes, for the general mode loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.jets import UNIT
from hybridsim.engine.jit import kernel
from hybridsim.engine.linear_kernels import functions_of_time, moved, states_of, to_modal
from hybridsim.engine.linear_tables import tables_of
from hybridsim.engine.system import System

_NEAR = 3.0  # in units of the fastest rate: so far ahead is a guard a polynomial of low degree


@kernel
def _coordinates(lin: Any, x: Any, p: Any, factors: Any, w: Any, c: Any) -> None:
    """Modal coordinates at local time 0."""
    functions_of_time(lin, 0.0, 0.0, p, factors, w[0], w[1])
    to_modal(lin, 0, x, w[0], c)


@kernel
def _states(lin: Any, c: Any, s: Any, v: Any, out: Any) -> None:
    """States (k, n) at local times (k,)."""
    for j in range(s.shape[0]):
        moved(lin, 0, c, s[j], v)
        states_of(lin, 0, v, out[j])


class LinearSegment:
    """States x(s) of a segment that begins with x0 at local time 0 and ends at `bound` at the latest."""

    def __init__(self, system: System, x0: np.ndarray, p: np.ndarray, z: np.ndarray, bound: float) -> None:
        self.n = system.n
        self.tables, _ = tables_of(system, z[None, :], p, abs(bound))
        monomials, atoms = len(self.tables.factor_start) - 1, len(self.tables.kinds)
        self.c = np.zeros(self.tables.values.shape[1], dtype=complex)
        _coordinates(self.tables, x0, p, np.zeros((2 * atoms, 2)), np.zeros((2, monomials)), self.c)
        self.rates = np.abs(self.tables.values[0]) + np.abs(self.tables.upper[0]).sum(axis=1)

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """States (k, n) at local times (k,)."""
        out = np.empty((len(s), self.n))
        _states(self.tables, self.c, np.asarray(s, dtype=float), np.empty_like(self.c), out)
        return out

    def reach(self, s: float) -> float:
        """How far ahead of s the states are smooth: the fastest part that has not died away counts."""
        parts = np.abs(self.tables.basis[0]) * np.abs(self.c * np.exp(self.tables.values[0].real * s))
        alive = (parts > UNIT * parts.sum(axis=1, keepdims=True)).any(axis=0)
        fastest = max(self.rates[alive], default=0.0)
        return float(_NEAR / fastest) if fastest > 0.0 else np.inf
