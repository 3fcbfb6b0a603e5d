"""Interpolation through the ends of the last steps: dense output where derivatives tell nothing.

On a stiff stretch a state is off its slow motion by a rounding or a tolerance, and its derivatives are that times
powers of a rate far above one over the step. The values themselves are good. So the dense output is the polynomial
through the last few of them, as the formulas of a multistep method have it themselves (C. W. Gear, Numerical Initial
Value Problems in Ordinary Differential Equations, Prentice-Hall 1971, chapter 9).
"""

from __future__ import annotations

import numpy as np

from hybridsim.engine.stepping import Dense

MOST = 6  # points: the highest order of backward differentiation formulas is five
# Taylor series to third order that miss the other end of their step by more than this share of their largest term
# do not converge on the step.
_CONVERGES = 0.1


def converges(series: np.ndarray, h: float, x1: np.ndarray) -> bool:
    """Whether Taylor coefficients (n, k) of the states at one end of a step of length h lead to its other end."""
    terms = series * h ** np.arange(series.shape[1])
    largest = np.max(np.abs(terms[:, 1:]), axis=1)
    return bool((np.abs(terms.sum(axis=1) - x1) <= _CONVERGES * largest + 1e-12 * np.abs(x1)).all())


def through(s: np.ndarray, x: np.ndarray) -> Dense:
    """The polynomial for the last step through as many points as make it smooth; s (m,), x (m, n), m >= 2.

    Of the polynomials through the last 2, 3, ... points that one is taken at which the next point changes the middle of
    the step least.
    """
    order = slice(None, -MOST - 1, -1)
    s, x = s[order], x[order]  # the last first
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
