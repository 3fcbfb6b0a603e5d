"""This module integrates the derivatives of the states along the segments of a run."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from hybridsim.analysis.variations.smooth import (
    Intervals,
    Steps,
    divided,
    over_intervals,
    stiff_transitions,
    transitions,
)
from hybridsim.analysis.variations.tapes import tangent_tape
from hybridsim.analysis.variations.values.no_derivative import no_derivative
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.series.dual_numbers import differentiated, values_and_slopes, with_slopes
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tangents import TangentTape
from hybridsim.solution import Solution

_ISOLATED = 1e-9  # of a segment: a derivative that is missing at one instant exists at this distance


class FlowDerivatives:
    """Continues derivatives of the states along segments of a run.

    Parameters
    ----------
    scale : (n,) sizes of the states.
    vector : derivatives of the run-time vector.
    """

    def __init__(self, solution: Solution, scale: np.ndarray, vector: VectorSlopes) -> None:
        self.system: System = solution._system
        module: Any = self.system.code.module
        self._of_run, self._scale, self._vector = solution._segments, scale, vector
        self._segments: list[Segment] = list(solution._segments)
        self._project = differentiated(module.project)
        self._moving: list[int] = []  # discrete states and parameters that change
        self._intervals: Intervals | None = None
        self._stiff: set[int] = set()

    def prepare(self, Yd: np.ndarray, G: np.ndarray) -> None:
        """Compute derivatives over all segments with respect to states, discrete states and changed parameters.

        Yd (d, M), G (P, M): derivatives of the discrete states and parameters.
        """
        d, n = len(Yd), self.system.n
        moving = [*range(d), *(d + k for k in range(len(G)) if G[k].any())]
        if not n or (self._intervals is not None and moving == self._moving):
            return
        self._moving = moving
        values = np.abs(np.concatenate([self.system.discrete_start, self._vector.constants()]))[moving]
        self._constants = np.where(values > 0.0, values, 1.0)
        chosen = [*range(n), *(n + 1 + k for k in moving)]
        self._seeds = [np.ascontiguousarray(self._vector.seeds(one.p)[:, chosen]) for one in self._segments]
        index, s, _ = self._of_run.knots()
        inside = np.flatnonzero((index[1:] == index[:-1]) & (s[1:] > s[:-1]))
        steps = Steps(index[inside], s[inside], s[inside + 1])
        self._stiff = set()
        if len(inside):
            steps, self._stiff = divided(self._slopes, steps, self.system.fastest)
        self._intervals = transitions(self._slopes, steps, self._scale, self._constants)

    def _slopes(self, number: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the derivatives (m, n, n + q) of the rates at m points, each in the segment that `number` gives."""
        x = self._of_run.states(number, s)
        first = np.flatnonzero(np.diff(number, prepend=-1))
        parts = []
        for begin, end in pairwise([*first.tolist(), len(number)]):
            one = int(number[begin])
            segment = self._segments[one]
            tape = tangent_tape(self.system, segment.z)
            found = tape(s[begin:end], x[begin:end], segment.p, self._seeds[one]).slopes
            for k in np.flatnonzero(~np.isfinite(found).all(axis=(1, 2))):
                found[k] = self._beside(one, tape, float(s[begin + k]))
            parts.append(found)
        n = self.system.n
        return np.concatenate(parts) if parts else np.zeros((0, n, n + len(self._moving)))

    def _beside(self, number: int, tape: TangentTape, s: float) -> np.ndarray:
        """Return derivatives (n, n + q) of the rates close to a local time at which the derivatives do not exist."""
        segment = self._segments[number]
        begin, end = float(segment.s[0]), float(segment.s[-1])
        near = np.array([s + _ISOLATED * (end - begin) * (1.0 if 2.0 * s < begin + end else -1.0)])
        found: np.ndarray = tape(near, segment.dense(near), segment.p, self._seeds[number]).slopes[0]
        bad = ~np.isfinite(found)
        if not bad.any():
            return found
        names = [self.system.names[i] for i in np.flatnonzero(bad.any(axis=1))]
        chosen = [*range(self.system.n), *(self.system.n + 1 + k for k in self._moving)]
        by = [self._vector.arguments[chosen[i]] for i in np.flatnonzero(bad.any(axis=0))]
        t, x = float(segment.origin.plus(s)), segment.dense(np.array([s]))[0]
        raise no_derivative(self.system, f"the rate of {' and '.join(names)}", by, t, x, names)

    def over(
        self, number: int, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, stops: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives (k, n, M) of the states at k local times of a segment.

        Y (n, M), Yd (d, M): derivatives of the states and discrete states. G (P, M): derivatives of the parameters.
        """
        n, segment = self.system.n, self._segments[number]
        if not n or stops[-1] <= segment.s[0]:
            return np.broadcast_to(Y, (len(stops), *Y.shape))
        found = self._stiffly(number, stops) if number in self._stiff else self._regularly(number, stops)
        moved = found[:, :, :n] @ Y + found[:, :, n:] @ np.concatenate([Yd, G])[self._moving]
        if not self.system.holds(segment.z):
            return moved
        return np.array(
            [self.projected(segment, one, Yd, G, s) for one, s in zip(moved, stops.tolist(), strict=True)]
        )

    def _regularly(self, number: int, stops: np.ndarray) -> np.ndarray:
        """Return d(states)/d(states at the start of the segment, constants) at local times, (k, n, n + q)."""
        assert self._intervals is not None
        first, last = np.searchsorted(self._intervals.number, [number, number + 1])
        n = self.system.n
        totals = [np.eye(n, n + len(self._moving))]
        for matrix in self._intervals.matrices[first:last]:
            total = matrix[:, :n] @ totals[-1]
            total[:, n:] += matrix[:, n:]
            totals.append(total)
        ends, begins = self._intervals.ends[first:last], self._intervals.begins[first:last]
        piece = np.searchsorted(ends, stops)  # the piece that ends at a stop or after it
        found = np.empty((len(stops), *totals[0].shape))
        is_inside = (piece < len(ends)) & (stops > begins[0])
        is_inside[is_inside] = stops[is_inside] < ends[piece[is_inside]]
        for k in np.flatnonzero(~is_inside).tolist():
            found[k] = totals[min(int(piece[k]) + 1, len(ends))] if stops[k] > begins[0] else totals[0]
        inside = np.flatnonzero(is_inside)
        if len(inside):
            here = piece[inside]
            steps = Steps(np.full(len(inside), number), begins[here], stops[inside])
            matrices, _ = over_intervals(self._slopes, steps, self._scale, self._constants)
            before = np.array(totals)[here]
            found[inside] = matrices[:, :, :n] @ before
            found[inside, :, n:] += matrices[:, :, n:]
        return found

    def _stiffly(self, number: int, stops: np.ndarray) -> np.ndarray:
        """Return derivatives over a segment in which small changes decay within a step."""
        segment = self._segments[number]
        begin = float(segment.s[0])
        later = np.unique(np.concatenate([segment.s[segment.s < stops[-1]], stops]))
        knots = np.concatenate([[begin], later[later > begin]])

        def slopes(s: np.ndarray) -> np.ndarray:
            return self._slopes(np.full(len(s), number), s)

        return stiff_transitions(slopes, knots, self._scale, self._constants, stops)

    def projected(
        self, segment: Segment, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, s: float | None = None
    ) -> np.ndarray:
        """Return the derivatives after correction by the constraints that determine held states."""
        system = self.system
        if not system.holds(segment.z):
            return Y
        here = float(segment.s[0]) if s is None else s
        at = segment.x[0] if s is None else segment.dense(np.array([s]))[0]
        p = self._vector.lifted(segment.p, system.discrete(segment.p), Yd, G)
        out: list[Any] = [0.0] * system.n
        self._project(here, with_slopes(at, Y), p, segment.z, out)
        return values_and_slopes(out, Y.shape[1])[1]
