"""This module continues derivatives along the segments of a run, between events."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.analysis.variations.smooth import transitions
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.series.dual_numbers import differentiated, values_and_slopes, with_slopes
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tangents import TangentTape


class FlowDerivatives:
    """Continues derivatives of the states along segments of a run.

    Parameters
    ----------
    scale : (n,) sizes of the states.
    vector : derivatives of the run-time vector.
    """

    def __init__(self, system: System, scale: np.ndarray, vector: VectorSlopes) -> None:
        module: Any = system.code.module
        self.system, self._scale, self._vector = system, scale, vector
        self._project = differentiated(module.project)

    def at_end(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, begin: float, end: float
    ) -> np.ndarray:
        """Return the derivatives (n, M) at one local time of a segment from those at an earlier one."""
        found: np.ndarray = self.over(segment, Y, Yd, G, begin, np.array([end]))[0]
        return found

    def over(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, begin: float, stops: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives (k, n, M) at ascending local times (k,), from those at an earlier one.

        Y (n, M), Yd (d, M): derivatives of the states and discrete states at the local time `begin`. G (P, M):
        derivatives of the parameters.
        """
        if stops[-1] <= begin or not self.system.n:
            return np.broadcast_to(Y, (len(stops), *Y.shape))
        tape = TangentTape(self.system, segment.z)
        directions = self._vector.seeds(segment.p)
        n = self.system.n
        constant = np.concatenate([Yd, G])
        moving = [k for k in range(len(constant)) if constant[k].any()]
        chosen = [*range(n), *(n + 1 + k for k in moving)]

        def slopes(s: np.ndarray) -> np.ndarray:
            return tape(s, segment.dense(s), segment.p, directions[:, chosen]).slopes

        values = np.abs(np.concatenate([self.system.discrete(segment.p), segment.p[: len(G)]]))[moving]
        later = np.unique(np.concatenate([segment.s[segment.s < stops[-1]], stops]))
        knots = np.concatenate([[begin], later[later > begin]])
        found = transitions(slopes, knots, self._scale, np.where(values > 0.0, values, 1.0), stops)
        moved = found[:, :, :n] @ Y + found[:, :, n:] @ constant[moving]
        if not self.system.holds(segment.z):
            return moved
        return np.array(
            [self.projected(segment, one, Yd, G, s) for one, s in zip(moved, stops.tolist(), strict=True)]
        )

    def projected(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, s: float | None = None
    ) -> np.ndarray:
        """Return the derivatives with held states on their constraints, at a local time or at the start."""
        system = self.system
        if not system.holds(segment.z):
            return Y
        here = float(segment.s[0]) if s is None else s
        at = segment.x[0] if s is None else segment.dense(np.array([s]))[0]
        p = self._vector.lifted(segment.p, system.discrete(segment.p), Yd, G)
        out: list[Any] = [0.0] * system.n
        self._project(here, with_slopes(at, Y), p, segment.z, out)
        return values_and_slopes(out, Y.shape[1])[1]
