"""This module converts dense output to Chebyshev series, so that any interpolant is stored as arrays.

The series through the values at the Chebyshev points of a step is as accurate as its last coefficients are small. The
degree is doubled until they are at rounding level (J. P. Boyd, Chebyshev and Fourier Spectral Methods, 2nd ed., Dover
2001, chapter 2). A polynomial interpolant is reproduced to rounding.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

from hybridsim.engine.record.segments import Dense

_DEGREES = (9, 18, 36, 72, 144, 288, 576, 1152)
_NEGLIGIBLE = 2.0**-50  # relative to the size of a state
_TAIL = 3  # last coefficients that must be negligible; one or two may be small by symmetry


def chebyshev_dense(a: float, b: float, coefficients: np.ndarray) -> Dense:
    """Return the states (k, n) at local times (k,) in a step, from its Chebyshev series."""

    def dense(s: np.ndarray) -> np.ndarray:
        return chebyshev.chebval((2.0 * s - (a + b)) / (b - a), coefficients).T

    return dense


def chebyshev_series(dense: Dense, a: float, b: float, sizes: np.ndarray) -> np.ndarray:
    """Return the Chebyshev coefficients (d, n) of dense output on [a, b]."""
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    for degree in _DEGREES:
        points = chebyshev.chebpts1(degree + 1)
        values = dense(middle + half * points)
        sizes = np.maximum(sizes, np.abs(values).max(axis=0))  # a gap is zero at both ends of a flight
        series = 2.0 / (degree + 1) * (chebyshev.chebvander(points, degree).T @ values)
        series[0] *= 0.5
        if (np.abs(series[-_TAIL:]) <= _NEGLIGIBLE * sizes).all():
            break
    return series
