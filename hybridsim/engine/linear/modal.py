"""Block diagonalisation of a real matrix: blocks with closed forms of their exponentials, a well conditioned basis.

Eigenvalues that belong to (nearly) parallel eigenvectors share a block, whose basis is an orthonormal basis of their
invariant subspace (C. A. Bavely and G. W. Stewart, SIAM J. Numer. Anal. 16 (1979) 359, doi:10.1137/0716028). In the
worst case all of them share one, and the basis is that of the Schur form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.linear.faint_entries import with_faint_rows
from hybridsim.engine.native.kernels import kernel

_CONDITION = 1e2  # of the basis, at most: so many roundings of the state does the change of basis cost
_MISSED = 2.0**-48  # of the largest entry: by how much A v may differ from lambda v
_GROWING, _SILENT = 3.0, 1e-12  # rates that matter: times the time at hand, and of the largest entry
_SLOWEST = 4.0  # over the horizon: the time at hand is 1 to 1/16 of it, and powers of the time have units of their own
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

    def power(self, exponent: int) -> np.ndarray:
        """|B**exponent| (J,) of the block of each coordinate."""
        with np.errstate(over="ignore"):  # a bound of infinity is one that nothing is decided by
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
    """Eigenvalues that share a block: numbers of those with imaginary part >= 0; folded: with their conjugates."""

    members: tuple[int, ...]
    folded: bool  # real eigenvalues are


class _Block(NamedTuple):
    """A cluster's triangular block, for the basis `vectors @ rotation`.

    vectors: an orthonormal basis of its invariant subspace, a real one where it is folded.
    """

    triangular: np.ndarray
    vectors: np.ndarray
    rotation: np.ndarray


class Modals(NamedTuple):
    """Block diagonal forms of many matrices: the fields of `Modal` one behind the other, filled up with zeros.

    counts (K,): the coordinates of each. powers (K, J): |B**exponent| of the block, for the exponent that was asked.
    """

    counts: np.ndarray
    values: np.ndarray
    upper: np.ndarray
    ends: np.ndarray
    full_basis: np.ndarray
    inverse: np.ndarray
    growth: np.ndarray
    speeds: np.ndarray
    powers: np.ndarray


def modal(A: np.ndarray, horizon: float = math.inf) -> Modal:
    """Block diagonal form of a square real matrix (m, m), for times up to about `horizon`."""
    return Modal(*(field[0] for field in modals(A[None], horizon)[1:-1]))


def modals(
    A: np.ndarray, horizon: float = math.inf, exponent: int = 1, multiple: int = 1, least: int = 0
) -> Modals:
    """The same for many matrices (K, m, m); J is filled up to a multiple, and to `least`."""
    scales = np.ones(A.shape[:2])
    _balance(np.abs(A), _SLOWEST / horizon, scales)
    balanced = A * scales[:, None, :] / scales[:, :, None]
    values, vectors = np.linalg.eig(balanced)
    values, vectors = values.astype(complex, copy=False), vectors.astype(complex, copy=False)
    # Real and imaginary part of an eigenvector stand for it and its conjugate: inverted in complex arithmetic the two
    # would be each other's conjugates only to within the condition of the basis.
    inverses = _inverses(np.where((values.imag < 0.0)[:, None, :], -vectors.imag, vectors.real))
    # the norm of Frobenius bounds that which makes the condition; no column's norm is above 1
    with np.errstate(over="ignore", invalid="ignore"):  # the inverse of what is nearly singular
        is_diagonal = A.shape[1] * (inverses**2).sum(axis=(1, 2)) <= _CONDITION**2
    # LAPACK balances once more, without the diagonal, and of entries that are nothing may make all of an eigenvector
    missed = np.abs(balanced @ vectors - vectors * values[:, None, :]).max(axis=(1, 2), initial=0.0)
    largest = np.abs(balanced).max(axis=(1, 2), initial=0.0)
    are_right = missed <= _MISSED * largest
    # of a motion that grows, rounding in the basis grows too
    grows = values.real.max(axis=1, initial=0.0) > np.maximum(_GROWING / horizon, _SILENT * largest)
    is_diagonal &= are_right & ~grows
    others = {
        int(k): _by_blocks(balanced[k], values[k], vectors[k], scales[k], bool(are_right[k]))
        for k in np.flatnonzero(~is_diagonal)
    }
    counts = (values.imag >= 0.0).sum(axis=1)
    for k, flow in others.items():
        counts[k] = len(flow.values)
    count, size, widest = *A.shape[:2], -(-int(counts.max(initial=least)) // multiple) * multiple
    result = Modals(
        counts,
        np.zeros((count, widest), dtype=complex),
        np.zeros((count, widest, widest), dtype=complex),
        np.zeros((count, widest), dtype=np.int64),
        np.zeros((count, size, widest), dtype=complex),
        np.zeros((count, widest, size), dtype=complex),
        *(np.zeros((count, widest)) for _ in range(3)),
    )
    _diagonal(values, vectors, inverses, scales, is_diagonal, exponent, result)
    for k, flow in others.items():
        for whole, part in zip(result[1:], (*vars(flow).values(), flow.power(exponent)), strict=True):
            whole[k][tuple(slice(0, m) for m in part.shape)] = part
    return result


def _inverses(vectors: np.ndarray) -> np.ndarray:
    """Inverses (K, m, m), infinite for what has none: what is found for one matrix does not depend on the others."""
    try:
        return np.linalg.inv(vectors)
    except np.linalg.LinAlgError:  # of one of them
        if len(vectors) == 1:
            return np.full_like(vectors, np.inf)
        return np.concatenate([_inverses(one[None]) for one in vectors])


@kernel
def _diagonal(
    values: Any, vectors: Any, inverses: Any, scales: Any, chosen: Any, exponent: int, out: Any
) -> None:
    """A block for each eigenvalue, of which LAPACK gives conjugates in a row."""
    for k in range(values.shape[0]):
        if not chosen[k]:
            continue
        j, size = 0, values.shape[1]
        for i in range(size):
            value = values[k, i]
            if not value.imag >= 0.0:
                continue
            twice = 2.0 if value.imag > 0.0 else 1.0
            for m in range(size):
                out.full_basis[k, m, j] = twice * vectors[k, m, i] * scales[k, m]
                imaginary = inverses[k, i + 1, m] if value.imag > 0.0 else 0.0
                out.inverse[k, j, m] = complex(inverses[k, i, m], -imaginary) / (twice * scales[k, m])
            out.values[k, j], out.ends[k, j], out.growth[k, j] = value, j + 1, value.real
            out.speeds[k, j] = abs(value)
            out.powers[k, j] = out.speeds[k, j] ** exponent
            j += 1


def _by_blocks(
    balanced: np.ndarray,
    values: np.ndarray,
    vectors: np.ndarray,
    scale: np.ndarray,
    are_right: bool,
) -> Modal:
    """Eigenvalues in common blocks until the basis is well conditioned."""
    if not are_right:
        values = _schur_values(balanced)
    partners = _partners(values)
    clusters = [_Cluster((i,), partners[i] == i) for i in range(len(values)) if values[i].imag >= 0.0]
    known: dict[_Cluster, _Block] = {}  # one of two is merged at a time, the others stay

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
    while not _condition(clusters, blocks) <= _CONDITION and not (len(clusters) == 1 and clusters[0].folded):
        clusters = _merged(clusters, values)
        blocks = [found(c) for c in clusters]
    return _joined(balanced, clusters, blocks, scale)


def _schur_values(A: np.ndarray) -> np.ndarray:
    """Eigenvalues by the Schur form of A as it is, pairs of conjugates in a row."""
    from scipy.linalg import schur

    triangular = schur(A, output="real")[0]
    values = np.diag(triangular).astype(complex)
    for i in np.flatnonzero(np.diag(triangular, -1)):  # LAPACK's blocks have equal diagonals
        speed = math.sqrt(abs(triangular[i, i + 1])) * math.sqrt(abs(triangular[i + 1, i]))
        values[i : i + 2] += [1j * speed, -1j * speed]
    return values


def _partners(values: np.ndarray) -> list[int]:
    """The number of each eigenvalue's conjugate, its own for a real one; LAPACK gives exact pairs in a row."""
    partners = list(range(len(values)))
    for i, value in enumerate(values):
        if value.imag > 0.0:
            partners[i], partners[i + 1] = i + 1, i
    return partners


@kernel
def _balance(sizes: Any, slowest: float, scales: Any) -> None:
    """Powers of two, in place of ones (k, m), that make rows and columns of D^-1 A D about equally large.

    After E. E. Osborne, J. ACM 7 (1960) 338; sizes (k, m, m), the absolute values of A, are used up.

    Their 2-norms, with the diagonal: without it couplings that are nothing beside the diagonal would be blown up, and
    its roundings with them (R. James, J. Langou and B. R. Lowery, arXiv:1401.5766). So would those below the rate
    `slowest`, which do nothing over the time at hand: exponentials that are 1 but for little would have to cancel.
    """
    for k in range(sizes.shape[0]):
        size, scale = sizes[k], scales[k]
        m = size.shape[0]
        for i in range(m):
            size[i, i] += slowest
        for _ in range(_SWEEPS):
            moved = False
            for i in range(m):
                row = column = 0.0  # the largest entries off the diagonal
                for j in range(m):
                    if j != i:
                        row, column = max(row, size[i, j]), max(column, size[j, i])
                if row == 0.0 and column == 0.0:
                    continue
                row, column = max(row, size[i, i]), max(column, size[i, i])
                if row == 0.0 or column == 0.0:  # over all times
                    continue
                rows = columns = 0.0
                for j in range(m):
                    rows += (size[i, j] / row) ** 2
                    columns += (size[j, i] / column) ** 2
                ratio = (row / column) * math.sqrt(rows / columns)
                if not 0.0 < ratio < math.inf:
                    continue
                steps = round(0.5 * math.log2(ratio))
                if steps != 0:
                    moved = True
                    factor = math.ldexp(1.0, steps)
                    scale[i] *= factor
                    for j in range(m):
                        size[j, i] *= factor
                        size[i, j] /= factor
            if not moved:
                break


def _columns(clusters: list[_Cluster], blocks: list[_Block]) -> np.ndarray:
    """The whole basis: that of each block, real and imaginary parts of one that is not its own conjugate."""
    parts = [
        b.vectors if c.folded else np.concatenate([b.vectors.real, b.vectors.imag], axis=1)
        for c, b in zip(clusters, blocks, strict=True)
    ]
    return np.concatenate(parts, axis=1)


def _condition(clusters: list[_Cluster], blocks: list[_Block]) -> float:
    basis = _columns(clusters, blocks)
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


def _block(A: np.ndarray, cluster: _Cluster, values: np.ndarray, partners: list[int]) -> _Block:
    """The triangular block of a cluster; an empty one where it cannot be told from the others."""
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
    except np.linalg.LinAlgError:  # rounding does not tell them from the others
        return _Block(np.empty((0, 0)), np.empty((len(A), 0)), np.empty((0, 0)))
    triangular, rotation = rsf2csf(triangular[:count, :count], np.eye(count))
    return _Block(triangular, vectors[:, :count], rotation)


def _joined(A: np.ndarray, clusters: list[_Cluster], blocks: list[_Block], scale: np.ndarray) -> Modal:
    """All blocks as arrays, one for each pair of conjugates."""
    inverse = np.linalg.inv(_columns(clusters, blocks))
    kept = sum(len(b.triangular) for b in blocks)
    values, ends = np.empty(kept, dtype=complex), np.empty(kept, dtype=np.int64)
    upper = np.zeros((kept, kept), dtype=complex)
    basis, rows = np.empty((len(scale), kept), dtype=complex), np.empty((kept, len(scale)), dtype=complex)
    growth, speeds = np.empty(kept), np.empty(kept)
    at = source = 0
    for cluster, (block, vectors, rotation) in zip(clusters, blocks, strict=True):
        size = len(block)
        if size == 0:  # two orders of arithmetic tell eigenvalues that nearly coincide apart differently
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
        basis[:, here] = with_faint_rows(A, columns, block)
        rows[here] = with_faint_rows(A.T, own.T, block.T).T
        growth[here] = np.linalg.eigvalsh(0.5 * (block + block.conj().T)).max()
        speeds[here] = np.linalg.norm(block, 2)
        at += size
    return Modal(values, upper, ends, basis * scale[:, None], rows / scale[None, :], growth, speeds)
