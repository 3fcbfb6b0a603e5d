"""This module integrates the derivatives of the states along the segments of a run."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from hybridsim.analysis.variations.compiled.collocation import accumulate
from hybridsim.analysis.variations.compiled.flow import CompiledFlow
from hybridsim.analysis.variations.smooth import (
    Intervals,
    Steps,
    are_slow,
    divided,
    in_parts,
    over_intervals,
    stiff_transitions,
    transitions,
)
from hybridsim.analysis.variations.tapes import tangent_tape
from hybridsim.analysis.variations.values.no_derivative import no_derivative
from hybridsim.analysis.variations.values.vector_slopes import VectorSlopes
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.record.segments import Segment
from hybridsim.engine.series.dual_numbers import differentiated, values_and_slopes, with_slopes
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tangents import TangentTape
from hybridsim.solution import Solution

_ISOLATED = 1e-9  # of a segment: a derivative that is missing at one instant exists at this distance
_accumulate = Precompiled(accumulate)


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
        self._segment = lru_cache(maxsize=None)(self._of_run.__getitem__)
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
        self._chosen = [*range(n), *(n + 1 + k for k in moving)]
        self._compiled = CompiledFlow(
            self.system, self._of_run, self._vector, moving, self._scale, self._constants
        )
        index, s, x = self._of_run.knots()
        inside = np.flatnonzero((index[1:] == index[:-1]) & (s[1:] > s[:-1]))
        steps = Steps(index[inside], s[inside], s[inside + 1])
        self._stiff = set()
        if len(inside):
            at_knots = self._compiled.speeds(index, s, x)
            speeds = np.maximum(at_knots[inside], at_knots[inside + 1])
            if are_slow(steps, speeds):
                steps = in_parts(steps, speeds, self.system.fastest)
            else:
                steps, self._stiff = divided(self._slopes, steps, self.system.fastest)
        self._intervals = transitions(self._over, steps)

    def regular(self) -> tuple[Intervals, list[int]] | None:
        """Return all parts of the run and the constants that change, or None if some segments are stiff."""
        return None if self._stiff or self._intervals is None else (self._intervals, self._moving)

    def _over(self, parts: Steps) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives (K, n, n + q) over parts of segments, and how well each is resolved."""
        found, tails = self._compiled.over(parts)
        bad = np.flatnonzero(np.isnan(tails))
        if len(bad):
            some = Steps(*(each[bad] for each in parts))
            found[bad], tails[bad] = over_intervals(self._slopes, some, self._scale, self._constants)
        return found, tails

    def _seeds(self, number: int) -> np.ndarray:
        """Return the derivatives of the rates' arguments in a segment by states and by the constants that change."""
        return np.ascontiguousarray(self._vector.seeds(self._segment(number).p)[:, self._chosen])

    def _slopes(self, number: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return the derivatives (m, n, n + q) of the rates at m points, each in the segment that `number` gives."""
        x = self._of_run.states(number, s)
        first = np.flatnonzero(np.diff(number, prepend=-1))
        parts = []
        for begin, end in pairwise([*first.tolist(), len(number)]):
            one = int(number[begin])
            segment = self._segment(one)
            tape = tangent_tape(self.system, segment.z)
            found = tape(s[begin:end], x[begin:end], segment.p, self._seeds(one)).slopes
            for k in np.flatnonzero(~np.isfinite(found).all(axis=(1, 2))):
                found[k] = self._beside(one, tape, float(s[begin + k]))
            parts.append(found)
        n = self.system.n
        return np.concatenate(parts) if parts else np.zeros((0, n, n + len(self._moving)))

    def _beside(self, number: int, tape: TangentTape, s: float) -> np.ndarray:
        """Return derivatives (n, n + q) of the rates just beside a local time at which they do not exist."""
        segment = self._segment(number)
        begin, end = float(segment.s[0]), float(segment.s[-1])
        near = np.array([s + _ISOLATED * (end - begin) * (1.0 if 2.0 * s < begin + end else -1.0)])
        found: np.ndarray = tape(near, segment.dense(near), segment.p, self._seeds(number)).slopes[0]
        bad = ~np.isfinite(found)
        if not bad.any():
            return found
        names = [self.system.names[i] for i in np.flatnonzero(bad.any(axis=1))]
        by = [self._vector.arguments[self._chosen[i]] for i in np.flatnonzero(bad.any(axis=0))]
        t, x = float(segment.origin.plus(s)), segment.dense(np.array([s]))[0]
        raise no_derivative(self.system, f"the rate of {' and '.join(names)}", by, t, x, names)

    def over(
        self, number: int, Y: np.ndarray, Yd: np.ndarray, G: np.ndarray, stops: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives (k, n, M) of the states at k local times of a segment.

        Y (n, M), Yd (d, M): derivatives of the states and discrete states. G (P, M): derivatives of the parameters.
        """
        n, segment = self.system.n, self._segment(number)
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
        totals = np.empty((last - first + 1, n, n + len(self._moving)))
        _accumulate(self._intervals.matrices[first:last], totals)
        ends, begins = self._intervals.ends[first:last], self._intervals.begins[first:last]
        piece = np.searchsorted(ends, stops)  # the piece that ends at a stop or after it
        found = np.empty((len(stops), *totals.shape[1:]))
        is_inside = (piece < len(ends)) & (stops > begins[0])
        is_inside[is_inside] = stops[is_inside] < ends[piece[is_inside]]
        reached = np.where(stops > begins[0], np.minimum(piece + 1, len(ends)), 0)
        found[~is_inside] = totals[reached[~is_inside]]
        inside = np.flatnonzero(is_inside)
        if len(inside):
            here = piece[inside]
            steps = Steps(np.full(len(inside), number), begins[here], stops[inside])
            matrices, _ = self._over(steps)
            before = totals[here]
            found[inside] = matrices[:, :, :n] @ before
            found[inside, :, n:] += matrices[:, :, n:]
        return found

    def _stiffly(self, number: int, stops: np.ndarray) -> np.ndarray:
        """Return derivatives over a segment in which small changes decay within a step."""
        segment = self._segment(number)
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
