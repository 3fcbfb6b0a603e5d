"""Block diagonalisation of a real matrix with a well-conditioned basis and closed-form block exponentials.

Eigenvalues that belong to (nearly) parallel eigenvectors share a block, whose basis is an orthonormal basis
of their invariant subspace (C. A. Bavely and G. W. Stewart, SIAM J. Numer. Anal. 16 (1979) 359,
doi:10.1137/0716028). In the worst case all eigenvalues share one block, and the basis is that of the Schur
form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.linear.diagonal import (
    CONDITION,
    Balanced,
    balance,
    check_eigenvectors,
    layout_of_balanced,
    real_columns,
    write_diagonal,
)
from hybridsim.engine.linear.lapack import eigenvectors, inverse_matrices
from hybridsim.engine.linear.small_entries import with_small_rows
from hybridsim.engine.native.array_layout import ArrayLayout, release
from hybridsim.engine.native.kernels import Precompiled

_balance, _real_columns = Precompiled(balance), Precompiled(real_columns)
_check_eigenvectors, _diagonal = Precompiled(check_eigenvectors), Precompiled(write_diagonal)


@dataclass(frozen=True)
class Modal:
    """The system x' = A x in modal coordinates c: x = Re(basis c), c' = B c, with block triangular B.

    Of a block and its conjugate one is stored, with twice its basis. |exp(B s)| <= exp(growth s) for s >= 0.
    """

    values: np.ndarray  # (J,) diagonal of B
    upper: np.ndarray  # (J, J) strictly upper part of B
    ends: np.ndarray  # (J,) end of the block of each coordinate
    full_basis: np.ndarray  # (m, J)
    inverse: np.ndarray  # (J, m)
    growth: np.ndarray  # (J,) growth rate of the block of each coordinate
    speeds: np.ndarray  # (J,) |B| of the block of each coordinate

    def power(self, exponent: int) -> np.ndarray:
        """Return the norm of the power B**exponent, separately for the block of each coordinate."""
        with np.errstate(over="ignore"):  # an infinite bound decides nothing
            result, first = self.speeds**exponent, 0
        while first < len(result):
            end = int(self.ends[first])
            if end > first + 1:
                here = slice(first, end)
                block = np.diag(self.values[here]) + self.upper[here, here]
                result[here] = np.linalg.norm(np.linalg.matrix_power(block, exponent), 2)
            first = end
        return result


@dataclass(frozen=True)
class _Cluster:
    """A cluster of eigenvalues that share a block; complex pairs are listed once."""

    members: tuple[int, ...]
    folded: bool  # True for real eigenvalues


class _Block(NamedTuple):
    """The triangular block of a cluster of eigenvalues, with the basis of its invariant subspace.

    vectors: an orthonormal basis of its invariant subspace, real if the block is folded.
    """

    triangular: np.ndarray
    vectors: np.ndarray
    rotation: np.ndarray


class Modals(NamedTuple):
    """Block diagonal forms of many matrices: the fields of `Modal` with a leading axis K, padded with zeros."""

    counts: np.ndarray  # (K,) number of coordinates of each matrix
    values: np.ndarray
    upper: np.ndarray
    ends: np.ndarray
    full_basis: np.ndarray
    inverse: np.ndarray
    growth: np.ndarray
    speeds: np.ndarray
    powers: np.ndarray  # (K, J) |B**exponent| of the block of each coordinate, for the requested exponent


def modal(A: np.ndarray, horizon: float = math.inf) -> Modal:
    """Return the block diagonal form of a square real matrix (m, m), for times up to about `horizon`."""
    found, _ = modals(np.ascontiguousarray(A[None]), horizon)
    return Modal(*(getattr(found, name)[0] for name in Modals._fields[1:-1]))


def modals(
    A: np.ndarray, horizon: float = math.inf, exponent: int = 1, multiple: int = 1, least: int = 0
) -> tuple[Modals, int]:
    """Return the block diagonal forms of many matrices (K, m, m), padded to a common size, and this size."""
    count, size, others = *A.shape[:2], {}
    found: Balanced = layout_of_balanced(count, size).zeros()
    _balance(A, horizon, found)
    with np.errstate(all="ignore"):
        values, vectors = eigenvectors(found.balanced)
        _real_columns(values, vectors, found)
        inverses = inverse_matrices(found.basis)
    most = _check_eigenvectors(values, vectors, inverses, horizon, found)
    if most < 0:
        for k in np.flatnonzero(~found.is_diagonal).tolist():
            parts = found.balanced[k], values[k], vectors[k], found.scales[k], bool(found.are_right[k])
            others[k] = _by_blocks(*parts)
            found.counts[k] = len(others[k].values)
        most = int(found.counts.max())
    widest = -(-max(most, least) // multiple) * multiple
    result: Modals = _layout(count, size, widest).zeros()
    _diagonal(values, vectors, inverses, exponent, found, result)
    for k, flow in others.items():
        fields = (*vars(flow).values(), flow.power(exponent))
        for name, part in zip(Modals._fields[1:], fields, strict=True):
            getattr(result, name)[k][tuple(slice(0, m) for m in part.shape)] = part
    release(found)
    return result, widest


@lru_cache(64)
def _layout(count: int, size: int, widest: int) -> ArrayLayout:
    """Return the memory layout of the block diagonal forms of several matrices."""
    fields: list[tuple[Any, tuple[int, ...]]] = [
        (np.int64, ()), (complex, (widest,)), (complex, (widest, widest)), (np.int64, (widest,)),
        (complex, (size, widest)), (complex, (widest, size)), *[(float, (widest,))] * 3,
    ]  # fmt: skip
    return ArrayLayout((Modals,), [(dtype, (count, *shape), 0) for dtype, shape in fields])


def _by_blocks(
    balanced: np.ndarray, values: np.ndarray, vectors: np.ndarray, scale: np.ndarray, are_right: bool
) -> Modal:
    """Merge eigenvalues into common blocks until the basis is well conditioned."""
    if not are_right:
        values = _schur_values(balanced)
    partners = _partners(values)
    clusters = [_Cluster((i,), partners[i] == i) for i in range(len(values)) if values[i].imag >= 0.0]
    known: dict[_Cluster, _Block] = {}  # each merge changes one or two clusters, the others stay

    def found(cluster: _Cluster) -> _Block:
        if cluster not in known:
            known[cluster] = _block(balanced, cluster, values, partners)
        return known[cluster]

    if are_right:
        first = [vectors[:, list(c.members)] for c in clusters]
        blocks = [
            _Block(values[list(c.members), None], v.real if c.folded else v, np.eye(1))
            for c, v in zip(clusters, first, strict=True)
        ]
    else:
        blocks = [found(c) for c in clusters]
    if not _condition(clusters, blocks) <= CONDITION:
        clusters = _equal_combined(clusters, values)
        blocks = [found(c) for c in clusters]
    while not _condition(clusters, blocks) <= CONDITION and not (len(clusters) == 1 and clusters[0].folded):
        clusters = _combined(clusters, values)
        blocks = [found(c) for c in clusters]
    return _joined(balanced, clusters, blocks, scale)


def _schur_values(A: np.ndarray) -> np.ndarray:
    """Return the eigenvalues from the Schur form of A without balancing; conjugate pairs are adjacent."""
    from scipy.linalg import schur

    triangular = schur(A, output="real")[0]
    values = np.diag(triangular).astype(complex)
    for i in np.flatnonzero(np.diag(triangular, -1)):  # LAPACK's 2x2 blocks have equal diagonals
        speed = math.sqrt(abs(triangular[i, i + 1])) * math.sqrt(abs(triangular[i + 1, i]))
        values[i : i + 2] += [1j * speed, -1j * speed]
    return values


def _partners(values: np.ndarray) -> list[int]:
    """Return the index of the complex conjugate of each eigenvalue; a real eigenvalue is its own conjugate."""
    partners = list(range(len(values)))
    for i, value in enumerate(values):
        if value.imag > 0.0:
            partners[i], partners[i + 1] = i + 1, i
    return partners


def _columns(clusters: list[_Cluster], blocks: list[_Block]) -> np.ndarray:
    """Return the matrix of all basis vectors, as real and imaginary parts for complex pairs."""
    parts = [
        b.vectors if c.folded else np.concatenate([b.vectors.real, b.vectors.imag], axis=1)
        for c, b in zip(clusters, blocks, strict=True)
    ]
    return np.concatenate(parts, axis=1)


def _condition(clusters: list[_Cluster], blocks: list[_Block]) -> float:
    basis = _columns(clusters, blocks)
    return float(np.linalg.cond(basis)) if basis.shape[0] == basis.shape[1] else np.inf


def _equal_combined(clusters: list[_Cluster], values: np.ndarray) -> list[_Cluster]:
    """Merge clusters of the same eigenvalue, which no Schur form separates."""
    while True:
        first: dict[complex, int] = {}
        for i, cluster in enumerate(clusters):
            j = first.setdefault(complex(values[cluster.members[0]]), i)
            if j < i:
                break
        else:
            return clusters
        joined = _Cluster(cluster.members + clusters[j].members, cluster.folded or clusters[j].folded)
        clusters = [*(c for k, c in enumerate(clusters) if k not in (i, j)), joined]


def _combined(clusters: list[_Cluster], values: np.ndarray) -> list[_Cluster]:
    """Merge the two closest clusters of eigenvalues, or a cluster with its own complex conjugate."""
    best, pair = np.inf, (0, 0)
    for i, a in enumerate(clusters):
        upper = values[list(a.members)]
        if not a.folded and 2.0 * upper.imag.min() < best:
            best, pair = 2.0 * upper.imag.min(), (i, i)
        for j in range(i):
            gap = np.abs(upper[:, None] - values[list(clusters[j].members)][None, :]).min()
            if gap < best:
                best, pair = gap, (i, j)
    i, j = pair
    if i == j:
        joined = _Cluster(clusters[i].members, True)
    else:
        joined = _Cluster(clusters[i].members + clusters[j].members, clusters[i].folded or clusters[j].folded)
    return [*(c for k, c in enumerate(clusters) if k not in pair), joined]


def _block(A: np.ndarray, cluster: _Cluster, values: np.ndarray, partners: list[int]) -> _Block:
    """Return the triangular block of an eigenvalue cluster, or an empty block if the cluster cannot be separated."""
    from scipy.linalg import rsf2csf, schur

    members = list(cluster.members)
    if cluster.folded:
        members += [partners[i] for i in members if partners[i] != i]
    others = [i for i in range(len(A)) if i not in members]

    def inside(real: complex, imaginary: float = 0.0) -> bool:
        far = np.abs(values - (real + 1j * imaginary))
        return not others or bool(far[members].min() < far[others].min())

    try:
        if not cluster.folded:
            triangular, vectors, count = schur(A.astype(complex), output="complex", sort=inside)
            return _Block(triangular[:count, :count], vectors[:, :count], np.eye(count))
        triangular, vectors, count = schur(A, output="real", sort=inside)
    except np.linalg.LinAlgError:  # rounding hides the difference from the others
        return _Block(np.empty((0, 0)), np.empty((len(A), 0)), np.empty((0, 0)))
    triangular, rotation = rsf2csf(triangular[:count, :count], np.eye(count))
    return _Block(triangular, vectors[:, :count], rotation)


def _joined(A: np.ndarray, clusters: list[_Cluster], blocks: list[_Block], scale: np.ndarray) -> Modal:
    """Join all triangular blocks to arrays, with one block for each conjugate pair."""
    inverse = np.linalg.inv(_columns(clusters, blocks))
    width = sum(len(b.triangular) for b in blocks)
    values, ends = np.empty(width, dtype=complex), np.empty(width, dtype=np.int64)
    upper = np.zeros((width, width), dtype=complex)
    basis, rows = np.empty((len(scale), width), dtype=complex), np.empty((width, len(scale)), dtype=complex)
    growth, speeds = np.empty(width), np.empty(width)
    at = source = 0
    for cluster, (block, vectors, rotation) in zip(clusters, blocks, strict=True):
        size = len(block)
        if (
            size == 0
        ):  # nearly equal eigenvalues may be separated in one order of arithmetic and not in another
            continue
        here = slice(at, at + size)
        values[here], ends[here], upper[here, here] = np.diag(block), at + size, np.triu(block, 1)
        columns, own = vectors @ rotation, inverse[source : source + size]
        source += size
        if cluster.folded:
            own = rotation.conj().T @ own
        else:
            columns, own = 2.0 * columns, 0.5 * (own - 1j * inverse[source : source + size])
            source += size
        basis[:, here] = with_small_rows(A, columns, block)
        rows[here] = with_small_rows(A.T, own.T, block.T).T
        growth[here] = np.linalg.eigvalsh(0.5 * (block + block.conj().T)).max()
        speeds[here] = np.linalg.norm(block, 2)
        at += size
    return Modal(values, upper, ends, basis * scale[:, None], rows / scale[None, :], growth, speeds)
