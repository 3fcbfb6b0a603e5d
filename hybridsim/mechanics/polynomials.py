"""Polynomials by their coefficients: values, and the same about another point."""

from __future__ import annotations

from typing import Any

from hybridsim.engine.jit import inlined, kernel


@inlined
def value_and_slope(series: Any, d: float) -> tuple[float, float]:
    """A polynomial and its derivative at d (Horner)."""
    value, slope = series[series.shape[0] - 1], 0.0
    for k in range(series.shape[0] - 2, -1, -1):
        slope = slope * d + value
        value = value * d + series[k]
    return value, slope


@kernel
def shift(series: Any, d: float, top: int, out: Any) -> None:
    """Coefficients 0..top of a polynomial about d (Horner's scheme, again and again)."""
    last = series.shape[0] - 1
    for k in range(last + 1):
        out[k] = series[k]
    if d == 0.0:
        return
    for k in range(top + 1):
        for i in range(last - 1, k - 1, -1):
            out[i] += d * out[i + 1]
