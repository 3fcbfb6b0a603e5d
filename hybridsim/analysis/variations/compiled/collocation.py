"""This module solves, in compiled code, the equations of Gauss collocation on many parts of a run.

The equations are those of `hybridsim.analysis.variations.smooth`. The eight nodes of a part are one panel of
`hybridsim.engine.series.tangent_panel`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import call_noinline, inlined, kernel
from hybridsim.engine.native.simd.vectors import WIDTH
from hybridsim.engine.series.tangent_panel import run_panel, set_numbers, set_points, slope_at


class FlowTapes(NamedTuple):
    """The instruction tapes of the rates in T combinations of modes."""

    rows: np.ndarray  # (rows, 5) operations of all tapes
    begins: np.ndarray  # (T + 1,) first row of each tape, and the number of rows
    outputs: np.ndarray  # (T, n) registers of the rates


class RunArrays(NamedTuple):
    """The arguments of the rates in N segments, and their derivatives with respect to states and q constants."""

    tape: np.ndarray  # (N,) number of the instruction tape
    vectors: np.ndarray  # (N, P) run-time vectors
    origins: np.ndarray  # (N,) origins of local time
    fixed: np.ndarray  # (n + 1 + P, n + q) derivatives of all arguments of the rates
    by_origin: np.ndarray  # (n + 1 + P, n + q) their derivatives by the origin
    own: np.ndarray  # (N, n + 1 + P, n + q) derivatives of the arguments in each segment, or (0, ...)
    scale: np.ndarray  # (n,) sizes of the states
    least: np.ndarray  # (q,) smallest effect of each constant that counts


class Rule(NamedTuple):
    """A collocation rule of eight nodes, see `hybridsim.analysis.variations.smooth.Collocation`."""

    A: np.ndarray
    b: np.ndarray
    tail: np.ndarray  # (k, 8) rows of the last Legendre coefficients


class FlowScratch(NamedTuple):
    """Scratch arrays of the collocation equations of one part of a segment."""

    panel: Any  # `hybridsim.engine.series.tangent_panel.Panel`
    seeds: np.ndarray  # (n + 1 + P, n + q)
    system: np.ndarray  # (8 n, 8 n + n + q) matrix and right-hand sides of the collocation equations
    square: np.ndarray  # (2, n, n)


@kernel
def begin_segment(run: Any, inputs: Any, work: Any, i: int) -> None:
    """Set the constants that the rates read in segment i, with their derivatives."""
    seeds = work.seeds
    for r in range(seeds.shape[0]):
        for j in range(seeds.shape[1]):
            if run.own.shape[0] > 0:
                seeds[r, j] = run.own[i, r, j]
            else:
                seeds[r, j] = run.fixed[r, j] + run.origins[i] * run.by_origin[r, j]
    set_numbers(work.panel, inputs, run.vectors[i], seeds)


@kernel
def _solve(M: Any) -> None:
    """Solve linear equations (m, m + k) in place in the last k columns."""
    m, width = M.shape
    for k in range(m):
        best = k
        for i in range(k + 1, m):
            if abs(M[i, k]) > abs(M[best, k]):
                best = i
        if best != k:
            for j in range(k, width):
                M[k, j], M[best, j] = M[best, j], M[k, j]
        inverse = 1.0 / M[k, k]
        for i in range(k + 1, m):
            factor = M[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, width):
                    M[i, j] -= factor * M[k, j]
    for k in range(m - 1, -1, -1):
        inverse = 1.0 / M[k, k]
        for j in range(m, width):
            M[k, j] *= inverse
        for i in range(k):
            factor = M[i, k]
            if factor != 0.0:
                for j in range(m, width):
                    M[i, j] -= factor * M[k, j]


@inlined
def _set_up(rule: Any, work: Any, outputs: Any, length: float) -> bool:
    """Write the collocation equations of a part; return whether all derivatives exist."""
    M, panel, n = work.system, work.panel, outputs.shape[0]
    width, total = work.seeds.shape[1], 0.0
    for i in range(WIDTH):
        if panel.edges[i] != 0:
            return False
        for a in range(n):
            row = i * n + a
            for b in range(width):
                slope = slope_at(panel, outputs[a], b, i)
                total += abs(slope)
                M[row, WIDTH * n + b] = slope
                if b < n:
                    for j in range(WIDTH):
                        M[row, j * n + b] = -length * rule.A[i, j] * slope
            M[row, row] += 1.0
    return math.isfinite(total)


@inlined
def _unresolved(rule: Any, run: Any, M: Any, length: float, moved: Any) -> float:
    """Write the derivatives over a part from the solved equations, and return a measure of their resolution."""
    n, width = moved.shape
    scale, tails, sizes, worst = run.scale, 0.0, 0.0, 0.0
    for b in range(width):
        tail, size = 0.0, 0.0
        for a in range(n):
            total = 0.0
            for i in range(WIDTH):
                total += rule.b[i] * M[i * n + a, WIDTH * n + b]
            moved[a, b] = length * total + (1.0 if a == b else 0.0)
            size = max(size, abs(moved[a, b]) / scale[a])
            for k in range(rule.tail.shape[0]):
                total = 0.0
                for i in range(WIDTH):
                    total += rule.tail[k, i] * M[i * n + a, WIDTH * n + b]
                tail = max(tail, abs(total) * length / scale[a])
        if b < n:  # the states by the states as one matrix without units
            tails, sizes = max(tails, tail * scale[b]), max(sizes, size * scale[b])
        else:
            worst = max(worst, tail / max(size, run.least[b - n]))
    return max(worst, tails / sizes)


@kernel
def over_parts(
    tapes: Any,
    inputs: Any,
    rule: Any,
    run: Any,
    work: Any,
    parts: Any,
    nodes: Any,
    matrices: Any,
    tails: Any,
) -> None:
    """Write the derivatives (K, n, n + q) over parts, and how well they are resolved; NaN means no derivative.

    parts: numbers of the segments (K,) and lengths (K,). nodes: local times (8 K,) and states (8 K, n).
    """
    numbers, lengths = parts
    s, x = nodes
    last = -1
    for k in range(numbers.shape[0]):
        i = numbers[k]
        if i != last:
            call_noinline(begin_segment, (run, inputs, work, i))
            last = i
        tape = run.tape[i]
        set_points(work.panel, inputs, s, x, WIDTH * k, WIDTH, work.seeds)
        rows = tapes.rows[tapes.begins[tape] : tapes.begins[tape + 1]]
        call_noinline(run_panel, (rows, work.panel, WIDTH))
        if not _set_up(rule, work, tapes.outputs[tape], lengths[k]):
            tails[k] = math.nan
            continue
        call_noinline(_solve, (work.system,))
        tails[k] = _unresolved(rule, run, work.system, lengths[k], matrices[k])


@kernel
def speeds_at(
    tapes: Any, inputs: Any, run: Any, work: Any, numbers: Any, s: Any, x: Any, speeds: Any
) -> None:
    """Write a bound of the eigenvalues of the rates' Jacobian at ascending points; zero where no Jacobian exists.

    It is the square root of a norm of the square of the matrix.
    """
    n, square, scale = run.scale.shape[0], work.square, run.scale
    last, k = -1, 0
    while k < numbers.shape[0]:
        i, count = numbers[k], 1
        while count < WIDTH and k + count < numbers.shape[0] and numbers[k + count] == i:
            count += 1
        if i != last:
            call_noinline(begin_segment, (run, inputs, work, i))
            last = i
        tape = run.tape[i]
        set_points(work.panel, inputs, s, x, k, count, work.seeds)
        rows = tapes.rows[tapes.begins[tape] : tapes.begins[tape + 1]]
        call_noinline(run_panel, (rows, work.panel, count))
        for m in range(count):
            for a in range(n):
                for b in range(n):
                    square[0, a, b] = slope_at(work.panel, tapes.outputs[tape, a], b, m) * scale[b] / scale[a]
            largest = 0.0
            for a in range(n):
                row = 0.0
                for b in range(n):
                    total = 0.0
                    for c in range(n):
                        total += square[0, a, c] * square[0, c, b]
                    row += abs(total)
                largest = max(largest, row)
            speeds[k + m] = math.sqrt(largest) if math.isfinite(largest) else 0.0
        k += count


@kernel
def accumulate(matrices: Any, totals: Any) -> None:
    """Write the derivatives (K + 1, n, n + q) from the start of a segment to the ends of its K parts."""
    n, width = totals.shape[1], totals.shape[2]
    for a in range(n):
        for b in range(width):
            totals[0, a, b] = 1.0 if a == b else 0.0
    for k in range(matrices.shape[0]):
        for a in range(n):
            for b in range(width):
                total = matrices[k, a, b] if b >= n else 0.0
                for c in range(n):
                    total += matrices[k, a, c] * totals[k, c, b]
                totals[k + 1, a, b] = total
