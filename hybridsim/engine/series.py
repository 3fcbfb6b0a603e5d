"""The Taylor series of one segment: the lean tape of its modes, its constants in place, ready to be expanded."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.stepping import Tolerances
from hybridsim.engine.system import System
from hybridsim.engine.taylor import advance, expand, reach

_SMALLEST_ORDER = 4
_TIGHTEST = 1e-15  # what a series in doubles can still be asked for


def series_order(rtol: float) -> int:
    """The order at which a Taylor method is cheapest: 1 - ln(rtol)/2 (Jorba and Zou 2005, section 3)."""
    return max(_SMALLEST_ORDER, math.ceil(1.0 - 0.5 * math.log(rtol)))


class SeriesRun:
    """Expands the flow of fixed modes and inputs at one point after another."""

    def __init__(self, system: System, p: np.ndarray, z: np.ndarray, tolerances: Tolerances) -> None:
        tape, self.lean = system.code.data["tape"], system.lean_tape(z)
        self.rtol, self.atol = max(tolerances.rtol, _TIGHTEST), tolerances.atol
        self.order = series_order(self.rtol)
        self.V = np.zeros((tape["registers"], self.order + 1))
        for register, value in tape["constants"]:
            self.V[register, 0] = value
        for register, source in tape["parameters"]:
            self.V[register, 0] = p[source]
        advance(self.lean.constant_rows, self.V, 0)
        self.states = np.array(tape["states"], dtype=np.int64)
        self.places = (tape["time"], self.states, self.lean.derivatives)
        self.watched = np.concatenate(
            [self.lean.guards[np.flatnonzero(system.active(z))], self.lean.monitors]
        )

    def expand(self, s: float, x: np.ndarray, longest: float) -> tuple[float, np.ndarray]:
        """How far the series from (s, x) reach, at most `longest`; coefficients of the states (n, order + 1)."""
        expand(self.lean.rows, self.places, self.order, s, x, self.V)
        h = reach(self.V, self.states, self.watched, self.order, self.rtol, self.atol, longest)
        return float(h), self.V[self.states]
