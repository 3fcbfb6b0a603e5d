"""This module computes derivatives at points at which an operation of a function has none, as limits from both sides.

The function as a whole may be differentiable there: |x|**1.5 is at zero, and abs(x) is not. Its derivatives at three
distances on both sides decide. They converge to one limit if the function is continuously differentiable.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

DISTANCES = (1e-5, 1e-8, 1e-11)  # of the size of the displaced argument, or absolute if it is zero
_CONVERGES = 0.95  # largest ratio of successive differences; 1 belongs to a logarithm, and more to a root
_ALIKE = 1e-6  # relative difference of the limits on two sides that counts as none
_ROUNDING = 1e-9  # of a derivative: a smaller difference is rounding
_NOISE = 1e-13  # of the largest derivative: a smaller difference is rounding

Displaced = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""The type of functions that return derivatives (W, D) at a point displaced in time, states and run-time vector."""


def slopes_at_edge(
    displaced: Displaced, s: float, x: np.ndarray, p: np.ndarray, seeds: np.ndarray
) -> np.ndarray:
    """Return the derivatives (W, D) along the columns of `seeds`, with NaN for derivatives that do not exist.

    A side on which the functions have no values is left out.
    """
    n = len(x)
    sizes = np.abs(np.concatenate([x, [s], p]))
    found: list[tuple[np.ndarray, np.ndarray]] = []
    for k in range(seeds.shape[1]):
        direction = seeds[:, k]
        size = np.max(sizes[direction != 0.0], initial=0.0) or 1.0
        length = size / (np.abs(direction).max(initial=0.0) or 1.0)
        for sign in (1.0, -1.0):
            at = [sign * distance * length * direction for distance in DISTANCES]
            found.append(limit_of([displaced(float(d[n]), d[:n], d[n + 1 :]) for d in at]))
    return agreed(found)


def limit_of(near: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the limit of values that decrease like a + b d**q with the distance d, and a bound of its error.

    The limit is infinite if the values do not converge, and NaN without values.
    """
    with np.errstate(all="ignore"):
        first, second = near[1] - near[0], near[2] - near[1]
        largest = np.abs(near[2][np.isfinite(near[2])]).max(initial=0.0)
        is_settled = np.abs(second) <= _ROUNDING * np.abs(near[2]) + _NOISE * largest
        ratio = second / first
        limit = np.where(is_settled, near[2], near[2] + second * ratio / (1.0 - ratio))
        limit[np.abs(limit) <= _ROUNDING * np.abs(near[0])] = 0.0
        error = np.abs(limit - near[2]) + _ALIKE * np.abs(limit) + _NOISE * largest
    limit[~is_settled & ~(np.abs(ratio) < _CONVERGES)] = np.inf
    limit[np.isnan(near).any(axis=0)] = np.nan
    return limit, error


def agreed(sides: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return the limit on which all sides agree within their errors, or NaN if they disagree."""
    limits, errors = (np.array(part) for part in zip(*sides, strict=True))
    errors = np.where(np.isnan(limits), np.inf, errors)
    best = np.argmin(errors, axis=0)[None]
    found: np.ndarray = np.take_along_axis(limits, best, axis=0)[0]
    least = np.take_along_axis(errors, best, axis=0)[0]
    with np.errstate(invalid="ignore"):
        agree = (np.isnan(limits) | (np.abs(limits - found) <= errors + least)).all(axis=0)
    return np.where(agree & np.isfinite(found), found, np.nan)
