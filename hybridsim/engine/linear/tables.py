"""Linear modes as arrays for compiled loops: functions of time, guards, and block diagonal flows."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.linear.guards import guard_series, modal_guards
from hybridsim.engine.linear.matrix_template import template_of
from hybridsim.engine.linear.modal import modals
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.simd_products import LANES, row_blocks_of, rows_of
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.system.per_structure import per_structure, spare_scratch
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock

_LARGEST = 1e150  # its square is still finite
_MAX_GROWTH_EXPONENT = 300.0  # exponent within a segment: doubles go from exp(-745) to exp(709)
_PARTING = 2.0  # exponent by which coordinates of one block may grow apart
# In units of the fastest rate: within this time of its start, a state that grows from zero is lost to cancellation in
# modal coordinates, and the first terms of its series suffice.
_NEAR, _SLOWEST = 0.125, 1e-300
_MAX_CACHED = 64  # most tables per structure, one for each set of parameter values
_MAX_BYTES = 1 << 28  # most bytes of all these tables except the last


_lock = SharedLock()


class LinearTables(NamedTuple):
    """Arrays of linear modes for compiled loops, with one row per combination of modes.

    Shapes: K mode vectors, A atoms, M monomials, G guards, J modal coordinates (even). Rows over y are padded
    with zeros behind states and monomials. Blocks of rows are made by `hybridsim.engine.native.simd_products`.

    The motion is followed from one point only for a limited time (`lasting`). For example, exp(2*(t - 400))
    underflows at t = 0 and could not grow to one from there.
    """

    kinds: np.ndarray  # (A,) kinds of the atoms
    rates: np.ndarray  # (A,) rates of the atoms
    offsets: np.ndarray  # (A,) offsets of the atoms
    term_start: np.ndarray  # (A + 1,) first term of each atom in sources and weights
    sources: np.ndarray  # places in p of the atoms' terms
    weights: np.ndarray  # weights of the atoms' terms
    factors: np.ndarray  # (M, D) factors of the monomials: 2*atom + part, or 2*A for a one
    phases: np.ndarray  # (2,) range of the places in p that hold rounded angles
    series: np.ndarray  # (K, G, 4, .) Taylor coefficients of the guards as rows over y
    roundings: np.ndarray  # (K, G, 4, .) bounds of the rounding errors of series for y of size 1
    largest: np.ndarray  # (K, G, 4) largest rounding of each coefficient
    counts: np.ndarray  # (K,) number of modal coordinates
    values: np.ndarray  # (K, J) diagonal of B in c' = B c
    upper: np.ndarray  # (K, J, J) strictly upper part of B
    ends: np.ndarray  # (K, J) end of the block of each coordinate
    basis: np.ndarray  # (K, n, J) from c to the states
    inverse: (
        np.ndarray
    )  # (K, J / 2, ., 4) blocks of rows from y to c, with two numbers per complex coordinate
    states: np.ndarray  # (K, ., 2 J, 4) blocks of rows from c to the states
    spreads: np.ndarray  # (K, ., J, 4) blocks of rows from the sizes of c to the sizes of the states' terms
    slopes: np.ndarray  # (K, ., ., 4) blocks of rows from y to the rates of the states
    terms: np.ndarray  # (K, G, J, 2, BOUND_TERMS) Taylor coefficients of the guards for Re c and Im c
    sizes: np.ndarray  # (K, G, J) bounds of the guard
    rests: np.ndarray  # (K, G, J) bounds of the first omitted coefficient
    farthest: np.ndarray  # (K, G) how far ahead rests holds, up to the factor grown
    grown: np.ndarray  # (K, G) factor on rests within farthest
    turning: (
        np.ndarray
    )  # (K, G) fastest speed or growth rate in the guard, which amplifies roundings with time
    waves: np.ndarray  # (K, G) coordinate of a guard that is a constant plus one undamped wave, else -1
    lasting: np.ndarray  # (K,) how long the motion may be followed from one point
    flows: np.ndarray  # (K, n + M, n + M) from y to its rate
    near: np.ndarray  # (K,) time up to which a state is summed from the series of flows


def no_tables() -> LinearTables:
    """Return the empty tables of a loop whose modes are not linear."""
    i, c = np.int64, np.complex128
    tables: LinearTables = packed(LinearTables(
        np.zeros(0, i), np.zeros(0), np.zeros(0), np.zeros(1, i), np.zeros(0, i), np.zeros(0), np.zeros((0, 0), i),
        np.zeros(2, i), np.zeros((0, 0, 0, 0)), np.zeros((0, 0, 0, 0)), np.zeros((0, 0, 0)), np.zeros(0, i),
        np.zeros((0, 0), c), np.zeros((0, 0, 0), c), np.zeros((0, 0), i), np.zeros((0, 0, 0), c),
        np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, LANES)),
        np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, 0, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0, 0)),
        np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0), i), np.zeros(0),
        np.zeros((0, 0, 0)), np.zeros(0),
    ))  # fmt: skip
    return tables


class _Rows:
    """The fields with one row per combination of modes, with spare rows for later modes.

    Existing rows do not change, so that earlier tables are views of the same memory.
    """

    def __init__(self, fields: dict[str, np.ndarray]) -> None:
        self.count, self._fields = len(fields["counts"]), fields
        self.size = sum(field.nbytes for field in fields.values())  # bytes

    def first(self, count: int) -> dict[str, np.ndarray]:
        """Return the first `count` rows of each field."""
        return {name: field[:count] for name, field in self._fields.items()}

    def gone_on_with(self, first: int, new: dict[str, np.ndarray]) -> _Rows:
        """Return the first rows followed by new rows, which use the spare rows if they are free."""
        count = first + len(new["counts"])
        with _lock:
            rows = self
            if self.count != first or count > len(self._fields["counts"]):
                rows = _Rows(
                    {name: _extended(field[:first], 2 * count) for name, field in self._fields.items()}
                )
            for name, field in rows._fields.items():
                field[first:count] = new[name]
            rows.count = count
        return rows


def _extended(field: np.ndarray, count: int) -> np.ndarray:
    larger = np.zeros((count, *field.shape[1:]), dtype=field.dtype)
    larger[: len(field)] = field
    return larger


class Made(NamedTuple):
    """Tables of linear modes at one set of parameter values, and the matrices that define them."""

    tables: LinearTables
    flows: np.ndarray
    guards: np.ndarray
    rows: _Rows


def linear_tables(
    system: System, met: np.ndarray, p: np.ndarray, horizon: float, begun: Made | None = None
) -> Made | None:
    """Return tables of the combinations of modes entered so far; `horizon` is the length of a segment.

    begun: tables of the first of these vectors, which are reused as far as they agree. Return None if each
    mode has a rate or a guard with a coefficient that is not finite, or is too large to be squared.
    """
    template, registers = template_of(system, met, p)
    A, guards = template.matrices(registers)
    is_finite = leave_out(A, guards, system.n)
    if not is_finite.any():
        return None
    rows = None if begun is None else _gone_on_with(begun, A, guards, is_finite, system.n, horizon)
    rows = rows or _Rows(unknown(of_matrices(A, guards, system.n, horizon), is_finite))
    tables: LinearTables = packed(
        LinearTables(**template.atoms(registers), phases=angles_of(system), **rows.first(len(met)))
    )
    return Made(tables, A, guards, rows)


def _gone_on_with(
    begun: Made, A: np.ndarray, guards: np.ndarray, is_finite: np.ndarray, n: int, horizon: float
) -> _Rows | None:
    """Extend existing rows by rows of further matrices; return None if the first matrices differ."""
    first, widest = len(begun.flows), begun.tables.values.shape[1]
    if not (np.array_equal(begun.flows, A[:first]) and np.array_equal(begun.guards, guards[:first])):
        return None
    new = unknown(of_matrices(A[first:], guards[first:], n, horizon, widest), is_finite[first:])
    return begun.rows.gone_on_with(first, new) if new["values"].shape[1] == widest else None


def leave_out(A: np.ndarray, guards: np.ndarray, n: int) -> np.ndarray:
    """Return a mask of modes with usable coefficients; the guards of the other modes become -1.

    A (..., K, m, m), guards (..., K, G, m). Two surfaces that cannot be held together give modes with
    non-finite numbers, which runs have only as neighbours. `unknown` stops a run that is in such a mode.
    """
    is_finite = np.logical_and(*((np.abs(part) < _LARGEST).all(axis=(-2, -1)) for part in (A, guards)))
    A[~is_finite, :n] = 0.0
    guards[~is_finite] = 0.0
    guards[~is_finite, :, n] = -1.0  # the first function of time is 1
    return np.asarray(is_finite)


def unknown(fields: dict[str, np.ndarray], is_finite: np.ndarray) -> dict[str, np.ndarray]:
    """Set the motion of omitted modes to NaN.

    A compiled loop then stops there, and no state counts as resting there.
    """
    for name in ("inverse", "slopes", "flows"):
        fields[name][~is_finite] = np.nan
    return fields


def angles_of(system: System) -> np.ndarray:
    """Return the range of rounded angles in the run-time vector: its first index, and its last index plus one."""
    return np.array([system.layout.phases_at, system.layout.signals_at], dtype=np.int64)


def of_matrices(
    A: np.ndarray, rows: np.ndarray, n: int, horizon: float, least: int = 0
) -> dict[str, np.ndarray]:
    """Return the table fields with one row per combination of modes, from the matrices of flows and guards.

    least: smallest J.
    """
    count, guards, size = rows.shape
    flows = modals(A, horizon, BOUND_TERMS, multiple=LANES // 2, least=least)
    widest = flows.values.shape[1]
    series, roundings = (np.empty((count, guards, ORDER + 1, size)) for _ in range(2))
    guard_series(A, rows, series, roundings)
    terms = np.zeros((count, guards, widest, 2, BOUND_TERMS))
    sizes, rests = np.zeros((count, guards, widest)), np.zeros((count, guards, widest))
    farthest, grown = np.full((count, guards), np.inf), np.ones((count, guards))
    turning = np.zeros((count, guards))
    waves = np.full((count, guards), -1, dtype=np.int64)
    modal_guards(
        rows,
        flows,
        np.empty(widest, dtype=complex),
        terms,
        sizes,
        rests,
        farthest,
        grown,
        turning,
        waves,
    )
    parts, basis = (n, size - n), flows.full_basis[:, :n].copy()
    inverse = np.stack([flows.inverse.real, flows.inverse.imag], axis=2).reshape(count, 2 * widest, size)
    return {
        "series": rows_of(series, parts),
        "roundings": rows_of(roundings, parts),
        "largest": roundings.max(axis=-1),
        "counts": flows.counts,
        "values": flows.values,
        "upper": flows.upper,
        "ends": flows.ends,
        "basis": basis,
        "inverse": row_blocks_of(inverse, parts),
        "states": row_blocks_of(np.stack([basis.real, -basis.imag], axis=-1).reshape(count, n, 2 * widest)),
        "spreads": row_blocks_of(np.abs(basis.real) + np.abs(basis.imag)),
        "slopes": row_blocks_of(A[:, :n], parts),
        "terms": terms,
        "sizes": sizes,
        "rests": rests,
        "farthest": farthest,
        "grown": grown,
        "turning": turning,
        "waves": waves,
        "lasting": np.array(
            [_lasting(*row) for row in zip(flows.values.real, flows.ends, flows.counts, strict=True)]
        ),
        "flows": A.copy(),
        "near": _NEAR / np.maximum(flows.speeds.max(axis=1, initial=0.0), _SLOWEST),
    }


def _lasting(rates: np.ndarray, ends: np.ndarray, count: int) -> float:
    """Return how long a motion can be computed before numbers overflow or blocks lose accuracy.

    Coordinates of one block have errors relative to the largest of them. If one grows faster than the others,
    such as a load that is still very small, the rounding error grows as fast.
    """
    lasting, j = np.inf, 0
    while j < count:
        block = rates[j : ends[j]]
        fastest, slowest = block.max(), max(block.min(), 0.0)
        if fastest > 0.0:
            lasting = min(lasting, _MAX_GROWTH_EXPONENT / fastest)
        if fastest > slowest:
            lasting = min(lasting, _PARTING / (fastest - slowest))
        j = ends[j]
    return float(lasting)


def horizon_class(horizon: float) -> float:
    """Return the order of magnitude of a segment length, for which tables are computed."""
    return 16.0 ** math.ceil(math.log(horizon, 16.0)) if horizon > 0.0 else math.inf


def tables_of(
    system: System, modes: np.ndarray, p: np.ndarray, horizon: float
) -> tuple[LinearTables, deque[Any]] | None:
    """Return tables of some combinations of modes, and reusable scratch arrays for them.

    The tables are made once for each set of parameter values and each order of magnitude of the horizon, the
    longest possible segment. The scratch arrays serve all tables of one shape. Return None if there are no
    tables.
    """
    horizon = horizon_class(horizon)
    last = system.tables.get(horizon)
    if last is not None and last[0] is modes:  # the values of a system's parameters do not change
        return last[1]
    made = _made(system, modes, p, horizon, None if last is None else last[2])
    found = None
    if made is not None:
        tables = made.tables
        found = tables, spare_scratch(system, len(tables.kinds), len(tables.factors), tables.values.shape)
    system.tables[horizon] = (modes, found, made)
    return found


cached_tables = per_structure(lambda system: dict[bytes, Made]())  # by parameters, mode vectors and horizon


def _made(
    system: System, modes: np.ndarray, p: np.ndarray, horizon: float, begun: Made | None
) -> Made | None:
    cached = cached_tables(system)
    key = p[: system.layout.parameters].tobytes() + modes.tobytes() + np.float64(horizon).tobytes()
    found = cached.get(key)
    if found is None:
        found = linear_tables(system, modes, p, horizon, begun)
        if found is None:
            return None
        with _lock:
            for other in [other for other, made in cached.items() if made is begun]:
                del cached[other]  # tables of fewer modes at the same values
            cached[key] = found
            while len(cached) > _MAX_CACHED or (
                len(cached) > 1 and sum(made.rows.size for made in cached.values()) > _MAX_BYTES
            ):
                del cached[next(iter(cached))]
    return found
