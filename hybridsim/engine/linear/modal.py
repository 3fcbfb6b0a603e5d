"""Block diagonalisation of a real matrix with a well-conditioned basis and closed-form block exponentials.

Eigenvalues that belong to (nearly) parallel eigenvectors share a block, whose basis is an orthonormal basis
of their invariant subspace (C. A. Bavely and G. W. Stewart, SIAM J. Numer. Anal. 16 (1979) 359,
doi:10.1137/0716028). In the worst case all eigenvalues share one block, and the basis is that of the Schur
form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.linear.small_entries import with_small_rows
from hybridsim.engine.native.kernels import kernel

_CONDITION = 1e2  # largest condition of the basis: factor of rounding errors in a change of basis
_MISSED = 2.0**-48  # largest error of A v - lambda v, relative to the largest entry of A
_GROWING, _SILENT = (
    3.0,
    1e-12,
)  # growth that matters, as a product with the horizon and relative to the largest entry
_SLOWEST = 4.0  # product with the horizon; the run time is 1 to 1/16 of the horizon
_SWEEPS = 8  # most sweeps of balancing


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
    """The triangular block of a cluster, for the basis `vectors @ rotation`.

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
    return Modal(*(field[0] for field in modals(A[None], horizon)[1:-1]))


def modals(
    A: np.ndarray, horizon: float = math.inf, exponent: int = 1, multiple: int = 1, least: int = 0
) -> Modals:
    """Return the block diagonal forms of many matrices (K, m, m), padded to a common size."""
    scales = np.ones(A.shape[:2])
    _balance(np.abs(A), _SLOWEST / horizon, scales)
    balanced = A * scales[:, None, :] / scales[:, :, None]
    values, vectors = np.linalg.eig(balanced)
    values, vectors = values.astype(complex, copy=False), vectors.astype(complex, copy=False)
    # Real and imaginary part of an eigenvector represent it and its conjugate. A complex inverse would make the two
    # conjugates of each other only to within the condition of the basis.
    inverses = _inverses(np.where((values.imag < 0.0)[:, None, :], -vectors.imag, vectors.real))
    # the Frobenius norm bounds the 2-norm of the inverse; no column of the basis has a norm above 1
    with np.errstate(over="ignore", invalid="ignore"):  # inverses of nearly singular matrices
        is_diagonal = A.shape[1] * (inverses**2).sum(axis=(1, 2)) <= _CONDITION**2
    # LAPACK balances again, without the diagonal, so that negligible entries may dominate an eigenvector
    missed = np.abs(balanced @ vectors - vectors * values[:, None, :]).max(axis=(1, 2), initial=0.0)
    largest = np.abs(balanced).max(axis=(1, 2), initial=0.0)
    are_right = missed <= _MISSED * largest
    # rounding errors of the basis grow with a growing motion
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
    """Return inverses of matrices (K, m, m); the inverse of a singular matrix is infinite."""
    try:
        return np.linalg.inv(vectors)
    except np.linalg.LinAlgError:  # one of them is singular
        if len(vectors) == 1:
            return np.full_like(vectors, np.inf)
        return np.concatenate([_inverses(one[None]) for one in vectors])


@kernel
def _diagonal(
    values: Any, vectors: Any, inverses: Any, scales: Any, chosen: Any, exponent: int, out: Any
) -> None:
    """Write one block for each eigenvalue."""
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
    while not _condition(clusters, blocks) <= _CONDITION and not (len(clusters) == 1 and clusters[0].folded):
        clusters = _combined(clusters, values)
        blocks = [found(c) for c in clusters]
    return _joined(balanced, clusters, blocks, scale)


def _schur_values(A: np.ndarray) -> np.ndarray:
    """Return the eigenvalues from the Schur form of A without balancing, with conjugate pairs in a row."""
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


@kernel
def _balance(sizes: Any, slowest: float, scales: Any) -> None:
    """Write powers of two to `scales` that make the rows and columns of D^-1 A D about equally large.

    The method is that of E. E. Osborne, J. ACM 7 (1960) 338. sizes (k, m, m), the absolute values of A, are
    overwritten.

    The 2-norms include the diagonal. Without it, couplings that are negligible compared with the diagonal
    would be scaled up with its roundings (R. James, J. Langou and B. R. Lowery, arXiv:1401.5766). Couplings
    below the rate `slowest` are not scaled up either: they have almost no effect during the run, and
    exponentials close to 1 would have to cancel.
    """
    for k in range(sizes.shape[0]):
        size, scale = sizes[k], scales[k]
        m = size.shape[0]
        for i in range(m):
            size[i, i] += slowest
        for _ in range(_SWEEPS):
            moved = False
            for i in range(m):
                row = column = 0.0  # largest off-diagonal entries
                for j in range(m):
                    if j != i:
                        row, column = max(row, size[i, j]), max(column, size[j, i])
                if row == 0.0 and column == 0.0:
                    continue
                row, column = max(row, size[i, i]), max(column, size[i, i])
                if row == 0.0 or column == 0.0:  # a horizon of infinity
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
    """Return the whole basis, with real and imaginary parts of the blocks of complex pairs."""
    parts = [
        b.vectors if c.folded else np.concatenate([b.vectors.real, b.vectors.imag], axis=1)
        for c, b in zip(clusters, blocks, strict=True)
    ]
    return np.concatenate(parts, axis=1)


def _condition(clusters: list[_Cluster], blocks: list[_Block]) -> float:
    basis = _columns(clusters, blocks)
    return float(np.linalg.cond(basis)) if basis.shape[0] == basis.shape[1] else np.inf


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
    """Return the triangular block of a cluster, or an empty block if it cannot be separated."""
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
    """Return all blocks as arrays, one for each conjugate pair."""
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
