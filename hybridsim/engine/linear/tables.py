"""Linear modes as arrays for compiled loops: functions of time, guards, and block diagonal flows."""

from __future__ import annotations

from collections import deque
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.linear.matrix_template import template_of
from hybridsim.engine.linear.table_rows import write_atoms, write_tables
from hybridsim.engine.linear.units import scaled_modals, units_of
from hybridsim.engine.native.array_layout import ArrayLayout, release
from hybridsim.engine.native.constants import BOUND_TERMS
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.simd.products import LANES, filled_up
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.system.per_structure import per_structure, spare_scratch
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock

# most tables per structure, one for each set of parameter values; the memory of discarded tables is reused while it is
# still in the cache of the processor
_MAX_CACHED = 4
_MAX_BYTES = 1 << 26  # most bytes of all these tables except the last


_lock = SharedLock()


class LinearTables(NamedTuple):
    """Arrays of linear modes for compiled loops, with one row per combination of modes.

    Shapes: K mode vectors, A atoms, M monomials, Q products of states, G guards and factors of products, J modal
    coordinates (even). Rows over y are padded with zeros behind states and monomials. Blocks of rows are made by
    `hybridsim.engine.native.simd.products`.

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
    products: np.ndarray  # (Q, D) factors of the products of states: rows of the guards, then -1
    series: np.ndarray  # (K, G, 4, .) Taylor coefficients of the guards as rows over y
    roundings: np.ndarray  # (K, G, 4, .) bounds of the rounding errors of series for y of size 1
    largest: np.ndarray  # (K, G, 4) largest rounding of each coefficient
    counts: np.ndarray  # (K,) number of modal coordinates
    values: np.ndarray  # (K, J) diagonal of B in c' = B c
    upper: np.ndarray  # (K, J, J) strictly upper part of B
    ends: np.ndarray  # (K, J) end of the block of each coordinate
    basis: np.ndarray  # (K, n, J) from c to the states
    # (K, J / 2, ., 4) blocks of rows from y to c, with two numbers per complex coordinate
    inverse: np.ndarray
    states: np.ndarray  # (K, ., 2 J, 4) blocks of rows from c to the states
    spreads: np.ndarray  # (K, ., J, 4) blocks of rows from the sizes of c to the sizes of the states' terms
    slopes: np.ndarray  # (K, ., ., 4) blocks of rows from y to the rates of the states
    terms: np.ndarray  # (K, G, J, 2, BOUND_TERMS) Taylor coefficients of the guards for Re c and Im c
    sizes: np.ndarray  # (K, G, J) bounds of the guard
    rests: np.ndarray  # (K, G, J) bounds of the first omitted coefficient
    farthest: np.ndarray  # (K, G) how far ahead rests holds, up to the factor grown
    grown: np.ndarray  # (K, G) factor on rests within farthest
    # (K, G) fastest speed or growth rate in the guard, which amplifies roundings with time
    turning: np.ndarray
    waves: np.ndarray  # (K, G) coordinate of a guard that is a constant plus one undamped wave, else -1
    margins: np.ndarray  # (K, G) error bound of the guard's terms, relative to sizes
    shares: np.ndarray  # (K, G, Q) coefficients of the products in the guards
    # (K, G) 1 for a guard with products, else 0; sizes and rests are those of its linear part
    is_polynomial: np.ndarray
    # (K, Q) bound of the first omitted coefficient of a product of factors of size 1
    product_rests: np.ndarray
    lasting: np.ndarray  # (K,) how long the motion may be followed from one point
    flows: np.ndarray  # (K, n + M, n + M) from y to its rate
    near: np.ndarray  # (K,) time up to which a state is summed from the series of flows


def no_tables() -> LinearTables:
    """Return empty tables, for models whose modes are not linear."""
    i, c = np.int64, np.complex128
    tables: LinearTables = packed(LinearTables(
        np.zeros(0, i), np.zeros(0), np.zeros(0), np.zeros(1, i), np.zeros(0, i), np.zeros(0), np.zeros((0, 0), i),
        np.zeros(2, i), np.zeros((0, 0), i), np.zeros((0, 0, 0, 0)), np.zeros((0, 0, 0, 0)), np.zeros((0, 0, 0)),
        np.zeros(0, i), np.zeros((0, 0), c), np.zeros((0, 0, 0), c), np.zeros((0, 0), i), np.zeros((0, 0, 0), c),
        np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, LANES)),
        np.zeros((0, 0, 0, LANES)), np.zeros((0, 0, 0, 0, 0)), np.zeros((0, 0, 0)), np.zeros((0, 0, 0)),
        np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0), i), np.zeros((0, 0)),
        np.zeros((0, 0, 0)), np.zeros((0, 0), i), np.zeros((0, 0)), np.zeros(0),
        np.zeros((0, 0, 0)), np.zeros(0),
    ))  # fmt: skip
    return tables


@lru_cache(256)
def _layout(atoms: tuple[int, ...], guards: int, n: int, size: int, widest: int, rows: int) -> ArrayLayout:
    """Return the memory layout of the tables of linear modes."""
    i, c, (count, terms, degree, products, factors) = np.int64, complex, atoms
    wide, double, blocks = filled_up(n) + filled_up(size - n), filled_up(2 * widest), filled_up(n) // LANES
    of_atoms: list[tuple[Any, tuple[int, ...]]] = [
        (i, (count,)), (float, (count,)), (float, (count,)), (i, (count + 1,)), (i, (terms,)), (float, (terms,)),
        (i, (size - n, degree)), (i, (2,)), (i, (products, factors)),
    ]  # fmt: skip
    of_rows: list[tuple[Any, tuple[int, ...]]] = [
        (float, (guards, ORDER + 1, wide)), (float, (guards, ORDER + 1, wide)), (float, (guards, ORDER + 1)), (i, ()),
        (c, (widest,)), (c, (widest, widest)), (i, (widest,)), (c, (n, widest)),
        (float, (double // LANES, wide, LANES)), (float, (blocks, double, LANES)),
        (float, (blocks, filled_up(widest), LANES)), (float, (blocks, wide, LANES)),
        (float, (guards, widest, 2, BOUND_TERMS)), (float, (guards, widest)), (float, (guards, widest)),
        (float, (guards,)), (float, (guards,)), (float, (guards,)), (i, (guards,)), (float, (guards,)),
        (float, (guards, products)), (i, (guards,)), (float, (products,)), (float, ()),
        (float, (size, size)), (float, ()),
    ]  # fmt: skip
    fields = [*of_atoms, *((dtype, (rows, *shape)) for dtype, shape in of_rows)]
    return ArrayLayout((LinearTables,), [(dtype, shape, 0) for dtype, shape in fields])


class _Rows:
    """The memory of tables, with spare rows for later modes.

    Existing rows do not change, so that earlier tables are views of the same memory.
    """

    def __init__(self, form: tuple[Any, ...], rows: int) -> None:
        self.form, self.most, self.count = form, rows, 0
        layout = _layout(*form, rows)
        self.size, self.all = layout.size, layout.zeros()

    def part(self, first: int, count: int) -> LinearTables:
        """Return the tables of the modes in the rows from `first` to `count` - 1."""
        tables: LinearTables = self.all
        if first or count < self.most:
            fields = ((name, getattr(tables, name)) for name in LinearTables._fields)
            of_part = (field if name in _ATOMS else field[first:count] for name, field in fields)
            tables = packed(LinearTables(*of_part))
        return tables

    def gone_on_with(self, first: int, count: int) -> _Rows:
        """Return this memory for `count` rows, or a larger copy if the spare rows do not suffice or are in use."""
        with _lock:
            rows = self
            if self.count != first or count > self.most:
                rows = _Rows(self.form, 2 * count)
                for name in LinearTables._fields:
                    part = slice(None) if name in _ATOMS else slice(first)
                    getattr(rows.all, name)[part] = getattr(self.all, name)[part]
            rows.count = count
        return rows


_ATOMS = LinearTables._fields[:9]  # the fields that describe functions of time and products


class Made(NamedTuple):
    """Tables of linear modes at one set of parameter values, their memory, and the matrices that define them."""

    tables: LinearTables
    rows: _Rows
    flows: np.ndarray
    guards: np.ndarray


def linear_tables(
    system: System,
    met: np.ndarray,
    p: np.ndarray,
    horizon: float,
    begun: Made | None = None,
    is_scaled: bool = False,
) -> Made | None:
    """Return tables of the combinations of modes entered so far; `horizon` is the length of a segment.

    begun: tables of the first of these vectors, which are reused as far as they agree. Return None if each
    mode has a rate or a guard with a coefficient that is not finite, or is too large to be squared.
    """
    template, registers = template_of(system, met, p)
    A, guards, usable = template.matrices(registers[None])
    if not any(usable.tolist()):
        return None
    atoms = template.atoms(registers)
    if begun is not None:
        first, former = len(begun.flows), (getattr(begun.tables, name) for name in _ATOMS)
        same = zip((begun.flows, begun.guards, *former), (A[:first], guards[:first], *atoms), strict=True)
        if not all(np.array_equal(one, other) for one, other in same):
            begun = None
    units = units_of(atoms, A, system.n, horizon) if is_scaled else None
    return Made(*of_matrices(atoms, A, guards, usable, system.n, horizon, begun, units), A, guards)


_write_atoms, _write_tables = Precompiled(write_atoms), Precompiled(write_tables)


def of_matrices(
    atoms: tuple[np.ndarray, ...],
    A: np.ndarray,
    guards: np.ndarray,
    usable: np.ndarray,
    n: int,
    horizon: float,
    begun: Made | None = None,
    units: np.ndarray | None = None,
) -> tuple[LinearTables, _Rows]:
    """Return tables with one row per combination of modes, and their memory.

    atoms: the fields that describe functions of time and products. A (K, m, m), guards (K, G, m + Q), usable (K,): see
    `leave_out`.
    begun: tables with the first rows. units (K, m): see `units_of`.
    """
    count, surfaces, size = *guards.shape[:2], A.shape[1]
    first, least = (0, 0) if begun is None else (len(begun.flows), begun.rows.form[-1])
    flows, widest = scaled_modals(A[first:], units if units is None else units[first:], horizon, least)
    if begun is not None and widest == least:
        rows = begun.rows.gone_on_with(first, count)
    else:
        if first:
            first, (flows, widest) = 0, scaled_modals(A, units, horizon)
        kinds, _, _, _, sources, _, factors, _, products = atoms
        rows = _Rows(
            ((len(kinds), len(sources), factors.shape[1], *products.shape), surfaces, n, size, widest), count
        )
        rows.count = count
    if not first:
        _write_atoms(atoms, rows.all)
    scratch = np.empty(widest, dtype=complex)
    _write_tables(A[first:], guards[first:], n, usable[first:], flows, scratch, rows.part(first, count))
    release(flows)
    return rows.part(0, count), rows


def tables_of(
    system: System, modes: np.ndarray, p: np.ndarray, horizon: float, is_scaled: bool
) -> tuple[LinearTables, int, deque[Any]] | None:
    """Return tables of some combinations of modes, the number of modal coordinates, and reusable scratch arrays.

    The tables are made once for each set of parameter values and each horizon, the order of magnitude of the longest
    possible segment. is_scaled: whether units have the length of pieces of inputs. The scratch arrays serve all tables
    of one form. Return None if there are no tables.
    """
    last = system.tables.get((horizon, is_scaled))
    if last is not None and last[0] is modes:  # the values of a system's parameters do not change
        return last[1]
    made = _made(system, modes, p, horizon, None if last is None else last[2], is_scaled)
    found = None
    if made is not None:
        found = made.tables, made.rows.form[-1], spare_scratch(system, made.rows.form)
    system.tables[horizon, is_scaled] = (modes, found, made)
    return found


class TableCache(dict[tuple[Any, ...], Made]):
    """Caches the latest tables of linear modes; the key contains parameters, modes and segment length."""

    size = 0  # bytes of all tables

    def store(self, key: tuple[Any, ...], made: Made, replaced: Made | None) -> None:
        """Add tables, and discard the oldest tables and the tables that the new ones replace."""
        with _lock:
            for other in [k for k, one in self.items() if one is replaced] if replaced is not None else ():
                self.discard(other)
            if key in self:
                self.discard(key)
            self[key] = made
            self.size += made.rows.size
            while len(self) > _MAX_CACHED or (len(self) > 1 and self.size > _MAX_BYTES):
                self.discard(next(iter(self)))

    def discard(self, key: tuple[Any, ...]) -> None:
        """Remove tables, if they are stored."""
        made = self.pop(key, None)
        self.size -= made.rows.size if made is not None else 0


cached_tables = per_structure(lambda system: TableCache())


def _made(
    system: System, modes: np.ndarray, p: np.ndarray, horizon: float, begun: Made | None, is_scaled: bool
) -> Made | None:
    cached = cached_tables(system)
    key = p[: system.layout.parameters].tobytes(), modes.tobytes(), horizon, is_scaled
    found = cached.get(key)
    if found is None:
        found = linear_tables(system, modes, p, horizon, begun, is_scaled)
        if found is None:
            return None
        cached.store(key, found, begun)  # it replaces tables of fewer modes at the same values
    return found
