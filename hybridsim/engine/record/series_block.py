"""This module stores segments with Taylor series as dense output, as the compiled loop wrote them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import allocating_kernel, call, inlined, kernel
from hybridsim.engine.native.simd.vectors import WIDTH, load, splat, store
from hybridsim.engine.record.blocks import SegmentBlock
from hybridsim.engine.record.segments import Dense, PiecewiseDense
from hybridsim.engine.series.interpreter import polynomials
from hybridsim.engine.system.system import System


def _series_dense(coefficients: np.ndarray, start: float) -> Dense:
    """Return the states (k, n) at local times (k,) in a step, from its Taylor series."""

    def dense(s: np.ndarray) -> np.ndarray:
        out = np.empty((len(s), len(coefficients)))
        polynomials(coefficients, s - start, out)
        return out

    return dense


@inlined
def _step_at(steps: Any, first: int, last: int, s: float) -> int:
    """Return the number of the step that contains a local time of a segment."""
    while first < last:
        middle = (first + last + 1) // 2
        if steps[middle, 0] <= s:
            first = middle
        else:
            last = middle - 1
    return first


@allocating_kernel
def series_states(
    project: Any, pinned: bool, index: Any, s: Any, ends: Any, steps: Any, series: Any, record: Any, out: Any
) -> None:
    """Write the states at local times in the segments with the given numbers.

    Up to eight consecutive times in one step are evaluated together.
    """
    modes, vectors, jumps = record
    n, order = series.shape[1], series.shape[2] - 1
    since, x, one = np.empty(WIDTH), np.empty((n, WIDTH)), np.empty(n)
    k, total, i, step = 0, s.shape[0], -1, 0
    while k < total:
        if index[k] != i:
            i = index[k]
            step, last = ends[i], ends[i + 1] - 1
            end = steps[last, 0] + steps[last, 1]
        if s[k] >= end:
            for j in range(n):
                out[k, j] = jumps[i, 0, j]
            k += 1
            continue
        if step < last and steps[step + 1, 0] <= s[k]:
            step += 1
        if s[k] < steps[step, 0] or (step < last and steps[step + 1, 0] <= s[k]):
            step = _step_at(steps, ends[i], last, s[k])
        begin, until, count = steps[step, 0], end if step == last else steps[step + 1, 0], 1
        while count < WIDTH and k + count < total and index[k + count] == i and begin <= s[k + count] < until:
            count += 1
        for m in range(WIDTH):
            since[m] = s[k + min(m, count - 1)] - begin
        d = load(since, 0)
        for j in range(0, n, 2):  # two states at a time, so that the sums are independent
            other = min(j + 1, n - 1)
            value, beside = splat(series[step, j, order]), splat(series[step, other, order])
            for m in range(order - 1, -1, -1):
                value = value * d + splat(series[step, j, m])
                beside = beside * d + splat(series[step, other, m])
            store(x, other * WIDTH, beside)
            store(x, j * WIDTH, value)
        for m in range(count):
            if pinned:
                for j in range(n):
                    one[j] = x[j, m]
                call(project, s[k + m], one, vectors[i], modes[i], out[k + m])
            else:
                for j in range(n):
                    out[k + m, j] = x[j, m]
        k += count


@kernel
def _spans_of(ends: Any, steps: Any, spans: Any) -> None:
    """Write the first and the last local time of each segment."""
    for i in range(spans.shape[0]):
        last = ends[i + 1] - 1
        spans[i, 0], spans[i, 1] = steps[ends[i], 0], steps[last, 0] + steps[last, 1]


@dataclass(frozen=True)
class SeriesBlock(SegmentBlock):
    """Consecutive segments of several steps each, with Taylor series as dense output.

    Parameters
    ----------
    ends : (N + 1,), rows of the steps at which each segment begins, and the end of the last one.
    steps, series : (steps, 2) local time and length of each step; (steps, n, order + 1) coefficients.
    origins, modes, vectors : (N, 2), (N, C), (N, P) of each segment.
    jumps : (N, 2, n), x- and x+ at the end of each segment.
    """

    system: System
    ends: np.ndarray
    steps: np.ndarray
    series: np.ndarray
    origins: np.ndarray
    modes: np.ndarray
    vectors: np.ndarray
    jumps: np.ndarray

    @property
    def polynomials(self) -> np.ndarray:
        """Return the coefficients (steps, n, degree + 1) of the dense output of each step."""
        return self.series

    @cached_property
    def spans(self) -> np.ndarray:
        """Return the first and last local time of each segment (N, 2)."""
        spans = np.empty((len(self), 2))
        _spans_of(self.ends, self.steps, spans)
        return spans

    @property
    def last(self) -> np.ndarray:
        """Return the states just before the end of the last segment."""
        return self.jumps[-1, 0]

    def states(self, index: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,) in the segments with the given numbers."""
        out, pinned = np.empty((len(s), self.system.n)), self.system.can_hold
        project = self.system.address("project" if pinned else "flow")
        record = (self.modes, self.vectors, self.jumps)
        series_states(project, pinned, index, s, self.ends, self.steps, self.polynomials, record, out)
        return out

    def knots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return segment numbers, local times and states at the starts of steps and the ends of segments."""
        count = len(self)
        index = np.repeat(np.arange(count), np.diff(self.ends) + 1)
        s = np.empty(len(index))
        at_end = self.ends[1:] - self.ends[0] + np.arange(count)
        begins = np.ones(len(index), dtype=np.bool_)
        begins[at_end] = False
        s[begins], s[at_end] = self.steps[self.ends[0] : self.ends[-1], 0], self.spans[:, 1]
        return index, s, self.states(index, s)

    def since(self, first: int) -> SeriesBlock:
        """Return a block of the segments, starting with the segment of a given number."""
        return self._part(first, len(self))

    def _part(self, first: int, last: int) -> SeriesBlock:
        """Return a block of the segments in a range of numbers."""
        ends, rows = self.ends[first : last + 1], slice(self.ends[first], self.ends[last])
        part = (r[first:last] for r in (self.origins, self.modes, self.vectors, self.jumps))
        return type(self)(self.system, ends - ends[0], self.steps[rows], self.series[rows], *part)

    def motion(self, i: int) -> tuple[np.ndarray, np.ndarray, Dense]:
        """Return the step times, the states and the dense output of a segment."""
        one, (s, *_) = self._part(i, i + 1) if len(self) > 1 else self, self.steps_of(i)
        interpolants = [_series_dense(*step) for step in zip(one.polynomials, s.tolist(), strict=False)]
        return s, one.states(np.zeros(len(s), dtype=np.int64), s), PiecewiseDense(s, interpolants)

    def steps_of(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return step times (m + 1,), states at step starts (m, n), run-time vector and modes."""
        steps, first, last = self.steps, self.ends[i], self.ends[i + 1]
        s = np.append(steps[first:last, 0], steps[last - 1, 0] + steps[last - 1, 1])
        return s, self.series[first:last, :, 0], self.vectors[i], self.modes[i]
