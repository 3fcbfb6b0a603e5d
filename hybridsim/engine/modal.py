"""Block diagonalisation of a real matrix: blocks with closed forms of their exponentials, a well conditioned basis.

Eigenvalues that belong to (nearly) parallel eigenvectors share a block, whose basis is an orthonormal basis of their
invariant subspace (C. A. Bavely and G. W. Stewart, SIAM J. Numer. Anal. 16 (1979) 359, doi:10.1137/0716028). In the
worst case all of them share one, and the basis is that of the Schur form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

_CONDITION = 1e3  # of the basis, at most: so many roundings of the state does the change of basis cost
_SWEEPS = 8  # of balancing


@dataclass(frozen=True)
class Modal:
    """x' = A x in coordinates c = inverse x, x = Re(basis c), c' = B c with B upper triangular in blocks.

    Of a block and its conjugate one is kept, with twice its basis. `values` (J,) is the diagonal of B, `upper` (J, J)
    the rest of it, `ends` (J,) the end of the block that each coordinate belongs to, full_basis (m, J), inverse (J, m).
    growth and speeds (J,) are those of the block: |exp(B s)| <= exp(growth s) for s >= 0, and |B|.
    """

    values: np.ndarray
    upper: np.ndarray
    ends: np.ndarray
    full_basis: np.ndarray
    inverse: np.ndarray
    growth: np.ndarray
    speeds: np.ndarray


@dataclass(frozen=True)
class _Cluster:
    """Eigenvalues that share a block: numbers of those with imaginary part >= 0; folded: with their conjugates."""

    members: tuple[int, ...]
    folded: bool  # real eigenvalues are


def modal(A: np.ndarray, horizon: float = math.inf) -> Modal:
    """Block diagonal form of a square real matrix (m, m), for times up to about `horizon`."""
    scale = _balance(A, 1.0 / horizon)
    balanced = A * scale[None, :] / scale[:, None]
    values, vectors = np.linalg.eig(balanced)
    partners = _partners(values)
    clusters = [_Cluster((i,), partners[i] == i) for i in range(len(A)) if values[i].imag >= 0.0]
    blocks = [
        (np.array([[values[i]]], dtype=complex), vectors[:, [i]].astype(complex))
        for (i,) in (c.members for c in clusters)
    ]
    while not _condition(clusters, blocks) <= _CONDITION and not (len(clusters) == 1 and clusters[0].folded):
        clusters = _merged(clusters, values)
        blocks = [_block(balanced, c, values, partners) for c in clusters]
    return _joined(clusters, blocks, scale)


def _partners(values: np.ndarray) -> list[int]:
    """The number of each eigenvalue's conjugate, its own for a real one; LAPACK gives exact pairs in a row."""
    partners = list(range(len(values)))
    for i, value in enumerate(values):
        if value.imag > 0.0:
            partners[i], partners[i + 1] = i + 1, i
    return partners


def _balance(A: np.ndarray, slowest: float) -> np.ndarray:
    """Powers of two that make rows and columns of D^-1 A D about equally large (E. E. Osborne, J. ACM 7 (1960) 338).

    Their 2-norms, with the diagonal: without it couplings that are nothing beside the diagonal would be blown up, and
    its roundings with them (R. James, J. Langou and B. R. Lowery, arXiv:1401.5766). So would those below the rate
    `slowest`, which do nothing over the time at hand: exponentials that are 1 but for little would have to cancel.
    """
    scale = np.ones(len(A))
    size = np.abs(A) + slowest * np.eye(len(A))
    for _ in range(_SWEEPS):
        for i in range(len(A)):
            others = np.arange(len(A)) != i
            if not size[i, others].any() or not size[others, i].any():
                continue
            factor = 2.0 ** round(0.5 * np.log2(np.linalg.norm(size[i]) / np.linalg.norm(size[:, i])))
            scale[i] *= factor
            size[:, i] *= factor
            size[i] /= factor
    return scale


def _full(clusters: list[_Cluster], blocks: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The whole basis: that of each block, and after it the conjugate of one that is not its own."""
    parts = [
        vectors if c.folded else np.concatenate([vectors, vectors.conj()], axis=1)
        for c, (_, vectors) in zip(clusters, blocks, strict=True)
    ]
    return np.concatenate(parts, axis=1)


def _condition(clusters: list[_Cluster], blocks: list[tuple[np.ndarray, np.ndarray]]) -> float:
    basis = _full(clusters, blocks)
    return float(np.linalg.cond(basis)) if basis.shape[0] == basis.shape[1] else np.inf


def _merged(clusters: list[_Cluster], values: np.ndarray) -> list[_Cluster]:
    """The two closest clusters in one; or one that is closest to its own conjugate, folded."""
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


def _block(
    A: np.ndarray, cluster: _Cluster, values: np.ndarray, partners: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """The triangular block of a cluster, and an orthonormal basis of its invariant subspace."""
    from scipy.linalg import schur

    members = list(cluster.members)
    if cluster.folded:
        members += [partners[i] for i in members if partners[i] != i]
    others = [i for i in range(len(A)) if i not in members]

    def inside(value: complex) -> bool:
        return not others or bool(
            np.abs(values[members] - value).min() < np.abs(values[others] - value).min()
        )

    triangular, vectors, count = schur(A.astype(complex), output="complex", sort=inside)
    return triangular[:count, :count], vectors[:, :count]


def _joined(
    clusters: list[_Cluster], blocks: list[tuple[np.ndarray, np.ndarray]], scale: np.ndarray
) -> Modal:
    """All blocks as arrays, one for each pair of conjugates."""
    inverse = np.linalg.inv(_full(clusters, blocks))
    kept = sum(len(block) for block, _ in blocks)
    values, ends = np.empty(kept, dtype=complex), np.empty(kept, dtype=np.int64)
    upper = np.zeros((kept, kept), dtype=complex)
    basis, rows = np.empty((len(scale), kept), dtype=complex), np.empty((kept, len(scale)), dtype=complex)
    growth, speeds = np.empty(kept), np.empty(kept)
    at = source = 0
    for cluster, (block, vectors) in zip(clusters, blocks, strict=True):
        size = len(block)
        if size == 0:  # two orders of arithmetic tell eigenvalues that nearly coincide apart differently
            continue
        here = slice(at, at + size)
        values[here], ends[here], upper[here, here] = np.diag(block), at + size, np.triu(block, 1)
        basis[:, here] = vectors if cluster.folded else 2.0 * vectors
        rows[here] = inverse[source : source + size]
        growth[here] = np.linalg.eigvalsh(0.5 * (block + block.conj().T)).max()
        speeds[here] = np.linalg.norm(block, 2)
        at, source = at + size, source + (size if cluster.folded else 2 * size)
    return Modal(values, upper, ends, basis * scale[:, None], rows / scale[None, :], growth, speeds)
