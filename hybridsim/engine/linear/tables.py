"""Linear modes as arrays for compiled loops: functions of time, series of guards, block diagonal flows."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.linear.guards import guard_series, modal_guards
from hybridsim.engine.linear.modal import modals
from hybridsim.engine.linear.plan import plan_of
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.simd_products import LANES, panels_of, rows_of
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock

_LARGEST = 1e150  # the square of it has a value yet
_MOST_GROWTH = 300.0  # exponent within a segment: doubles go from exp(-745) to exp(709)
_PARTING = 2.0  # exponent by which coordinates of one block may grow apart
# In units of the fastest rate: so near to its start a state that grows from zero is what modal coordinates cancel to,
# and the first terms of its series are all of it.
_NEAR, _SLOWEST = 0.125, 1e-300
_KEPT = 64  # tables of a structure, one for each set of parameter values
_MOST_BYTES = 1 << 28  # of all of these, but for the last ones


_lock = SharedLock()


class LinearTables(NamedTuple):
    """One row for each vector of modes, in the order of the shelf; y = (states, monomials) has n + M entries.

    kinds, rates, offsets (A,), term_start (A + 1,), sources, weights: the atoms. factors (M, D): the monomials, each a
    product of 2*atom + part, and of ones: 2*A. phases (2,): the sources in p that are angles known to rounding only.
    Rows over y have zeros behind states and monomials, and panels are what `hybridsim.engine.native.simd_products`
    makes of them. series (K, G, 4, .): Taylor coefficients of the guards, by rows over y; roundings likewise: bounds
    of their rounding errors for y of size 1; largest (K, G, 4): of those of a coefficient. counts (K,), values (K,
    J), upper (K, J, J), ends (K, J): the flow in modal coordinates c, J even; basis (K, n, J); inverse (K, J / 2, .,
    4): panels that lead from y to c, a complex number being two; states (K, ., 2 J, 4): from c to the states, spreads
    (K, ., J, 4): from its sizes to what these are summed from; slopes (K, ., ., 4): from y to their rates. terms (K,
    G, J, 2, BOUND_TERMS): Taylor coefficients of the guards in modal coordinates, factors of their real and imaginary
    parts; sizes, rests (K, G, J): bounds of the guard and of the first coefficient left out; farthest, grown (K, G):
    how far ahead the latter holds, but for a factor; turning (K, G): the fastest of the speeds and rates of growth
    that a guard sees, which make the more of a rounding the longer they go on. waves (K, G): the modal coordinate
    that turns without damping, where a guard sees one such and else constants; -1 otherwise. lasting (K,): how long
    the motion may be followed from one point: of exp(2*(t - 400)) nothing is left at t = 0 that could grow to one.
    flows (K, n + M, n + M): from y to its rate; near (K,): up to when a state is summed from these.
    """

    kinds: np.ndarray
    rates: np.ndarray
    offsets: np.ndarray
    term_start: np.ndarray
    sources: np.ndarray
    weights: np.ndarray
    factors: np.ndarray
    phases: np.ndarray
    series: np.ndarray
    roundings: np.ndarray
    largest: np.ndarray
    counts: np.ndarray
    values: np.ndarray
    upper: np.ndarray
    ends: np.ndarray
    basis: np.ndarray
    inverse: np.ndarray
    states: np.ndarray
    spreads: np.ndarray
    slopes: np.ndarray
    terms: np.ndarray
    sizes: np.ndarray
    rests: np.ndarray
    farthest: np.ndarray
    grown: np.ndarray
    turning: np.ndarray
    waves: np.ndarray
    lasting: np.ndarray
    flows: np.ndarray
    near: np.ndarray


def no_tables() -> LinearTables:
    """Tables of a loop whose modes are not linear: empty."""
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
    """The fields that have a row for each vector of modes, with room for more: those of a run grow many times.

    Rows that are there do not change, so that tables made earlier are views of the same memory.
    """

    def __init__(self, fields: dict[str, np.ndarray]) -> None:
        self.count, self._fields = len(fields["counts"]), fields

    @property
    def size(self) -> int:
        """In bytes."""
        return sum(field.nbytes for field in self._fields.values())

    def first(self, count: int) -> dict[str, np.ndarray]:
        """The first rows of each."""
        return {name: field[:count] for name, field in self._fields.items()}

    def gone_on_with(self, first: int, new: dict[str, np.ndarray]) -> _Rows:
        """These up to `first`, and new ones: in the room behind them, if nobody else has taken it."""
        count = first + len(new["counts"])
        with _lock:
            rows = self
            if self.count != first or count > len(self._fields["counts"]):
                rows = _Rows(
                    {name: _with_room(field[:first], 2 * count) for name, field in self._fields.items()}
                )
            for name, field in rows._fields.items():
                field[first:count] = new[name]
            rows.count = count
        return rows


def _with_room(field: np.ndarray, count: int) -> np.ndarray:
    larger = np.zeros((count, *field.shape[1:]), dtype=field.dtype)
    larger[: len(field)] = field
    return larger


class Made(NamedTuple):
    """Tables of some vectors of modes at one set of values, and the matrices (K, m, m), (K, G, m) they are made of."""

    tables: LinearTables
    flows: np.ndarray
    guards: np.ndarray
    rows: _Rows


def linear_tables(
    system: System, met: np.ndarray, p: np.ndarray, horizon: float, begun: Made | None = None
) -> Made | None:
    """Tables of the vectors of modes met so far (K, components) at the parameters in p; horizon: of a segment.

    begun: those of the first of these, which are taken up as far as they are the same. None where each mode has a rate
    or a guard with a coefficient that is no finite number, or one beyond all that squares.
    """
    plan, registers = plan_of(system, met, p)
    A, guards = plan.matrices(registers)
    is_finite = leave_out(A, guards, system.n)
    if not is_finite.any():
        return None
    rows = None if begun is None else _gone_on_with(begun, A, guards, is_finite, system.n, horizon)
    rows = rows or _Rows(unknown(of_matrices(A, guards, system.n, horizon), is_finite))
    tables: LinearTables = packed(
        LinearTables(**plan.atoms(registers), phases=angles_of(system), **rows.first(len(met)))
    )
    return Made(tables, A, guards, rows)


def _gone_on_with(
    begun: Made, A: np.ndarray, guards: np.ndarray, is_finite: np.ndarray, n: int, horizon: float
) -> _Rows | None:
    """The rows of those begun with those of further matrices behind them; None where the first ones are others."""
    first, widest = len(begun.flows), begun.tables.values.shape[1]
    if not (np.array_equal(begun.flows, A[:first]) and np.array_equal(begun.guards, guards[:first])):
        return None
    new = unknown(of_matrices(A[first:], guards[first:], n, horizon, widest), is_finite[first:])
    return begun.rows.gone_on_with(first, new) if new["values"].shape[1] == widest else None


def leave_out(A: np.ndarray, guards: np.ndarray, n: int) -> np.ndarray:
    """Which modes (..., K) have coefficients with squares; the others are changed to such as no guard admits.

    A (..., K, m, m), guards (..., K, G, m). Two surfaces that cannot be held together make modes without finite
    numbers; runs have them as neighbours only. One that is in such a mode all the same is stopped by `unknown`.
    """
    is_finite = np.logical_and(*((np.abs(part) < _LARGEST).all(axis=(-2, -1)) for part in (A, guards)))
    A[~is_finite, :n] = 0.0
    guards[~is_finite] = 0.0
    guards[~is_finite, :, n] = -1.0  # the first function of time is 1
    return np.asarray(is_finite)


def unknown(fields: dict[str, np.ndarray], is_finite: np.ndarray) -> dict[str, np.ndarray]:
    """The fields of `of_matrices` with no numbers for the motion in modes that are left out: a leap stops there, and
    nothing is taken to rest there."""
    for name in ("inverse", "slopes", "flows"):
        fields[name][~is_finite] = np.nan
    return fields


def angles_of(system: System) -> np.ndarray:
    """Where in p the angles are that are known to rounding only: the first, and the one after the last."""
    return np.array([system.layout.phases_at, system.layout.signals_at], dtype=np.int64)


def of_matrices(
    A: np.ndarray, rows: np.ndarray, n: int, horizon: float, least: int = 0
) -> dict[str, np.ndarray]:
    """The fields of the tables that have a row for each vector of modes, by name: of A (K, m, m), rows (K, G, m).

    least: of J.
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
        "inverse": panels_of(inverse, parts),
        "states": panels_of(np.stack([basis.real, -basis.imag], axis=-1).reshape(count, n, 2 * widest)),
        "spreads": panels_of(np.abs(basis.real) + np.abs(basis.imag)),
        "slopes": panels_of(A[:, :n], parts),
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
    """The time to grow by as much as leaves both ends within doubles, and no part of a block to its rounding.

    Coordinates of one block are known to rounding of the largest of them. One that grows faster than others, as a load
    does that is nothing yet, would make of that rounding what it makes of itself.
    """
    lasting, j = np.inf, 0
    while j < count:
        block = rates[j : ends[j]]
        fastest, slowest = block.max(), max(block.min(), 0.0)
        if fastest > 0.0:
            lasting = min(lasting, _MOST_GROWTH / fastest)
        if fastest > slowest:
            lasting = min(lasting, _PARTING / (fastest - slowest))
        j = ends[j]
    return float(lasting)


def horizon_class(horizon: float) -> float:
    """The order of magnitude that tables are made for."""
    return 16.0 ** math.ceil(math.log(horizon, 16.0)) if horizon > 0.0 else math.inf


def tables_of(
    system: System, modes: np.ndarray, p: np.ndarray, horizon: float
) -> tuple[LinearTables, deque[Any]] | None:
    """Tables of these vectors of modes (K, components), and scratch arrays for them to be handed on.

    The tables are made once for each set of parameter values and each order of magnitude of the horizon: how long a
    segment may be at most. The scratch arrays serve all tables of one form. None where there are no tables.
    """
    horizon = horizon_class(horizon)
    last = system.tables.get(horizon)
    if last is not None and last[0] is modes:  # the values of a system's parameters do not change
        return last[1]
    made = _made(system, modes, p, horizon, None if last is None else last[2])
    found = None if made is None else (made.tables, _scratch(system, made.tables))
    system.tables[horizon] = (modes, found, made)
    return found


def _scratch(system: System, tables: LinearTables) -> deque[Any]:
    """Where scratch arrays for tables of this form wait."""
    form = len(tables.kinds), len(tables.factors), tables.values.shape
    spare: deque[Any] = system.code.shared(f"scratch for linear modes of form {form}", deque)
    return spare


def _made(
    system: System, modes: np.ndarray, p: np.ndarray, horizon: float, begun: Made | None
) -> Made | None:
    kept: dict[bytes, Made] = system.code.shared("linear", dict)
    key = p[: system.layout.parameters].tobytes() + modes.tobytes() + np.float64(horizon).tobytes()
    found = kept.get(key)
    if found is None:
        found = linear_tables(system, modes, p, horizon, begun)
        if found is None:
            return None
        with _lock:
            for other in [other for other, made in kept.items() if made is begun]:
                del kept[other]  # the same for fewer modes
            kept[key] = found
            while len(kept) > _KEPT or (
                len(kept) > 1 and sum(made.rows.size for made in kept.values()) > _MOST_BYTES
            ):
                del kept[next(iter(kept))]
    return found
