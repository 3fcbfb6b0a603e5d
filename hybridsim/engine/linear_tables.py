"""Linear modes as arrays for compiled loops: functions of time, series of guards, block diagonal flows."""

from __future__ import annotations

import math
from collections import deque
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.jets import ORDER
from hybridsim.engine.linear_guards import TERMS, guard_series, modal_guards
from hybridsim.engine.linear_plan import plan_of
from hybridsim.engine.modal import modals
from hybridsim.engine.packs import packed
from hybridsim.engine.panels import LANES, panels_of, rows_of
from hybridsim.engine.system import System

_LARGEST = 1e150  # the square of it has a value yet
_KEPT = 64  # tables of a structure, one for each set of parameter values


_lock = Lock()


class LinearTables(NamedTuple):
    """One row for each vector of modes, in the order of the shelf; y = (states, monomials) has n + M entries.

    kinds, rates, offsets (A,), term_start (A + 1,), sources, weights: the atoms. factors (M, D): the monomials, each a
    product of 2*atom + part, and of ones: 2*A. phases (2,): the sources in p that are angles known to rounding only.
    Rows over y have zeros behind states and monomials, and panels are what `hybridsim.engine.panels` makes of them.
    series (K, G, 4, .): Taylor coefficients of the guards, by rows over y; roundings likewise: bounds of their rounding
    errors for y of size 1; largest (K, G, 4): of those of a coefficient. counts (K,), values (K, J), upper (K, J, J),
    ends (K, J): the flow in modal coordinates c, J even; basis (K, n, J); inverse (K, J / 2, ., 4): panels that lead
    from y to c, a complex number being two; states (K, ., 2 J, 4): from c to the states, spreads (K, ., J, 4): from its
    sizes to what these are summed from; slopes (K, ., ., 4): from y to their rates. terms (K, G, J, 2, TERMS): Taylor
    coefficients of the guards in modal coordinates, factors of their real and imaginary parts; sizes, rests (K, G, J):
    bounds of the guard and of the first coefficient left out; farthest, grown (K, G): how far ahead the latter holds,
    but for a factor. waves (K, G): the modal coordinate that turns without damping, where a guard sees one such and
    else constants; -1 otherwise.
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
    waves: np.ndarray


def no_tables() -> LinearTables:
    """Tables of a loop whose modes are not linear: empty."""
    i, c = np.int64, np.complex128
    tables: LinearTables = packed(LinearTables(
        np.zeros(0, i), np.zeros(0), np.zeros(0), np.zeros(1, i), np.zeros(0, i), np.zeros(0), np.zeros((0, 0), i),
        np.zeros(2, i), np.zeros((0, 0, 0, 0)), np.zeros((0, 0, 0, 0)), np.zeros((0, 0, 0)), np.zeros(0, i),
        np.zeros((0, 0), c), np.zeros((0, 0, 0), c), np.zeros((0, 0), i), np.zeros((0, 0, 0), c),
        np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, LANES)),
        np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, 0, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0, 0)),
        np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0), i),
    ))  # fmt: skip
    return tables


def linear_tables(system: System, met: np.ndarray, p: np.ndarray, horizon: float) -> LinearTables | None:
    """Tables of the vectors of modes met so far (K, components) at the parameters in p; horizon: of a segment.

    None where a rate or guard has a coefficient that is no finite number, or one beyond all that squares.
    """
    plan, registers = plan_of(system, met, p)
    A, rows = plan.matrices(registers)
    if not is_finite(A, rows).all():
        return None
    tables: LinearTables = packed(
        LinearTables(
            **plan.atoms(registers),
            phases=angles_of(system),
            **of_matrices(A, rows, system.n, horizon),
        )
    )
    return tables


def is_finite(A: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Whether all coefficients have squares; of matrices of many points, of which of them."""
    inside = [(np.abs(part) < _LARGEST).all(axis=(-3, -2, -1)) for part in (A, rows)]
    return np.logical_and(*inside)


def angles_of(system: System) -> np.ndarray:
    """Where in p the angles are that are known to rounding only: the first, and the one after the last."""
    return np.array([system.layout.phases_at, system.layout.signals_at], dtype=np.int64)


def of_matrices(A: np.ndarray, rows: np.ndarray, n: int, horizon: float) -> dict[str, np.ndarray]:
    """The fields of the tables that have a row for each vector of modes, by name: of A (K, m, m), rows (K, G, m)."""
    count, guards, size = rows.shape
    flows = modals(A, horizon, TERMS, multiple=LANES // 2)
    widest = flows.values.shape[1]
    series, roundings = (np.empty((count, guards, ORDER + 1, size)) for _ in range(2))
    guard_series(A, rows, series, roundings)
    terms = np.zeros((count, guards, widest, 2, TERMS))
    sizes, rests = np.zeros((count, guards, widest)), np.zeros((count, guards, widest))
    farthest, grown = np.full((count, guards), np.inf), np.ones((count, guards))
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
        "waves": waves,
    }


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
    found = _tables_of(system, modes, p, horizon)
    system.tables[horizon] = (modes, found)
    return found


def _tables_of(
    system: System, modes: np.ndarray, p: np.ndarray, horizon: float
) -> tuple[LinearTables, deque[Any]] | None:
    kept: dict[bytes, tuple[LinearTables, deque[Any]]] = system.code.shared("linear", dict)
    key = p[: system.layout.parameters].tobytes() + modes.tobytes() + np.float64(horizon).tobytes()
    found = kept.get(key)
    if found is None:
        tables = linear_tables(system, modes, p, horizon)
        if tables is None:
            return None
        forms = len(tables.kinds), len(tables.factors), tables.values.shape
        spare: deque[Any] = system.code.shared(f"scratch for linear modes of form {forms}", deque)
        found = (tables, spare)
        with _lock:
            while len(kept) >= _KEPT:
                del kept[next(iter(kept))]
            kept[key] = found
    return found
