"""This module evaluates polynomials given by their coefficients, and shifts them to another point."""

from __future__ import annotations

from math import comb
from typing import Any

import numpy as np

from hybridsim.engine.native.kernels import inlined, kernel
from hybridsim.engine.native.simd.vectors import WIDTH, load, splat, store

TERMS = 32  # the largest number of terms: 31 for a relative tolerance of 1e-15
_CHOICES = np.array([[float(comb(i, k)) for k in range(TERMS)] for i in range(TERMS)])


@inlined
def value_and_slope(series: Any, d: float) -> tuple[float, float]:
    """Return the value and the derivative of a polynomial at d, by Horner's method."""
    value, slope = series[series.shape[0] - 1], 0.0
    for k in range(series.shape[0] - 2, -1, -1):
        slope = slope * d + value
        value = value * d + series[k]
    return value, slope


@inlined
def state_at(series: Any, x: int, d: float) -> tuple[float, float]:
    """Return the value and the derivative at d of the polynomial in one column, by Horner's method."""
    value, slope = series[series.shape[0] - 1, x], 0.0
    for k in range(series.shape[0] - 2, -1, -1):
        slope = slope * d + value
        value = value * d + series[k, x]
    return value, slope


@inlined
def states_at(series: Any, x: int, d: Any) -> tuple[Any, Any]:
    """Return the values and derivatives of polynomials in eight columns. Each column has its own distance d."""
    wide = series.shape[1]
    value, slope = load(series, (series.shape[0] - 1) * wide + x), splat(0.0)
    for k in range(series.shape[0] - 2, -1, -1):
        slope = slope * d + value
        value = value * d + load(series, k * wide + x)
    return value, slope


@kernel
def shift(series: Any, x: int, d: float, top: int, out: Any) -> None:
    """Shift the polynomial in column x by d, and store coefficients 0..top of the result.

    out: an array of 3 TERMS numbers. Behind the result it caches the powers d**(last - m) at TERMS + m, and d last.
    """
    last = series.shape[0] - 1
    if d == 0.0:
        for k in range(last + 1):
            out[k] = series[k, x]
        return
    if out[3 * TERMS - 1] != d:  # neighbours often have equal d
        power = 1.0
        for m in range(last, -1, -1):
            out[TERMS + m] = power
            power *= d
        out[3 * TERMS - 1] = d
    for k in range(0, top + 1, WIDTH):
        total = splat(0.0)
        for i in range(k, last + 1):
            weights = load(_CHOICES, i * TERMS + k) * load(out, TERMS + last - i + k)
            total = total + splat(series[i, x]) * weights
        store(out, k, total)
