"""This module tests in compiled code whether eigenvectors are a good basis, and writes the diagonal form."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.array_layout import ArrayLayout
from hybridsim.engine.native.kernels import kernel

CONDITION = 1e2  # largest condition of the basis: factor of rounding errors in a change of basis
_MISSED = 2.0**-48  # largest error of A v - lambda v, relative to the largest entry of A
# growth that matters, as a product with the horizon and relative to the largest entry
_GROWING, _SILENT = 3.0, 1e-12
_SLOWEST = 4.0  # product with the horizon; the run time is 1 to 1/16 of the horizon
_SWEEPS = 8  # most sweeps of balancing


class Balanced(NamedTuple):
    """Balanced matrices, their eigenvectors, and whether these form an accurate basis."""

    scales: np.ndarray  # (K, m) the diagonal D
    balanced: np.ndarray  # (K, m, m) D^-1 A D
    basis: np.ndarray  # (K, m, m) real and imaginary parts of the eigenvectors; before that scratch
    counts: np.ndarray  # (K,) number of coordinates
    is_diagonal: np.ndarray  # (K,) whether the eigenvectors are a good basis
    are_right: np.ndarray  # (K,) whether they are accurate


@lru_cache(64)
def layout_of_balanced(count: int, size: int) -> ArrayLayout:
    """Return the layout of `Balanced` for matrices (count, size, size)."""
    fields: list[tuple[Any, tuple[int, ...]]] = [
        (float, (size,)), (float, (size, size)), (float, (size, size)), (np.int64, ()), (np.bool_, ()), (np.bool_, ()),
    ]  # fmt: skip
    return ArrayLayout((Balanced,), [(dtype, (count, *shape), 0) for dtype, shape in fields])


@kernel
def balance(A: Any, horizon: float, found: Any) -> None:
    """Balance matrices A by diagonals D of powers of two, and write them to `found` (`Balanced`).

    The method is that of E. E. Osborne, J. ACM 7 (1960) 338.

    The 2-norms include the diagonal. Without it, couplings that are negligible compared with the diagonal
    would be scaled up with its roundings (R. James, J. Langou and B. R. Lowery, arXiv:1401.5766). Couplings
    with almost no effect before the horizon are not scaled up either, because exponentials close to 1 would have to
    cancel.
    """
    for k in range(A.shape[0]):
        size, scale = found.basis[k], found.scales[k]
        m = size.shape[0]
        for i in range(m):
            scale[i] = 1.0
            for j in range(m):
                size[i, j] = abs(A[k, i, j])
            size[i, i] += _SLOWEST / horizon
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
        for i in range(m):
            for j in range(m):
                found.balanced[k, i, j] = A[k, i, j] * scale[j] / scale[i]


@kernel
def real_columns(values: Any, vectors: Any, found: Any) -> None:
    """Write the real part of each eigenvector to the basis; for the second of two conjugates, the imaginary part.

    Both represent the pair. A complex inverse would make the two conjugates of each other only to within the
    condition of the basis.
    """
    for k in range(values.shape[0]):
        for j in range(values.shape[1]):
            for i in range(values.shape[1]):
                entry = vectors[k, i, j]
                found.basis[k, i, j] = -entry.imag if values[k, j].imag < 0.0 else entry.real


@kernel
def check_eigenvectors(values: Any, vectors: Any, inverses: Any, horizon: float, found: Any) -> int:
    """Write the number of coordinates of each matrix, and whether its eigenvectors are accurate and a good basis.

    inverses: those of `real_columns`. Return the largest number of coordinates, or -1 if some are not good.
    """
    balanced, counts, chosen, right = found.balanced, found.counts, found.is_diagonal, found.are_right
    all_chosen, most = True, 0
    for k in range(values.shape[0]):
        size, total, largest, fastest = values.shape[1], 0.0, 0.0, 0.0
        counts[k] = 0
        for i in range(size):
            fastest = max(fastest, values[k, i].real)
            if values[k, i].imag >= 0.0:
                counts[k] += 1
            for j in range(size):
                total += inverses[k, i, j] * inverses[k, i, j]
                largest = max(largest, abs(balanced[k, i, j]))
        # LAPACK balances again, without the diagonal, so that negligible entries may dominate an eigenvector
        right[k] = True
        for i in range(size):
            for j in range(size):
                missed = -vectors[k, i, j] * values[k, j]
                for m in range(size):
                    missed += balanced[k, i, m] * vectors[k, m, j]
                if not abs(missed) <= _MISSED * largest:
                    right[k] = False
        # rounding errors of the basis grow with a growing motion
        grows = fastest > max(_GROWING / horizon, _SILENT * largest)
        # the Frobenius norm bounds the 2-norm of the inverse; no column of the basis has a norm above 1
        chosen[k] = right[k] and not grows and size * total <= CONDITION**2
        all_chosen, most = all_chosen and chosen[k], max(most, counts[k])
    return most if all_chosen else -1


@kernel
def write_diagonal(values: Any, vectors: Any, inverses: Any, exponent: int, found: Any, out: Any) -> None:
    """Write the diagonal form of each matrix that has a good basis of eigenvectors, with one block per eigenvalue."""
    counts, scales, chosen = found.counts, found.scales, found.is_diagonal
    for k in range(values.shape[0]):
        out.counts[k] = counts[k]
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
