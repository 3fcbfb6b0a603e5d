"""This module records the computation of the matrices of linear modes, and repeats it for other parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from hybridsim.engine.linear.form import Atoms
from hybridsim.engine.linear.modes import LinearMode, NoMode, modes_of, single_changes
from hybridsim.engine.linear.recipe import Numbers, Recipe
from hybridsim.engine.linear.table_rows import leave_out
from hybridsim.engine.linear.terms import Form, Key, Monomial
from hybridsim.engine.native.kernels import Precompiled, kernel
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.system import System
from hybridsim.forks import SharedLock

_MAX_TEMPLATES = 16  # most templates per structure and modes; templates differ in zeros or conditions
_MAX_MODE_SETS = 64  # most sets of modes with cached templates

Entries = np.ndarray  # (2, entries): place of each entry, and the register of its value

_lock = SharedLock()


class MatrixTemplate:
    """The matrices of some linear modes, computed from parameters by a recorded computation.

    begun: a template of the first of these vectors, at values for which it holds; the other vectors are added to
    it.
    """

    def __init__(
        self, system: System, met: np.ndarray, p: np.ndarray, begun: MatrixTemplate | None = None
    ) -> None:
        if begun is None:
            self._numbers, self._atoms = Numbers(p[: system.layout.parameters].tolist()), Atoms()
            self._modes: list[LinearMode | NoMode] = []
            known = self._first_read(system, met)
        else:
            self._numbers, self._atoms, self._modes = begun._numbers, begun._atoms, list(begun._modes)
            known = begun._monomials
        numbers, atoms, modes = self._numbers, self._atoms, self._modes
        read = modes_of(system, atoms, met, numbers.inputs, len(modes))
        modes += read
        monomials = atoms.closure({*known, *(m for mode in read for m in mode.monomials())})
        products = sorted({product for mode in modes for product in mode.products()})
        factors = sorted({key for product in products for key in product.factors()}, key=_order_of_factors)
        n, guards = system.n, system.guard_count
        size, rows = n + len(monomials), guards + len(factors)
        place: dict[Any, int] = {i: i for i in range(n)} | {m: n + k for k, m in enumerate(monomials)}
        place |= {product: size + q for q, product in enumerate(products)}
        motion = [(place[m], atoms.derivative(m)) for m in monomials]  # the same in all modes

        def entries(rows: Iterable[tuple[int, Form]], width: int) -> Entries:
            """Return the row-major positions of the matrix entries, and the registers of their values."""
            found = [
                (row * width + place[k], numbers.place(w)) for row, form in rows for k, w in form.items()
            ]
            return np.array(found, dtype=np.int64).reshape(-1, 2).T.copy()

        self._n, self._shape, self._products = n, (len(met), rows, size), products
        self._monomials: list[Monomial] = monomials
        first, self._flow, self._guards = 0, entries((), size), entries((), size)
        if begun is not None and begun._monomials == monomials and begun._products == products:
            first, self._flow, self._guards = begun._shape[0], begun._flow, begun._guards
        new = [(k, modes[k]) for k in range(first, len(met))]
        flow = entries(
            ((k * size + row, form) for k, mode in new for row, form in [*enumerate(mode.rates), *motion]),
            size,
        )
        of_factors: list[tuple[int, Form]] = [(guards + f, {key: 1.0}) for f, key in enumerate(factors)]
        active = entries(
            ((k * rows + g, form) for k, mode in new for g, form in [*mode.guards.items(), *of_factors]),
            size + len(products),
        )
        self._flow = np.concatenate([self._flow, flow], axis=1)
        self._guards = np.concatenate([self._guards, active], axis=1)
        used = sorted({a for m in monomials for a, _ in m})
        met_atoms = [atoms.known[a] for a in used]
        terms = [term for a in met_atoms for term in a.terms]
        computed = [
            *(a.rate for a in met_atoms),
            *(a.offset for a in met_atoms),
            *(weight for _, weight in terms),
        ]
        self._computed = np.array([numbers.place(value) for value in computed], dtype=np.int64)
        self._fixed = (
            np.array([a.kind for a in met_atoms], dtype=np.int64),
            np.cumsum([0, *(len(a.terms) for a in met_atoms)]).astype(np.int64),
            np.array([source for source, _ in terms], dtype=np.int64),
            _factors([[2 * used.index(a) + part for a, part in m] for m in monomials], 2 * len(met_atoms)),
            np.array([system.layout.phases_at, system.layout.signals_at], dtype=np.int64),
            _factors(
                [[guards + factors.index(key) for key in product.factors()] for product in products], -1
            ),
        )
        self.recipe: Recipe = Recipe(numbers, None if begun is None else begun.recipe)

    def _first_read(self, system: System, met: np.ndarray) -> Iterable[Monomial]:
        """Return the functions of time in a fixed order, whichever modes a run enters first.

        The order of sums depends on it. If all mode vectors are entered, they are read in their order.
        Otherwise vectors that differ in one component come first; they contain almost all functions of time.
        """
        if len(met) == math.prod(len(a.modes) for a in system.automata):
            return ((),)
        read = modes_of(system, self._atoms, single_changes(system), self._numbers.inputs)
        return {(), *(m for mode in read for m in mode.monomials())}

    def matrices(self, registers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the matrices A of the flows y' = A y, the coefficients of the guards, and a mask of the usable modes.

        registers (points, R): the matrices of all points are stacked along the first axis. See `leave_out`. A guard has
        coefficients of y and of the products. Further guards are the factors of products.
        """
        (count, guards, size), points = self._shape, len(registers)
        A = np.zeros((points * count, size, size))
        rows = np.zeros((points * count, guards, size + len(self._products)))
        usable = np.empty(points * count, dtype=np.bool_)
        _put_entries(registers, self._flow, self._guards, self._n, A, rows, usable)
        return A, rows, usable

    def atoms(self, registers: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the basic functions of time and their monomials as arrays, in the order of `LinearTables`.

        The last arrays are the range of angles in the run-time vector, and the factors of the products.
        """
        kinds, term_start, sources, factors, angles, products = self._fixed
        found, count = registers.take(self._computed, -1), len(kinds)
        rates, offsets, weights = found[..., :count], found[..., count : 2 * count], found[..., 2 * count :]
        return kinds, rates, offsets, term_start, sources, weights, factors, angles, products


@kernel
def put_entries(registers: Any, flow: Any, guards: Any, n: int, A: Any, rows: Any, usable: Any) -> None:
    """Write the matrices for all rows of registers, and a mask of the modes whose matrices are finite."""
    for entries, out in ((flow, A.reshape(-1)), (guards, rows.reshape(-1))):
        size = out.shape[0] // registers.shape[0]
        for point in range(registers.shape[0]):
            for j in range(entries.shape[1]):
                out[point * size + entries[0, j]] = registers[point, entries[1, j]]
    leave_out(A, rows, n, usable)


_put_entries = Precompiled(put_entries)


def _order_of_factors(key: Key) -> tuple[bool, Any]:
    """Return a key for sorting, with states before functions of time."""
    return isinstance(key, tuple), key


def _factors(monomials: Sequence[Sequence[int]], one: int) -> np.ndarray:
    """Return the factors of each monomial, padded to equal length with the number `one`."""
    factors = np.full((len(monomials), max(map(len, monomials), default=0)), one, dtype=np.int64)
    for row, monomial in zip(factors, monomials, strict=True):
        row[: len(monomial)] = monomial
    return factors


templates_of = per_structure(lambda system: dict[bytes, list[MatrixTemplate]]())  # by their mode vectors


def template_of(system: System, met: np.ndarray, p: np.ndarray) -> tuple[MatrixTemplate, np.ndarray]:
    """Return the matrix template of some modes at the parameters `p`, and its computed values."""
    cached, key = templates_of(system), met.tobytes()
    inputs = p[: system.layout.parameters]
    with _lock:
        while len(cached) >= _MAX_MODE_SETS and key not in cached:
            del cached[next(iter(cached))]
        templates = cached.setdefault(key, [])
        found = _that_holds(templates, inputs)
        if found is None:
            begun = _begun(cached, met, inputs)
            found = _with_values(MatrixTemplate(system, met, p, begun), inputs)
            if found is None:  # otherwise new entries would have the values of the earlier template
                found = _with_values(MatrixTemplate(system, met, p), inputs)
                assert found is not None  # its comparisons were recorded at these inputs
            if len(templates) >= _MAX_TEMPLATES:
                templates.clear()
            templates.append(found[0])
    return found


def _with_values(template: MatrixTemplate, inputs: np.ndarray) -> tuple[MatrixTemplate, np.ndarray] | None:
    registers = template.recipe.values(inputs)
    return None if registers is None else (template, registers)


def _that_holds(
    templates: Iterable[MatrixTemplate], inputs: np.ndarray
) -> tuple[MatrixTemplate, np.ndarray] | None:
    """Return the first template that is valid for the given inputs, and its computed values."""
    for template in templates:
        registers = template.recipe.values(inputs)
        if registers is not None:
            return template, registers
    return None


def _begun(
    cached: dict[bytes, list[MatrixTemplate]], met: np.ndarray, inputs: np.ndarray
) -> MatrixTemplate | None:
    """Return the cached template that covers as many of the given modes as possible."""
    whole = met.tobytes()
    for key in sorted((key for key in cached if whole.startswith(key)), key=len, reverse=True):
        found = _that_holds(cached[key], inputs)
        if found is not None:
            return found[0]
    return None
