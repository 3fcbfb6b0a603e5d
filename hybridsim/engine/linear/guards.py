"""Guards of linear modes as Taylor series in states and in modal coordinates, with error bounds.

A monitor may have products of states. A product has the product of the Taylor series of its factors, which are linear
guards, so that no coordinates beyond those of the states are needed. A factor of size M whose coordinates turn at most
with the speed R has derivatives of at most M R**m. The product of two factors has derivatives of at most
M1 M2 (R1 + R2)**m.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.kernels import call_noinline, inlined, kernel
from hybridsim.engine.native.loop_hints import short_loop
from hybridsim.engine.native.simd.products import LANES
from hybridsim.engine.native.simd.vectors import WIDTH, load, splat, store
from hybridsim.engine.series.bounded import ORDER, UNIT

_FACTORIAL = float(math.factorial(BOUND_TERMS))
FARTHEST = 8.0  # in units of the fastest rate; a bound with this number of terms holds for less
_ROUNDINGS = 8.0  # roundings of a coefficient read from the tape, for a chain of this many operations

# The terms of a product may cancel, but their rounding errors do not: their sum grows by at most this factor within
# `farthest`.
_ROUNDED = math.exp(FARTHEST)


@kernel
def guard_series(A: Any, rows: Any, n: int, series: Any, roundings: Any, largest: Any) -> None:
    """Compute the Taylor coefficients of guards along y' = A y, the error bound of each entry, and the largest bound.

    rows (K, G, m) are functions of y; further columns, of products, are not read. A (K, m, m). series, roundings
    (K, G, ORDER + 1, .) are zero; the entries behind the states begin at a multiple of four. largest (K, G, ORDER + 1).
    """
    modes, guards, size = rows.shape[0], rows.shape[1], A.shape[1]
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
    modes, guards, size = rows.shape[0], rows.shape[1], basis.shape[1]
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


@kernel
def write_products(rows: Any, flows: Any, lin: Any) -> None:
    """Write the bounds of all guards that follow from their products, after those of their linear terms.

    rows (K, G, m + Q): coefficients of the guards. flows: `hybridsim.engine.linear.modal.Modals`.
    """
    count, size = lin.products.shape[0], flows.full_basis.shape[1]
    for k in range(rows.shape[0]):
        margin = (16.0 + 2.0 * lin.counts[k]) * UNIT
        for g in range(rows.shape[1]):
            lin.margins[k, g] = margin
        for q in range(count):
            speed = growth = turning = degree = 0.0
            for i in range(lin.products.shape[1]):
                f = lin.products[q, i]
                if f < 0:
                    break
                fastest = growing = 0.0
                for j in range(lin.counts[k]):
                    if lin.sizes[k, f, j] > 0.0:
                        fastest, growing = max(fastest, flows.speeds[k, j]), max(growing, flows.growth[k, j])
                speed, growth, degree = speed + fastest, growth + growing, degree + 1.0
                turning += max(fastest, growing)
            lin.product_rests[k, q] = speed**BOUND_TERMS / _FACTORIAL
            for g in range(rows.shape[1]):
                lin.shares[k, g, q] = rows[k, g, size + q]
                if rows[k, g, size + q] == 0.0:
                    continue
                lin.is_polynomial[k, g], lin.waves[k, g] = 1, -1
                lin.margins[k, g] = max(lin.margins[k, g], degree * margin * _ROUNDED)
                lin.turning[k, g] = max(lin.turning[k, g], turning)
                if speed > 0.0:
                    lin.farthest[k, g] = min(lin.farthest[k, g], FARTHEST / speed)
                if growth > 0.0:
                    lin.farthest[k, g] = min(lin.farthest[k, g], math.log(2.0) / growth)
                    lin.grown[k, g] = 2.0


@inlined
def guard_terms(lin: Any, k: int, g: int, c: Any, terms: Any, series: Any) -> tuple[float, float]:
    """Write the Taylor coefficients of a guard to `terms`; return bounds of the guard and of the remainder.

    The bound of the first omitted coefficient holds from here on as long as no block grows: |gamma| |B**m|
    |c|/m!, block by block. series (3, BOUND_TERMS): scratch with zeros in the first row.
    """
    size, rest = _linear_terms(lin, k, g, c, terms)
    if lin.is_polynomial[k, g] != 0:
        more, further = call_noinline(_add_products, (lin, k, g, c, terms, series))
        size, rest = size + more, rest + further
    return size, rest


@inlined
def _linear_terms(lin: Any, k: int, g: int, c: Any, terms: Any) -> tuple[float, float]:
    """Write the Taylor coefficients of the linear part of a guard; return its bounds."""
    size, rest = 0.0, 0.0
    first, second = splat(0.0), splat(0.0)  # BOUND_TERMS are two vectors
    at = (k * lin.terms.shape[1] + g) * lin.terms.shape[2] * 2 * BOUND_TERMS
    for j in range(lin.counts[k]):
        short_loop()
        real, imaginary = c[j].real, c[j].imag
        modulus = abs(real) + abs(imaginary)
        size += lin.sizes[k, g, j] * modulus
        rest += lin.rests[k, g, j] * modulus
        x, y = splat(real), splat(imaginary)
        first = first + (load(lin.terms, at) * x - load(lin.terms, at + BOUND_TERMS) * y)
        second = second + (load(lin.terms, at + WIDTH) * x - load(lin.terms, at + BOUND_TERMS + WIDTH) * y)
        at += 2 * BOUND_TERMS
    store(terms, 0, first)
    store(terms, WIDTH, second)
    return size, rest


@kernel
def _add_products(lin: Any, k: int, g: int, c: Any, terms: Any, series: Any) -> tuple[float, float]:
    """Add the products of a guard to its Taylor coefficients; return what they add to both bounds."""
    factor, product = series[1], series[2]
    size = rest = 0.0
    for q in range(lin.products.shape[0]):
        share = lin.shares[k, g, q]
        if share == 0.0:
            continue
        last, of_factor, whole = -1, 0.0, abs(share)
        for i in range(lin.products.shape[1]):
            f = lin.products[q, i]
            if f < 0:
                break
            if f != last:
                of_factor, _ = _linear_terms(lin, k, f, c, factor)
                last = f
            whole *= of_factor
            low, high = splat(0.0), splat(0.0)
            if i == 0:
                low, high = load(factor, 0) * splat(share), load(factor, WIDTH) * splat(share)
            else:  # before the factor there are zeros
                for j in range(WIDTH):
                    x = splat(product[j])
                    low = low + load(series, BOUND_TERMS - j) * x
                    high = high + load(series, BOUND_TERMS + WIDTH - j) * x
                for j in range(WIDTH, BOUND_TERMS):
                    high = high + load(series, BOUND_TERMS + WIDTH - j) * splat(product[j])
            store(product, 0, low)
            store(product, WIDTH, high)
        store(terms, 0, load(terms, 0) + load(product, 0))
        store(terms, WIDTH, load(terms, WIDTH) + load(product, WIDTH))
        size += whole
        rest += whole * lin.product_rests[k, q]
    return size, rest


@inlined
def guard_size(lin: Any, k: int, g: int, sizes: Any) -> float:
    """Return a bound of a guard from bounds of the modal coordinates."""
    size = 0.0
    for j in range(lin.counts[k]):
        size += lin.sizes[k, g, j] * sizes[j]
    if lin.is_polynomial[k, g] != 0:
        size += call_noinline(_size_of_products, (lin, k, g, sizes))
    return size


@kernel
def _size_of_products(lin: Any, k: int, g: int, sizes: Any) -> float:
    size = 0.0
    for q in range(lin.products.shape[0]):
        whole = abs(lin.shares[k, g, q])
        for i in range(lin.products.shape[1]):
            f = lin.products[q, i]
            if f < 0 or whole == 0.0:
                break
            of_factor = 0.0
            for j in range(lin.counts[k]):
                of_factor += lin.sizes[k, f, j] * sizes[j]
            whole *= of_factor
        size += whole
    return size
