"""Guards of linear modes as Taylor series in states and in modal coordinates, with error bounds."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.native.simd.products import LANES
from hybridsim.engine.series.bounded import ORDER, UNIT

_FACTORIAL = float(math.factorial(BOUND_TERMS))
FARTHEST = 8.0  # in units of the fastest rate; a bound with this number of terms holds for less
_ROUNDINGS = 8.0  # roundings of a coefficient read from the tape, for a chain of this many operations


@kernel
def guard_series(A: Any, rows: Any, n: int, series: Any, roundings: Any, largest: Any) -> None:
    """Compute the Taylor coefficients of guards along y' = A y, the error bound of each entry, and the largest bound.

    rows (K, G, m) are functions of y. A (K, m, m). series, roundings (K, G, ORDER + 1, .) are zero; the entries behind
    the states begin at a multiple of four. largest (K, G, ORDER + 1).
    """
    modes, guards, size = rows.shape
    behind = -n % LANES
    for k in range(modes):
        for g in range(guards):
            row, own, errors = rows[k, g], series[k, g], roundings[k, g]
            for m in range(size):
                at = m if m < n else m + behind
                own[0, at], errors[0, at] = row[m], abs(row[m])
            for order in range(ORDER):
                for m in range(size):
                    total = bound = 0.0
                    for i in range(size):
                        at = i if i < n else i + behind
                        total += own[order, at] * A[k, i, m]
                        bound += errors[order, at] * abs(A[k, i, m])
                    at = m if m < n else m + behind
                    own[order + 1, at], errors[order + 1, at] = total / (order + 1), bound / (order + 1)
            for order in range(ORDER + 1):
                most, factor = 0.0, (size + (order + 1) * (_ROUNDINGS + size)) * UNIT
                for at in range(errors.shape[1]):
                    errors[order, at] *= factor
                    if errors[order, at] > most or errors[order, at] != errors[order, at]:
                        most = errors[order, at]
                largest[k, g, order] = most


@kernel
def modal_guards(
    rows: Any,
    flows: Any,
    gamma: Any,
    terms: Any,
    sizes: Any,
    rests: Any,
    farthest: Any,
    grown: Any,
    turning: Any,
    waves: Any,
) -> None:
    """Compute the Taylor series of guards in modal coordinates, their bounds, and their undamped oscillations.

    flows: `hybridsim.engine.linear.modal.Modals` with |B**BOUND_TERMS|; gamma (J,) is scratch space. The
    other arrays are described in `hybridsim.engine.linear.tables` and are zero.
    """
    counts, values, upper, ends, basis = flows.counts, flows.values, flows.upper, flows.ends, flows.full_basis
    modes, guards, size = rows.shape
    for k in range(modes):
        for g in range(guards):
            farthest[k, g], grown[k, g], waves[k, g] = math.inf, 1.0, -1
            is_zero = True
            for m in range(size):
                is_zero = is_zero and rows[k, g, m] == 0.0
            if is_zero:  # a guard of other modes
                continue
            for j in range(counts[k]):
                total = 0.0 + 0.0j
                for m in range(size):
                    total += rows[k, g, m] * basis[k, m, j]
                gamma[j] = total
            # a basis entry has a rounding error relative to the largest entry of its row, unless it is exactly zero
            known = 0.0
            for m in range(size):
                largest = 0.0
                for j in range(counts[k]):
                    largest = max(largest, abs(basis[k, m, j]))
                known += abs(rows[k, g, m]) * largest
            waves[k, g] = _wave(gamma, counts[k], values[k], upper[k])
            first = 0
            fastest = growing = 0.0
            while first < counts[k]:
                end, square = ends[k, first], 0.0
                # a guard may see another coordinate of the block later
                for j in range(first, end):
                    square += gamma[j].real ** 2 + gamma[j].imag ** 2
                for j in range(first, end):
                    sizes[k, g, j] = math.sqrt(square)
                    rests[k, g, j] = sizes[k, g, j] * flows.powers[k, j] / _FACTORIAL
                    if square > 0.0:
                        sizes[k, g, j] = max(sizes[k, g, j], known)
                    if rests[k, g, j] > 0.0:
                        fastest, growing = max(fastest, flows.speeds[k, j]), max(growing, flows.growth[k, j])
                        turning[k, g] = max(turning[k, g], growing, abs(values[k, j].imag))
                for order in range(BOUND_TERMS):
                    for j in range(first, end):
                        terms[k, g, j, 0, order], terms[k, g, j, 1, order] = gamma[j].real, gamma[j].imag
                    for j in range(end - 1, first - 1, -1):  # B is triangular
                        total = gamma[j] * values[k, j]
                        for i in range(first, j):
                            total += gamma[i] * upper[k, i, j]
                        gamma[j] = total / (order + 1)
                first = end
            if fastest > 0.0:
                farthest[k, g] = FARTHEST / fastest
            if growing > 0.0:
                farthest[k, g], grown[k, g] = min(farthest[k, g], math.log(2.0) / growing), 2.0


@kernel
def _wave(gamma: Any, count: int, values: Any, upper: Any) -> int:
    """Return the oscillating coordinate if a guard is a constant plus one undamped oscillation, else -1."""
    found = -1
    for j in range(count):
        if gamma[j] == 0.0:
            continue
        for i in range(count):
            if upper[j, i] != 0.0:  # a driven coordinate is not a wave
                return -1
        if values[j] != 0.0:
            if found >= 0:
                return -1
            found = j
    if found >= 0 and values[found].real == 0.0 and values[found].imag > 0.0:
        return found
    return -1
