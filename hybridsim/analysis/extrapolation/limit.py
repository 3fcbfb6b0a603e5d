"""This module extrapolates from the states at successive periods to a state that repeats after one period."""

from __future__ import annotations

import numpy as np

_RCOND = 1e-10  # relative to the largest singular value; smaller ones are rounding


def limit_of(before: np.ndarray, after: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, float]:
    """Extrapolate states before and after k periods to a limit (n,); also return the change per period at the limit.

    The limit is the combination of the states after the periods, with weights of sum one, for which the same
    combination of the changes is the smallest. It is exact for a linear map with k - 1 multipliers. Every linear
    constraint that all states satisfy holds for the limit as well, such as the place of a contact that never
    slips. The expected change is the largest one relative to the scale of each state.

    References
    ----------
    D. G. Anderson, J. ACM 12 (1965) 547, doi:10.1145/321296.321305.
    """
    used = scale > 0.0
    changes = ((after - before)[:, used] / scale[used]).T
    differences = changes[:, :-1] - changes[:, -1:]
    sizes = np.linalg.norm(differences, axis=0)
    sizes[sizes == 0.0] = 1.0
    weights = np.linalg.lstsq(differences / sizes, -changes[:, -1], rcond=_RCOND)[0] / sizes
    limit = after[-1] + weights @ (after[:-1] - after[-1])
    return limit, float(np.abs(changes[:, -1] + differences @ weights).max(initial=0.0))
