"""Faint entries of the basis of an invariant subspace, which rounding hides, worked out from those that are clear.

A basis is found as well as its largest entry. What couples weakly, or not at all, to a motion that grows has an entry
of that size of error there, and the growth makes something of it. The equation of the subspace gives the entry itself.
"""

from __future__ import annotations

import numpy as np

_FAINT = 2.0**-10  # of the largest row
_CLOSE = 1e-14  # of the largest row: by how much a row may change, else it was no question of rounding


def with_faint_rows(A: np.ndarray, V: np.ndarray, T: np.ndarray) -> np.ndarray:
    """V (m, k) of A V = V T with its faint rows from A_ff V_f - V_f T = -A_fc V_c, of these again the fainter."""
    V, sizes = V.astype(complex), np.abs(V).max(axis=1, initial=0.0)
    largest = sizes.max(initial=0.0)
    faint = sizes < _FAINT * largest
    while faint.any():
        rows, others = np.flatnonzero(faint)[:, None], np.flatnonzero(~faint)
        known = A[rows, others] @ V[others]
        found = _solved(A[rows, rows.T], T, known) if known.any() else np.zeros_like(known)
        if not (np.abs(found - V[faint]) <= _CLOSE * largest).all():
            break
        V[faint] = found
        sizes = np.abs(found).max(axis=1)
        faint[rows[sizes >= _FAINT * sizes.max(), 0]] = False
        if not sizes.any():
            break
    return V


def _solved(A: np.ndarray, T: np.ndarray, known: np.ndarray) -> np.ndarray:
    """X of A X - X T = -known; not a number where there is none."""
    from scipy.linalg import solve_sylvester

    try:
        if len(T) > 1:
            return np.asarray(solve_sylvester(A.astype(complex), -T, -known))
        return np.linalg.solve(A - T[0, 0] * np.eye(len(A)), -known)
    except np.linalg.LinAlgError:
        return np.full_like(known, np.nan)
