"""This module carries derivatives through a run of ordinary events in compiled code.

At an ordinary event one guard fires, one component changes its mode, and no state jumps; see
`hybridsim.analysis.variations.carried` for the formula.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import call_noinline, inlined, kernel
from hybridsim.engine.native.simd.vectors import WIDTH
from hybridsim.engine.series.tangent_panel import run_panel, set_numbers, set_points, slope_at


class Points(NamedTuple):
    """Points of a run, at which functions are differentiated with respect to all their arguments."""

    s: np.ndarray  # (m,) local times
    x: np.ndarray  # (m, n) states
    vectors: np.ndarray  # (m, P) run-time vectors
    origins: np.ndarray  # (m,) origins of local time


class Passages(NamedTuple):
    """The linear maps of changes of n states and q constants through N segments and the events between them."""

    first: np.ndarray  # (N + 1,) number of the first part of each segment, and the number of parts
    matrices: np.ndarray  # (K, n, n + q) derivatives over the parts
    delays: np.ndarray  # (N, n + q) derivatives of the time of the event at the end of each segment
    jumps: np.ndarray  # (N, n) rates before the event minus rates after it
    holds: np.ndarray  # (N,) whether a component holds
    at_start: np.ndarray  # (N, n, n + q) derivatives of the held states on their constraints, at the start
    at_end: np.ndarray  # (N, n, n + q) the same at the end


@kernel
def gradients_at(
    rows: Any, inputs: Any, outputs: Any, points: Any, seeds: Any, panel: Any, values: Any, slopes: Any
) -> None:
    """Write values (m, W) and derivatives (m, W, D) of some registers; NaN where a derivative may not exist.

    seeds: derivatives (n + 1 + P, D) of the arguments at the origin 0, and their derivatives by the origin.
    """
    fixed, by_origin = seeds
    s, x, vectors, origins = points
    W, n = panel.registers, x.shape[1]
    for first in range(0, s.shape[0], WIDTH):
        count = min(WIDTH, s.shape[0] - first)
        set_numbers(panel, inputs, vectors[first], fixed)
        for i in range(inputs.parameters.shape[0]):
            r, source = inputs.parameters[i], inputs.sources[i]
            for m in range(WIDTH):
                k = first + min(m, count - 1)
                W[r, 0, m] = vectors[k, source]
            for j in range(fixed.shape[1]):
                by = by_origin[n + 1 + source, j]
                if by != 0.0:
                    panel.active[r] = 1
                    for m in range(WIDTH):
                        k = first + min(m, count - 1)
                        W[r, 1 + j, m] = fixed[n + 1 + source, j] + origins[k] * by
        set_points(panel, inputs, s, x, first, count, fixed)
        call_noinline(run_panel, (rows, panel, count))
        for m in range(count):
            for i in range(outputs.shape[0]):
                values[first + m, i] = W[outputs[i], 0, m]
                for j in range(fixed.shape[1]):
                    slope = slope_at(panel, outputs[i], j, m)
                    slopes[first + m, i, j] = np.nan if panel.edges[m] != 0 else slope


@inlined
def _apply(matrix: Any, Y: Any, C: Any, out: Any) -> None:
    """Write the derivatives (n, M) after a linear map (n, n + q) of the changes Y (n, M) and C (q, M)."""
    n = Y.shape[0]
    for a in range(n):
        for j in range(Y.shape[1]):
            out[a, j] = 0.0
        for c in range(matrix.shape[1]):
            factor = matrix[a, c]
            if factor != 0.0:
                for j in range(Y.shape[1]):
                    out[a, j] += factor * (Y[c, j] if c < n else C[c - n, j])


@kernel
def carry_ordinary(passages: Any, C: Any, starts: Any, shifts: Any, end: Any, other: Any) -> None:
    """Write derivatives of states at segment starts (N, n, M), start times (N, M), and states at the end (n, M).

    C (q, M): the changes of the constants. starts[0] is known. other (n, M): scratch.
    """
    n, width, N = end.shape[0], end.shape[1], starts.shape[0]
    for i in range(N):
        for a in range(n):
            for j in range(width):
                end[a, j] = starts[i, a, j]
        for k in range(passages.first[i], passages.first[i + 1]):
            _apply(passages.matrices[k], end, C, other)
            for a in range(n):
                for j in range(width):
                    end[a, j] = other[a, j]
        if passages.holds[i]:
            _apply(passages.at_end[i], end, C, other)
            for a in range(n):
                for j in range(width):
                    end[a, j] = other[a, j]
        if i + 1 == N:
            return
        for j in range(width):
            shift = 0.0
            for c in range(passages.delays.shape[1]):
                shift += passages.delays[i, c] * (end[c, j] if c < n else C[c - n, j])
            shifts[i + 1, j] = shift
            for a in range(n):
                other[a, j] = end[a, j] + passages.jumps[i, a] * shift
        if passages.holds[i + 1]:
            _apply(passages.at_start[i + 1], other, C, starts[i + 1])
        else:
            for a in range(n):
                for j in range(width):
                    starts[i + 1, a, j] = other[a, j]
