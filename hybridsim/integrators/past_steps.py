"""This module computes dense output for stiff modes, by a polynomial through the states after the last steps.

In a stiff mode a state deviates from its slow motion by a rounding error or a tolerance. Its derivatives are
this deviation times powers of a rate far above one over the step, and are useless. The values themselves are
accurate. So the dense output is the polynomial through the last few of them, as in the formulas of a
multistep method (C. W. Gear, Numerical Initial Value Problems in Ordinary Differential Equations,
Prentice-Hall 1971, chapter 9).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import kernel
from hybridsim.engine.record.segments import Dense

MAX_PAST_POINTS = 6  # most points, since the highest order of backward differentiation formulas is five
# Taylor series to third order that miss the other end of their step by more than this share of their largest term
# do not converge on the step.
_CONVERGES = 0.1


@kernel
def converges(series: Any, h: float, x1: Any) -> bool:
    """Return whether the Taylor series at one end of a step yield the states at the other end."""
    for i in range(series.shape[0]):
        power, largest, total = 1.0, 0.0, 0.0
        for k in range(series.shape[1]):
            term = series[i, k] * power
            total += term
            if k > 0:
                largest = max(largest, abs(term))
            power *= h
        if not abs(total - x1[i]) <= _CONVERGES * largest + 1e-12 * abs(x1[i]):
            return False
    return True


def through(s: np.ndarray, x: np.ndarray) -> Dense:
    """Return the dense output of the last step: a polynomial through a suitable number of earlier points.

    Of the polynomials through the last 2, 3, ... points it is the one for which the next point changes the
    middle of the step least.
    """
    order = slice(None, -MAX_PAST_POINTS - 1, -1)
    s, x = s[order], x[order]  # latest point first
    differences = x.copy()
    for k in range(1, len(s)):
        differences[k:] = (differences[k:] - differences[k - 1 : -1]) / (s[k:] - s[:-k])[:, None]
    middle, weight, best, least = 0.5 * (s[0] + s[1]), 1.0, 1, np.inf
    for k in range(len(s)):
        change = float(
            np.max(np.abs(weight * differences[k]) / np.maximum(np.max(np.abs(x), axis=0), 1e-300))
        )
        if k >= 2 and change < least:
            best, least = k, change
        weight *= middle - s[k]

    def dense(times: np.ndarray) -> np.ndarray:
        out = np.tile(differences[best], (len(times), 1))
        for k in range(best - 1, -1, -1):
            out = out * (times - s[k])[:, None] + differences[k]
        return out

    return dense
