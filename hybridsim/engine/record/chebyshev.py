"""Convert dense output to Chebyshev series, so that any interpolant can be stored in arrays.

The series through the values at the Chebyshev points of a step is as accurate as its last coefficients are small. The
degree is doubled until they are at rounding level (J. P. Boyd, Chebyshev and Fourier Spectral Methods, 2nd ed., Dover
2001, chapter 2). A polynomial interpolant is reproduced to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from hybridsim.engine.record.segments import Dense

_DEGREES = (9, 18, 36, 72, 144, 288, 576, 1152)
_NEGLIGIBLE = 2.0**-50  # relative to the size of a state
_TAIL = 3  # last coefficients that must be negligible; one or two may be small by symmetry


@dataclass(frozen=True)
class ChebyshevDense:
    """Dense output with one series per step: knots (m + 1,), coefficients (d, n) of each of the m steps."""

    knots: np.ndarray
    coefficients: tuple[np.ndarray, ...]

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Return states (k, n) at local times (k,)."""
        ascending = self.knots[-1] >= self.knots[0]
        inner = self.knots[1:-1] if ascending else -self.knots[1:-1]
        index = np.searchsorted(inner, s if ascending else -s, side="right")
        out = np.empty((len(s), self.coefficients[0].shape[1]))
        for i in np.unique(index):
            chosen = np.flatnonzero(index == i)
            a, b = self.knots[i], self.knots[i + 1]
            out[chosen] = chebyshev.chebval((2.0 * s[chosen] - (a + b)) / (b - a), self.coefficients[i]).T
        return out


def chebyshev_series(dense: Dense, a: float, b: float, sizes: np.ndarray) -> np.ndarray:
    """Return Chebyshev coefficients (d, n) of dense output on [a, b]; sizes (n,): sizes of the states."""
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    for degree in _DEGREES:
        points = chebyshev.chebpts1(degree + 1)
        values = dense(middle + half * points)
        series = 2.0 / (degree + 1) * (chebyshev.chebvander(points, degree).T @ values)
        series[0] *= 0.5
        if (np.abs(series[-_TAIL:]) <= _NEGLIGIBLE * sizes).all():
            break
    return series
