"""This module computes derivatives at points where an operation has none, such as a root at zero or a kink.

The function as a whole may be differentiable there: |x|**1.5 is at zero, and abs(x) is not. Its derivatives at three
distances on both sides decide. They converge to one limit if the function is continuously differentiable.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_DISTANCES = (1e-5, 1e-8, 1e-11)  # of the size of the displaced argument, or absolute if it is zero
_CONVERGES = 0.95  # largest ratio of successive differences; 1 belongs to a logarithm, and more to a root
_ALIKE = 1e-6  # relative difference of the limits on two sides that counts as none
_ROUNDING = 1e-9  # of a derivative: a smaller difference is rounding
_NOISE = 1e-13  # of the largest derivative: a smaller difference is rounding

Displaced = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""The type of derivatives (W, D) at a point displaced in time, states and run-time vector."""


def slopes_at_edge(
    displaced: Displaced, s: float, x: np.ndarray, p: np.ndarray, seeds: np.ndarray
) -> np.ndarray:
    """Return the derivatives (W, D) along the columns of `seeds`, with NaN where they do not exist.

    A side on which the functions have no values is left out.
    """
    n = len(x)
    sizes = np.abs(np.concatenate([x, [s], p]))
    found: list[np.ndarray] = []
    for k in range(seeds.shape[1]):
        direction = seeds[:, k]
        size = np.max(sizes[direction != 0.0], initial=0.0) or 1.0
        length = size / (np.abs(direction).max(initial=0.0) or 1.0)
        for sign in (1.0, -1.0):
            at = [sign * distance * length * direction for distance in _DISTANCES]
            found.append(_limit([displaced(float(d[n]), d[:n], d[n + 1 :]) for d in at]))
    return _common(np.array(found))


def _limit(near: list[np.ndarray]) -> np.ndarray:
    """Return the limits of values that decrease like a + b d**q with the distance d; infinity without a limit."""
    first, second = near[1] - near[0], near[2] - near[1]
    with np.errstate(all="ignore"):
        largest = np.abs(near[2][np.isfinite(near[2])]).max(initial=0.0)
        is_settled = np.abs(second) <= _ROUNDING * np.abs(near[2]) + _NOISE * largest
        ratio = second / first
        limit = np.where(is_settled, near[2], near[2] + second * ratio / (1.0 - ratio))
    limit[np.abs(limit) <= _ROUNDING * np.abs(near[0])] = 0.0
    limit[~is_settled & ~(np.abs(ratio) < _CONVERGES)] = np.inf
    limit[np.isnan(near).any(axis=0)] = np.nan
    return limit


def _common(limits: np.ndarray) -> np.ndarray:
    """Return the values on which all sides (K, W, D) agree, except sides that are NaN; NaN where they differ."""
    low = np.where(np.isnan(limits), np.inf, limits).min(axis=0)
    high = np.where(np.isnan(limits), -np.inf, limits).max(axis=0)
    with np.errstate(invalid="ignore"):
        largest = np.abs(limits[np.isfinite(limits)]).max(initial=0.0)
        agree = high - low <= _ALIKE * np.maximum(np.abs(low), np.abs(high)) + _NOISE * largest
        return np.where(agree & np.isfinite(low) & np.isfinite(high), 0.5 * (low + high), np.nan)
