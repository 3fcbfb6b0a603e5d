"""This module checks that a mass matrix is symmetric and positive definite."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.errors import UsageError

# per coordinate: a smaller pivot, relative to its diagonal entry, is a rounding error of zero
_PIVOT = 2.0**-49
_ASYMMETRY = 1e-12  # relative to the largest entry; the asymmetry that assembly in doubles may leave


def require_positive_definite(M: Any, name: str) -> None:
    """Raise an error if a mass matrix is not symmetric, or not positive definite beyond rounding.

    A symmetric matrix is positive definite if and only if all pivots of its elimination without exchanges are
    positive. A pivot that is no larger than the rounding of its diagonal entry counts as zero.

    Raises
    ------
    UsageError
        For a matrix that is not symmetric, or not positive definite.
    """
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    if abs(M - M.T).max() > _ASYMMETRY * abs(M).max():
        raise UsageError(f"{name}: M is not symmetric", remedy="use a symmetric mass matrix")
    diagonal = M.diagonal()
    pivots = diagonal
    if (diagonal > 0.0).all() and M.nnz > len(diagonal):
        try:
            factors = splu(
                csc_array(M),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:  # a pivot is zero
            pivots = np.zeros(1)
        else:
            place = np.argsort(factors.perm_c)
            pivots = factors.U.diagonal() / diagonal[place]
    least = 0.0 if pivots is diagonal else len(diagonal) * _PIVOT
    if not (pivots > least).all():
        raise UsageError(f"{name}: M is not positive definite", remedy="use masses above zero")
