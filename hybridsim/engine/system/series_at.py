"""This module expands Taylor series at points of one segment, in fixed modes."""

from __future__ import annotations

import math

import numpy as np

from hybridsim.engine.native.constants import TIGHTEST
from hybridsim.engine.series.interpreter import SLACK, advance, expand, reach
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances

_SMALLEST_ORDER = 4
_SMOOTH = 1.5  # ratio of the order to the short order
# The same ratio for linear flows: p! rtol = 3**p holds at p = 16, 20, 24 for rtol = 1e-6, 1e-9, 1e-12.
_LINEAR = 1.6
_LITTLE = 2.0**-44  # step relative to the time so far that counts as none
# Terms larger than this, or smaller than its inverse, are dropped from a series whose first terms are of moderate size.
# They are multiplied by powers of the step, which must be doubles as well.
_LARGEST_TERM, _MODERATE = 1e250, 1e100


def short_order(rtol: float) -> int:
    """Return the cheapest order of Taylor series if convolutions dominate the cost: 1 - ln(rtol)/2.

    The number of convolutions grows with the square of the order (Jorba and Zou 2005, section 3).
    """
    return max(_SMALLEST_ORDER, math.ceil(1.0 - 0.5 * math.log(rtol)))


def series_order(rtol: float, linear: bool = False) -> int:
    """Return the order at which Taylor's method is cheapest.

    The other costs of a step (its length, guards, the check at its end) favour longer steps. Measurements give an order
    of 1.4 to 1.6 times the short one for rtol from 1e-6 to 1e-13. A linear flow has neither convolutions nor a radius
    of convergence. Its order is the one whose terms (w h)**p/p! decrease to rtol at w h = 3 for the fastest rate w; for
    larger w h the sum would cancel.
    """
    order = 1.0 - 0.5 * math.log(rtol)
    return max(_SMALLEST_ORDER, math.ceil((_LINEAR if linear else _SMOOTH) * order))


def registers_at(system: System, p: np.ndarray, z: np.ndarray, terms: int) -> np.ndarray:
    """Return registers (R, terms) of Taylor coefficients that hold the constants of a combination of modes."""
    inputs, V = system.registers.inputs, np.zeros((system.registers.count, terms))
    V[inputs.constants, 0] = inputs.values[:, 0]
    V[inputs.parameters, 0] = p[inputs.sources]
    advance(system.optimised_tape(z).constant_rows, V, 0)
    return V


class SeriesRun:
    """Expands the flow with fixed modes and inputs in Taylor series at successive points."""

    def __init__(self, system: System, p: np.ndarray, z: np.ndarray, tolerances: Tolerances) -> None:
        inputs, self.optimised = system.registers.inputs, system.optimised_tape(z)
        self.rtol, self.atol = max(tolerances.rtol, TIGHTEST), tolerances.atol
        self.high = np.array(system.high_rows(z), dtype=np.int64).reshape(-1, 5)
        self.order = series_order(self.rtol, system.is_linear)
        self.V = registers_at(system, p, z, self.order + 1)
        self.states = inputs.states
        self.flow_registers = (int(inputs.time[0]), self.states, self.optimised.derivatives)
        self.guards = self.optimised.guards[np.flatnonzero(system.active(z))]
        self.monitored_registers = np.concatenate([self.guards, self.optimised.monitors])

    def expand(self, s: float, x: np.ndarray, longest: float) -> tuple[float, np.ndarray]:
        """Return the accurate range of the Taylor series at (s, x), and the coefficients (n, order + 1) of the states.

        There are fewer terms if the unit of time is so far from the time scale of the motion that the rest would
        overflow.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # in dropped terms, or in a reach that is NaN
            expand(self.optimised.rows, self.high, self.flow_registers, self.order, s, x, self.V)
        order = self._representable()
        h = self._reach(self.monitored_registers, order, longest)
        if not h > min(_LITTLE * abs(s), longest):  # a pole of a monitor must not stop the run
            h = self._reach(self.guards, order, longest)
        return float(h), self.V[self.states, : order + 1]

    def _representable(self) -> int:
        """Return the order up to which Taylor coefficients do not overflow or underflow."""
        sizes = np.abs(self.V[self.states])
        if not len(sizes):
            return self.order
        began = sizes[:, :2].max(axis=1)
        lost = (sizes > _LARGEST_TERM) & (began <= _MODERATE)[:, None]
        lost |= (sizes > 0.0) & (sizes < 1.0 / _LARGEST_TERM) & (began >= 1.0 / _MODERATE)[:, None]
        lost[:, : _SMALLEST_ORDER + 1] = False
        far = np.flatnonzero(lost.any(axis=0))
        return int(far[0]) - 1 if len(far) else self.order

    def _reach(self, monitored_registers: np.ndarray, order: int, longest: float) -> float:
        V = self.V
        scratch = np.empty(order + 1), np.empty(len(monitored_registers))
        return reach(
            0, V, self.states, V, monitored_registers, order, self.rtol, self.atol, SLACK, longest, *scratch
        )
