"""This module converts a mechanical system to arrays for time stepping, including the factored step matrix.

For a step h of the theta scheme A = M + h theta C + h^2 theta^2 K maps forces to changes of the velocities. A
is close to M, so that the entries of W A^-1 W^T decrease by about (h omega)^2 from neighbour to neighbour.
Entries far below rounding are dropped, so that a sweep costs a few products per contact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hybridsim.errors import UsageError
from hybridsim.expr.evaluate import evaluate
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.mechanics.series_loop.mechanical_arrays import (
    Laws,
    bases,
    forcing,
    integers,
    law_tapes,
    parts,
    rates_of,
    sides,
    stick_limits,
)

_DROPPED = 1e-18  # relative to the diagonal entries
_CHUNK = 256  # right-hand sides solved at a time


class Stepped(NamedTuple):
    """The arrays that are constant in a run; sparse matrices are (ptr, col, val), in the declared order."""

    k_ptr: np.ndarray  # k: K
    k_col: np.ndarray
    k_val: np.ndarray
    c_ptr: np.ndarray  # c: C
    c_col: np.ndarray
    c_val: np.ndarray
    w_ptr: np.ndarray  # w: directions of the contacts, then of the impacts
    w_col: np.ndarray
    w_val: np.ndarray
    g_ptr: np.ndarray  # g: W A^-1 W^T
    g_col: np.ndarray
    g_val: np.ndarray
    l_ptr: np.ndarray  # l: lower factor of A by columns, without its unit diagonal
    l_row: np.ndarray
    l_val: np.ndarray
    u_ptr: np.ndarray  # u: upper factor of A by columns, with the diagonal last
    u_row: np.ndarray
    u_val: np.ndarray
    row: np.ndarray  # permutations of the factors
    column: np.ndarray
    still: np.ndarray  # this and the next six as in `MechanicalArrays`, but forces
    h_ptr: np.ndarray
    h_rate: np.ndarray
    h_val: np.ndarray
    rates: np.ndarray
    base: np.ndarray
    base_rate: np.ndarray
    limits: np.ndarray  # (m, 2) stick limits, forward and backward
    onset: np.ndarray  # (m, 2) slip forces at v = 0
    tape: np.ndarray  # as in `MechanicalArrays`
    par: np.ndarray  # as in `MechanicalArrays`
    gap: np.ndarray  # of the impacts
    restitution: np.ndarray  # of the impacts


def build_stepped(system: MechanicalSystem, step: float, theta: float) -> tuple[Stepped, Laws]:
    """Convert a mechanical system to arrays for steps of one length.

    Raises
    ------
    UsageError
        If the matrix of the step is singular.
    """
    n, contacts = system.n, list(system.contacts)
    A = sparse.csc_array(system.M + step * theta * system.C + (step * theta) ** 2 * system.K)
    try:
        factors = splu(A)
    except RuntimeError:
        raise UsageError(
            f"{system.name}: M + h theta C + (h theta)^2 K is singular", remedy="use masses above zero"
        ) from None
    W = directions(system)
    lower = sparse.csc_array(sparse.tril(factors.L, -1))
    upper = sparse.csc_array(factors.U)
    upper.sort_indices()
    rates = rates_of(system)
    still, harmonics = forcing(system, sparse.eye_array(n, format="csr"), np.arange(n), rates)
    laws, tape, par, _ = law_tapes(contacts)
    arrays = Stepped(
        *parts(system.K), *parts(system.C), *parts(W), *parts(_delassus(W, factors)), *parts(lower.T), *parts(upper.T),
        integers(factors.perm_r), integers(factors.perm_c), still, *harmonics, np.array(rates, dtype=float),
        *bases(contacts, rates), stick_limits(contacts)[0], _onsets(contacts), tape, par,
        np.array([i.gap for i in system.impacts], dtype=float),
        np.array([i.restitution for i in system.impacts], dtype=float),
    )  # fmt: skip
    return arrays, laws


def directions(system: MechanicalSystem) -> Any:
    """Return the weights of the contacts, then of the impacts (m, n), as a sparse matrix."""
    every = [c.direction for c in system.all_contacts]
    rows = np.repeat(np.arange(len(every)), [len(d) for d in every]).astype(np.int64)
    cols = np.array([i for d in every for i, _ in d], dtype=np.int64)
    return sparse.csr_array(
        (np.array([w for d in every for _, w in d]), (rows, cols)), shape=(len(every), system.n)
    )


def _delassus(W: Any, factors: Any) -> Any:
    """Return the Delassus matrix W A^-1 W^T without entries that are negligible next to the diagonal."""
    m = W.shape[0]
    columns, diagonal = [], np.zeros(m)
    for first in range(0, m, _CHUNK):
        last = min(first + _CHUNK, m)
        block = W @ factors.solve(W[first:last].toarray().T)
        diagonal[first:last] = block[np.arange(first, last), np.arange(last - first)]
        block[np.abs(block) < _DROPPED * np.abs(diagonal[first:last])] = 0.0
        columns.append(sparse.csc_array(block))
    if not columns:
        return sparse.csr_array((0, 0))
    G = sparse.coo_array(sparse.hstack(columns))
    size = np.sqrt(np.abs(diagonal))
    is_significant = np.abs(G.data) >= _DROPPED * size[G.row] * size[G.col]
    return sparse.csr_array(
        (G.data[is_significant], (G.row[is_significant], G.col[is_significant])), shape=(m, m)
    )


def _onsets(contacts: list[Any]) -> np.ndarray:
    found = np.zeros((len(contacts), 2))
    for i, contact in enumerate(contacts):
        arguments = {"N": contact.normal, **contact.values(), "v": 0.0}
        found[i] = [evaluate(slip, arguments) for slip, _ in sides(contact.law)]
    return found
