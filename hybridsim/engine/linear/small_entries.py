"""Compute small entries of the basis of an invariant subspace from its large entries.

A basis has an absolute error relative to its largest entry. A state with weak or no coupling to a growing
motion has an entry of the size of this error, and the growth amplifies it. The equation of the subspace gives
the entry itself.
"""

from __future__ import annotations

import numpy as np

_SMALL = 2.0**-10  # size of a small row relative to the largest row
_CLOSE = 1e-14  # largest change of a row relative to the largest row; a larger change is not rounding


def with_small_rows(A: np.ndarray, V: np.ndarray, T: np.ndarray) -> np.ndarray:
    """Correct the small rows of V in A V = V T, because rounding errors are large relative to these rows."""
    V, sizes = V.astype(complex), np.abs(V).max(axis=1, initial=0.0)
    largest = sizes.max(initial=0.0)
    small = sizes < _SMALL * largest
    while small.any():
        rows, others = np.flatnonzero(small)[:, None], np.flatnonzero(~small)
        known = A[rows, others] @ V[others]
        found = _solved(A[rows, rows.T], T, known) if known.any() else np.zeros_like(known)
        if not (np.abs(found - V[small]) <= _CLOSE * largest).all():
            break
        V[small] = found
        sizes = np.abs(found).max(axis=1)
        small[rows[sizes >= _SMALL * sizes.max(), 0]] = False
        if not sizes.any():
            break
    return V


def _solved(A: np.ndarray, T: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the solution X of A X - X T = -known, or NaN if there is no solution."""
    from scipy.linalg import solve_sylvester

    try:
        if len(T) > 1:
            return np.asarray(solve_sylvester(A.astype(complex), -T, -known))
        return np.linalg.solve(A - T[0, 0] * np.eye(len(A)), -known)
    except np.linalg.LinAlgError:
        return np.full_like(known, np.nan)
