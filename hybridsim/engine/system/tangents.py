"""This module computes first derivatives of rates, guards, surfaces and monitors.

This is forward automatic differentiation of the tape (`hybridsim.engine.series.tangent_panel`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.series.optimise import live_rows
from hybridsim.engine.series.tangent_panel import panel, run_tangents
from hybridsim.engine.system.per_structure import spare_scratch
from hybridsim.engine.system.slopes_at_edge import slopes_at_edge
from hybridsim.engine.system.system import System

_run_tangents = Precompiled(run_tangents)


class Tangents(NamedTuple):
    """Values (m, W) and derivatives (m, W, D) of W functions of a mode; NaN where a derivative does not exist."""

    values: np.ndarray
    slopes: np.ndarray


class TangentTape:
    """The instruction tape of one combination of modes for rates and other functions with derivatives.

    Parameters
    ----------
    guards, monitors, surfaces : numbers of the functions that follow the rates of the n states.
    """

    def __init__(
        self,
        system: System,
        z: np.ndarray,
        guards: tuple[int, ...] = (),
        monitors: tuple[int, ...] = (),
        surfaces: tuple[int, ...] = (),
    ) -> None:
        tape = system.optimised_tape(z)
        self.outputs = np.concatenate(
            [
                tape.derivatives,
                tape.guards[list(guards)],
                tape.monitors[list(monitors)],
                tape.surfaces[list(surfaces)],
            ]
        ).astype(np.int64)
        self.rows = live_rows(np.concatenate([tape.constant_rows, tape.rows]), self.outputs)
        self._registers = system.registers
        self._system = system

    def is_same(self, other: TangentTape) -> bool:
        """Return whether another instruction tape computes the same quantities by the same operations."""
        return np.array_equal(self.rows, other.rows) and np.array_equal(self.outputs, other.outputs)

    def __call__(self, s: np.ndarray, x: np.ndarray, p: np.ndarray, seeds: np.ndarray) -> Tangents:
        """Evaluate values and derivatives at times (m,) and states (m, n), along the columns of `seeds`."""
        found, edges = self._along(s, x, p, seeds)
        for m in np.flatnonzero(edges):
            at = float(s[m]), np.array(x[m], dtype=float), p

            def displaced(ds: float, dx: np.ndarray, dp: np.ndarray, at: Any = at) -> np.ndarray:
                near, still = self._along(np.array([at[0] + ds]), (at[1] + dx)[None], at[2] + dp, seeds)
                slopes = near.slopes[0]
                return np.where(np.isfinite(slopes), slopes, np.nan) if still[0] else slopes

            found.slopes[m] = slopes_at_edge(displaced, *at, seeds)
        return found

    def _along(
        self, s: np.ndarray, x: np.ndarray, p: np.ndarray, seeds: np.ndarray
    ) -> tuple[Tangents, np.ndarray]:
        """Return values, derivatives, and a mask of points at which the derivatives may not exist."""
        count, outputs, directions = self._registers.count, len(self.outputs), seeds.shape[1]
        values, slopes = np.empty((len(s), outputs + 1)), np.empty((len(s), outputs, directions))
        spare = spare_scratch(self._system, f"panel of {directions} directions")
        scratch = spare.pop() if spare else panel(count, directions)
        _run_tangents(
            self.rows, self._registers.inputs, np.ascontiguousarray(seeds), self.outputs,
            np.ascontiguousarray(s, dtype=float), np.ascontiguousarray(x, dtype=float), p,
            scratch, values, slopes,
        )  # fmt: skip
        spare.append(scratch)
        return Tangents(values[:, :-1], slopes), values[:, -1] > 0.0
