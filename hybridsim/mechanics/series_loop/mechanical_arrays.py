"""This module converts a mechanical system to arrays for the kernels, such as matrices and friction laws.

Coordinates that are coupled by the mass matrix, or by a common contact, form a *node*. Coordinates and
contacts are renumbered so that those of a node are consecutive. Accelerations jump within a node only, so
that an event is decided there.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from hybridsim.engine.series.scalar_tape import ScalarTape, is_same, scalar_tape
from hybridsim.errors import ModelError, UsageError
from hybridsim.expr.evaluate import evaluate
from hybridsim.mechanics.declaration.system import Harmonic, MechanicalContact, MechanicalSystem
from hybridsim.mechanics.series_loop.bands import in_bands

MOST_COUPLED = 3000  # largest number of coordinates in a dense inverse of the mass matrix: 72 MB


class MechanicalArrays(NamedTuple):
    """The arrays that are constant in a run; sparse matrices are (ptr, col, val) in node order."""

    node_dof: np.ndarray  # first coordinate of each node
    node_con: np.ndarray  # first contact of each node
    dof_node: np.ndarray  # node of each coordinate
    con_node: np.ndarray  # node of each contact
    k_ptr: np.ndarray  # k: M^-1 K
    k_col: np.ndarray
    k_val: np.ndarray
    c_ptr: np.ndarray  # c: M^-1 C
    c_col: np.ndarray
    c_val: np.ndarray
    b_ptr: np.ndarray  # b: M^-1 W^T (rows: coordinates, columns: contacts)
    b_col: np.ndarray
    b_val: np.ndarray
    w_ptr: np.ndarray  # w: W (rows: contacts)
    w_col: np.ndarray
    w_val: np.ndarray
    g_ptr: np.ndarray  # g: W M^-1 W^T of each node, dense, one after another
    g_val: np.ndarray
    near_ptr: np.ndarray  # neighbours of each node
    near: np.ndarray
    still: np.ndarray  # (n,) constant acceleration
    h_ptr: np.ndarray  # harmonics of each coordinate
    h_rate: np.ndarray  # number of the angular rate
    h_val: np.ndarray  # amplitudes of sine and cosine
    rates: np.ndarray  # angular rates
    base: np.ndarray  # (m, 3) constant, sine, cosine of the speed of each base
    base_rate: np.ndarray  # (m,) number of its rate, or -1 if it is constant
    limits: np.ndarray  # (m, 2) stick limits, forward and backward
    smooth: np.ndarray  # (m, 2) whether the slip force at v = 0 is algebraically equal to the limit
    tape: np.ndarray  # (m, 2) number of the tape of the slip force
    par: np.ndarray  # (m, p) constants of the law
    unit: np.ndarray  # (m,) whether the contact has one weight only
    offsets: np.ndarray  # see `hybridsim.mechanics.series_loop.bands`
    bands: np.ndarray


class Laws(NamedTuple):
    """The instruction tapes of all friction laws, and the registers of their inputs and outputs."""

    rows: np.ndarray
    row_ptr: np.ndarray
    constant_rows: np.ndarray
    constant_ptr: np.ndarray
    registers: np.ndarray
    speed: np.ndarray
    out: np.ndarray
    par_reg: np.ndarray
    par_ptr: np.ndarray
    number_reg: np.ndarray
    number_val: np.ndarray
    number_ptr: np.ndarray


@dataclass(frozen=True)
class Built:
    """The arrays of a system, and the declared numbers of its coordinates and contacts."""

    arrays: MechanicalArrays
    laws: Laws
    dofs: np.ndarray
    contacts: np.ndarray
    is_linear: bool


def build(system: MechanicalSystem) -> Built:
    """Convert a mechanical system to the arrays that the kernels read.

    Raises
    ------
    UsageError
        If the mass matrix couples too many coordinates.
    """
    n, m = system.n, len(system.contacts)
    rows = np.repeat(np.arange(m), [len(c.direction) for c in system.contacts]).astype(np.int64)
    pairs = [pair for c in system.contacts for pair in c.direction]
    cols = np.array([i for i, _ in pairs], dtype=np.int64)
    W = sparse.csr_array((np.array([w for _, w in pairs]), (rows, cols)), shape=(m, n))
    inverse = _inverse(system)
    together = abs(W).T @ abs(W) + abs(inverse)
    count, label = connected_components(together, directed=False)
    first = np.full(count, n)
    np.minimum.at(first, label, np.arange(n))
    rank = np.argsort(np.argsort(first))  # nodes in the order of their first coordinate
    dofs = np.lexsort((np.arange(n), rank[label]))
    node_of = rank[label][dofs]
    owner = rank[label][W.indices[W.indptr[:-1]]] if m else np.zeros(0, dtype=np.int64)
    contacts = np.lexsort((np.arange(m), owner))
    W, inverse = W[contacts][:, dofs], inverse[dofs][:, dofs]
    K, C = inverse @ system.K[dofs][:, dofs], inverse @ system.C[dofs][:, dofs]
    B = sparse.csr_array(inverse @ W.T)
    G = sparse.csr_array(W @ B)
    con_node = owner[contacts].astype(np.int64)
    node_dof = np.searchsorted(node_of, np.arange(count + 1))
    node_con = np.searchsorted(con_node, np.arange(count + 1))
    sizes = np.diff(node_con)
    blocks = [G[a:b, a:b].toarray().ravel() for a, b in pairwise(node_con)]
    rates = rates_of(system)
    still, harmonics = forcing(system, inverse, dofs, rates)
    ordered = [system.contacts[i] for i in contacts]
    laws, tape, par, is_linear = law_tapes(ordered)
    base, base_rate = bases(ordered, rates)
    limits, smooth = stick_limits(ordered)
    single = count == n == m and not rates and len(laws.registers) == 1
    single = single and W.nnz == B.nnz == n and bool((np.diff(node_con) == 1).all())
    banded = in_bands(K, C, B, W, single, base[:, 0], still, par)
    arrays = MechanicalArrays(
        integers(node_dof), integers(node_con), integers(node_of), integers(con_node),
        *parts(K), *parts(C), *parts(B), *parts(W),
        integers(np.concatenate([[0], np.cumsum(sizes**2)])), np.concatenate([np.zeros(0), *blocks]),
        *_neighbours(abs(K) + abs(C), node_of, count), still, *harmonics, np.array(rates, dtype=float),
        base, base_rate, limits, smooth, tape, par, integers(np.diff(W.indptr) == 1), *banded,
    )  # fmt: skip
    return Built(arrays, laws, dofs, contacts, is_linear)


def rates_of(system: MechanicalSystem) -> list[float]:
    """Return all angular frequencies of the system in ascending order."""
    of_forces = {t.omega for terms in system.forcing.values() for t in terms if isinstance(t, Harmonic)}
    return sorted(of_forces | {c.base.omega for c in system.contacts if isinstance(c.base, Harmonic)})


def _inverse(system: MechanicalSystem) -> Any:
    """Return the inverse of the mass matrix; the inverse is sparse if the mass matrix has small blocks."""
    M = system.M
    count, label = connected_components(M, directed=False)
    largest = np.bincount(label).max()
    if largest > MOST_COUPLED:
        raise UsageError(
            f"{system.name}: the mass matrix couples {largest} coordinates; at most {MOST_COUPLED} are supported",
            remedy="lump the masses, so that M is diagonal or has small diagonal blocks",
        )
    if count == system.n:
        return sparse.csr_array(sparse.diags_array(1.0 / M.diagonal()))
    order = np.argsort(label, kind="stable")
    ends = np.concatenate([[0], np.cumsum(np.bincount(label))])
    blocks = (M[order[a:b]][:, order[a:b]].toarray() for a, b in pairwise(ends))
    parts = [sparse.csr_array(np.linalg.inv(block)) for block in blocks]
    back = np.argsort(order)
    return sparse.block_diag(parts, format="csr")[back][:, back]


def integers(values: Any) -> np.ndarray:
    """Return the values as an array of integers for kernels."""
    return np.ascontiguousarray(values, dtype=np.int64)


def parts(matrix: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a sparse matrix in row form as (ptr, col, val)."""
    matrix = sparse.csr_array(matrix)
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return integers(matrix.indptr), integers(matrix.indices), np.ascontiguousarray(matrix.data, dtype=float)


def _neighbours(coupling: Any, node_of: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes that act on each other through stiffness or damping."""
    entries = sparse.coo_array(coupling)
    is_nonzero = entries.data != 0
    a, b = node_of[entries.row[is_nonzero]], node_of[entries.col[is_nonzero]]
    apart = a != b
    graph = sparse.csr_array((np.ones(2 * apart.sum()), (np.r_[a[apart], b[apart]], np.r_[b[apart], a[apart]])),
                             shape=(count, count))  # fmt: skip
    graph.sum_duplicates()
    return integers(graph.indptr), integers(graph.indices)


def forcing(
    system: MechanicalSystem, inverse: Any, dofs: np.ndarray, rates: list[float]
) -> tuple[Any, tuple[Any, Any, Any]]:
    """Return the constant accelerations (n,), and the harmonics (ptr, rate, [sine, cosine])."""
    n, place = system.n, np.argsort(dofs)
    still = np.zeros(n)
    entries: dict[tuple[int, int], np.ndarray] = {}
    for dof, terms in system.forcing.items():
        for term in terms:
            if isinstance(term, Harmonic):
                entry = entries.setdefault((int(place[dof]), rates.index(term.omega)), np.zeros(2))
                entry += (term.sin, term.cos)
            else:
                still[place[dof]] += term
    shape = (n, len(rates))
    both = []
    for part in range(2):
        keys = list(entries)
        matrix = sparse.csr_array(
            (np.array([entries[k][part] for k in keys]), ([k[0] for k in keys], [k[1] for k in keys])), shape=shape
        ) if keys else sparse.csr_array(shape)  # fmt: skip
        both.append((inverse @ matrix).toarray() if keys else np.zeros(shape))
    used = (both[0] != 0) | (both[1] != 0)
    ptr = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
    val = np.stack([both[0][used], both[1][used]], axis=1)
    return inverse @ still, (integers(ptr), integers(np.nonzero(used)[1]), np.ascontiguousarray(val))


def bases(contacts: list[MechanicalContact], rates: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the constant, sine and cosine terms (m, 3) of the base speeds, and the index of each frequency."""
    base, rate = np.zeros((len(contacts), 3)), np.full(len(contacts), -1, dtype=np.int64)
    for i, contact in enumerate(contacts):
        if isinstance(contact.base, Harmonic):
            base[i, 1:], rate[i] = (contact.base.sin, contact.base.cos), rates.index(contact.base.omega)
        else:
            base[i, 0] = contact.base
    return base, rate


def stick_limits(contacts: list[MechanicalContact]) -> tuple[np.ndarray, np.ndarray]:
    """Return the stick limits in both directions, and whether they equal the force at the onset of slip."""
    limits = np.zeros((len(contacts), 2))
    smooth = np.zeros((len(contacts), 2), dtype=np.int64)
    for i, contact in enumerate(contacts):
        law, arguments = contact.law, {"N": contact.normal, **contact.values()}
        for side, (slip, stick) in enumerate(sides(law)):
            limits[i, side] = evaluate(stick, arguments)
            onset = evaluate(slip, {**arguments, "v": 0.0})
            smooth[i, side] = onset == limits[i, side] or is_same(slip, stick, "v")
            if limits[i, side] < 0.0 or onset < 0.0:
                raise ModelError(
                    f"contact {contact.name}: the law '{law.name}' gives a negative force at rest",
                    remedy="write `slip` and `stick` as magnitudes, which are >= 0",
                )
    return limits, smooth


def sides(law: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
    """Return the slip force and the stick limit, in both directions."""
    return (law.slip, law.stick), (law.slip_backward or law.slip, law.stick_backward or law.stick)


def law_tapes(contacts: list[MechanicalContact]) -> tuple[Laws, np.ndarray, np.ndarray, bool]:
    """Return the instruction tapes of the laws, the tape of each contact in each direction, and the constants."""
    tapes: list[ScalarTape] = []
    known: dict[tuple[str, str], int] = {}
    number = np.zeros((len(contacts), 2), dtype=np.int64)
    width = max([len(c.law.parameters) for c in contacts], default=0) + 1
    par = np.zeros((len(contacts), width))
    for i, contact in enumerate(contacts):
        names = tuple(contact.law.parameters)
        values = contact.values()
        par[i, : len(names) + 1] = [contact.normal, *(values[name] for name in names)]
        for side, (slip, _) in enumerate(sides(contact.law)):
            key = (contact.law.name + "/".join(names), slip.text)
            if key not in known:
                known[key] = len(tapes)
                try:
                    tapes.append(scalar_tape(slip, ("v",), ("N", *names), "v"))
                except ModelError as fault:
                    raise ModelError(
                        f"law '{contact.law.name}': {fault.message}", remedy=fault.remedy
                    ) from None
            number[i, side] = known[key]
    laws = Laws(
        *_rows([t.rows for t in tapes]), *_rows([t.constant_rows for t in tapes]),
        integers([t.registers for t in tapes]), integers([t.moving[0] for t in tapes]),
        integers([t.out for t in tapes]), *_flat([t.constants for t in tapes]),
        integers([r for t in tapes for r, _ in t.numbers]), np.array([x for t in tapes for _, x in t.numbers],
        dtype=float), integers(np.concatenate([[0], np.cumsum([len(t.numbers) for t in tapes])])),
    )  # fmt: skip
    return laws, number, par, not any(len(t.rows) for t in tapes)


def _rows(parts: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    stacked = np.concatenate([np.zeros((0, 5), dtype=np.int64), *parts])
    return integers(stacked), integers(np.concatenate([[0], np.cumsum([len(p) for p in parts])]))


def _flat(parts: list[tuple[int, ...]]) -> tuple[np.ndarray, np.ndarray]:
    return integers([r for p in parts for r in p]), integers(
        np.concatenate([[0], np.cumsum([len(p) for p in parts])])
    )
