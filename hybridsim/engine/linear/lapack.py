"""This module calls LAPACK for stacks of small matrices.

The functions of `numpy.linalg` check their arguments for longer than LAPACK needs for matrices of four rows. They call
universal functions, which NumPy does not document; without these, `numpy.linalg` itself is called.
"""

from __future__ import annotations

import numpy as np

_umath = getattr(np.linalg, "_umath_linalg", None)
_eig, _inv = getattr(_umath, "eig", None), getattr(_umath, "inv", None)


def eigenvectors(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return complex eigenvalues (K, m) and eigenvectors (K, m, m) of real matrices (K, m, m).

    Without convergence the results are NaN. The caller ignores floating-point errors.
    """
    if _eig is None:
        values, vectors = np.linalg.eig(matrices)
        return values.astype(complex, copy=False), vectors.astype(complex, copy=False)
    found: tuple[np.ndarray, np.ndarray] = _eig(matrices, signature="d->DD")
    return found


def inverse_matrices(matrices: np.ndarray) -> np.ndarray:
    """Return inverses of real matrices (K, m, m); the inverse of a singular matrix is NaN or infinite.

    The caller ignores floating-point errors.
    """
    if _inv is not None:
        return np.asarray(_inv(matrices, signature="d->d"))
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:  # one of them is singular
        if len(matrices) == 1:
            return np.full_like(matrices, np.inf)
        return np.concatenate([inverse_matrices(one[None]) for one in matrices])
