"""This module writes parts of the tables of linear modes in compiled code, for each combination of modes."""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.linear.guards import guard_series, modal_guards, write_products
from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.native.simd.products import LANES

_LARGEST = 1e150  # its square is still finite
_MAX_GROWTH_EXPONENT = 300.0  # exponent within a segment: doubles go from exp(-745) to exp(709)
_PARTING = 2.0  # exponent by which coordinates of one block may grow apart
# In units of the fastest rate: within this time of its start, a state that grows from zero is lost to cancellation in
# modal coordinates, and the first terms of its series suffice.
_NEAR, _SLOWEST = 0.125, 1e-300


@kernel
def leave_out(A: Any, guards: Any, n: int, usable: Any) -> None:
    """Write a mask of the modes with finite coefficients, and set the guards of the other modes to -1.

    A (K, m, m), guards (K, G, m + Q). Two surfaces that cannot be held together give modes with numbers that are not
    finite, which runs have only as neighbours. In the tables their motion is NaN, so that a compiled loop stops there,
    and no state counts as resting there.
    """
    size = A.shape[1]
    for k in range(A.shape[0]):
        usable[k] = True
        for m in range(size):
            for i in range(size):
                usable[k] = usable[k] and abs(A[k, i, m]) < _LARGEST
        for g in range(guards.shape[1]):
            for m in range(guards.shape[2]):
                usable[k] = usable[k] and abs(guards[k, g, m]) < _LARGEST
        if usable[k]:
            continue
        for i in range(n):
            for m in range(size):
                A[k, i, m] = 0.0
        for g in range(guards.shape[1]):
            for m in range(guards.shape[2]):
                guards[k, g, m] = -1.0 if m == n else 0.0  # the first function of time is 1


@kernel
def write_bases(A: Any, n: int, flows: Any, inverse: Any, states: Any, spreads: Any, slopes: Any) -> None:
    """Write the matrices that convert states to modal coordinates, modal coordinates to states, and states to rates.

    flows: `hybridsim.engine.linear.modal.Modals`. The other arrays are described in `hybridsim.engine.linear.tables`
    and are zero.
    """
    size, behind = A.shape[1], -n % LANES
    for k in range(A.shape[0]):
        for m in range(size):
            column = m if m < n else m + behind
            for i in range(n):
                slopes[k, i // LANES, column, i % LANES] = A[k, i, m]
            for j in range(flows.values.shape[1]):
                entry = flows.inverse[k, j, m]
                inverse[k, 2 * j // LANES, column, 2 * j % LANES] = entry.real
                inverse[k, 2 * j // LANES, column, 2 * j % LANES + 1] = entry.imag
        for j in range(flows.values.shape[1]):
            for i in range(n):
                entry, q, lane = flows.full_basis[k, i, j], i // LANES, i % LANES
                states[k, q, 2 * j, lane], states[k, q, 2 * j + 1, lane] = entry.real, -entry.imag
                spreads[k, q, j, lane] = abs(entry.real) + abs(entry.imag)


@kernel
def write_lengths(flows: Any, lasting: Any, near: Any) -> None:
    """Write for each mode how long its closed form is accurate, and up to which time a Taylor series is used.

    It is accurate until numbers overflow or blocks lose accuracy. Coordinates of one block have errors relative to the
    largest of them. If one grows faster than the others, such as a load that is still very small, the rounding error
    grows as fast.
    """
    for k in range(lasting.shape[0]):
        values, ends, speed, j = flows.values[k], flows.ends[k], _SLOWEST, 0
        lasting[k] = math.inf
        while j < flows.counts[k]:
            fastest = slowest = values[j].real
            speed = max(speed, flows.speeds[k, j])
            for i in range(j + 1, ends[j]):
                fastest, slowest = max(fastest, values[i].real), min(slowest, values[i].real)
            slowest = max(slowest, 0.0)
            if fastest > 0.0:
                lasting[k] = min(lasting[k], _MAX_GROWTH_EXPONENT / fastest)
            if fastest > slowest:
                lasting[k] = min(lasting[k], _PARTING / (fastest - slowest))
            j = ends[j]
        near[k] = _NEAR / speed


@kernel
def write_tables(A: Any, guards: Any, n: int, usable: Any, flows: Any, gamma: Any, tables: Any) -> None:
    """Write the rows of all modes to `tables`, which must contain zeros.

    A (K, m, m), guards (K, G, m + Q), usable (K,): see `leave_out`. flows: `hybridsim.engine.linear.modal.Modals`.
    gamma (J,): scratch.
    """
    for k in range(A.shape[0]):
        tables.counts[k] = flows.counts[k]
        for j in range(flows.values.shape[1]):
            tables.values[k, j], tables.ends[k, j] = flows.values[k, j], flows.ends[k, j]
            for i in range(flows.values.shape[1]):
                tables.upper[k, i, j] = flows.upper[k, i, j]
            for i in range(n):
                tables.basis[k, i, j] = flows.full_basis[k, i, j]
        for i in range(A.shape[1]):
            for j in range(A.shape[1]):
                tables.flows[k, i, j] = A[k, i, j] if usable[k] else math.nan
    guard_series(A, guards, n, tables.series, tables.roundings, tables.largest)
    write_bases(A, n, flows, tables.inverse, tables.states, tables.spreads, tables.slopes)
    for k in range(A.shape[0]):
        if not usable[k]:
            tables.inverse[k], tables.slopes[k] = math.nan, math.nan
    write_lengths(flows, tables.lasting, tables.near)
    modal_guards(
        guards, flows, gamma, tables.terms, tables.sizes, tables.rests, tables.farthest, tables.grown, tables.turning,
        tables.waves,
    )  # fmt: skip
    write_products(guards, flows, tables)


@kernel
def write_atoms(atoms: Any, tables: Any) -> None:
    """Write the functions of time, and the factors of the products of states, to `tables`."""
    kinds, rates, offsets, starts, sources, weights, factors, phases, products = atoms
    for a in range(kinds.shape[0]):
        tables.kinds[a], tables.rates[a], tables.offsets[a] = kinds[a], rates[a], offsets[a]
    for a in range(starts.shape[0]):
        tables.term_start[a] = starts[a]
    for i in range(sources.shape[0]):
        tables.sources[i], tables.weights[i] = sources[i], weights[i]
    for m in range(factors.shape[0]):
        for d in range(factors.shape[1]):
            tables.factors[m, d] = factors[m, d]
    tables.phases[0], tables.phases[1] = phases[0], phases[1]
    for q in range(products.shape[0]):
        for i in range(products.shape[1]):
            tables.products[q, i] = products[q, i]
