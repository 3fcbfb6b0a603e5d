"""This module samples curves so that straight lines between the samples show them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SHARE = 0.6  # of a part, at which it is tested and divided; at the middle an S-shaped curve meets its chord
DEEPEST = 24  # divisions of one part
_DEVIATION = 5e-4  # of the range of a quantity: the largest distance of a tested point from the straight line


def sample_curves(
    evaluate: Callable[[Array, bool], Array],
    knots: Array,
    is_break: NDArray[np.bool_],
    sizes: Array | None = None,
    most: float = np.inf,
    deepest: int = DEEPEST,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return times (k,), values (n, k) of curves, and the position of the first sample of each smooth part, and k.

    A part between two knots is divided as long as its inner sample deviates from the straight line. If there would
    be more than about `most` samples, the parts with the largest deviations are divided.

    Parameters
    ----------
    evaluate : returns the values (n, k) at times (k,), just after each time (True) or just before it (False).
    knots : ascending times, among them all times at which a curve jumps or bends.
    is_break : for each knot but the first, whether a curve may jump there; such a knot has two samples.
    sizes : the range (n,) of each curve; by default the range of the first samples.
    """
    is_break = np.append(is_break[:-1], True)
    a, b = knots[:-1], knots[1:]
    middle = a + _SHARE * (b - a)
    at_a, at_middle = np.split(evaluate(np.concatenate([a, middle]), True), 2, axis=1)
    at_ends = evaluate(b[is_break], False)
    at_b = np.append(at_a[:, 1:], at_ends[:, -1:], axis=1)
    at_b[:, is_break] = at_ends
    sizes = sizes_of(np.concatenate([at_a, at_middle, at_b], axis=1)) if sizes is None else sizes
    times, values = [b[is_break], a, middle], [at_ends, at_a, at_middle]
    left = most - sum(map(len, times))
    for _ in range(deepest - 1):
        deviation = _deviation(at_a, at_middle, at_b, sizes)
        coarse = np.flatnonzero((deviation > _DEVIATION) & (middle > a) & (middle < b))
        if 2 * len(coarse) > left:
            coarse = coarse[np.argsort(-deviation[coarse], kind="stable")[: max(int(left / 2), 0)]]
        if not len(coarse):
            break
        a, middle, b = a[coarse], middle[coarse], b[coarse]
        at_a, at_middle, at_b = at_a[:, coarse], at_middle[:, coarse], at_b[:, coarse]
        a, b = np.concatenate([a, middle]), np.concatenate([middle, b])
        at_a, at_b = np.append(at_a, at_middle, axis=1), np.append(at_middle, at_b, axis=1)
        middle = a + _SHARE * (b - a)
        at_middle = evaluate(middle, True)
        times.append(middle)
        values.append(at_middle)
        left -= len(middle)
    every = np.concatenate(times)
    is_after = np.arange(len(every)) >= at_ends.shape[1]  # values before a jump are first
    order = np.lexsort((is_after, every))
    firsts = np.concatenate([[0], np.flatnonzero(~is_after[order]) + 1])
    return every[order], np.concatenate(values, axis=1)[:, order], firsts


def sizes_of(values: Array) -> Array:
    """Return the range (n,) of the finite values (n, k) of each curve, or the magnitude of a constant."""
    finite = np.where(np.isfinite(values), values, 0.0)
    span, largest = np.ptp(finite, axis=1), np.abs(finite).max(axis=1)
    return np.where(span > 1e-12 * largest, span, np.where(largest > 0, largest, 1.0))


def _deviation(at_a: Array, at_middle: Array, at_b: Array, sizes: Array) -> Array:
    """Return the largest distance of the inner sample of each part from its straight line, relative to the ranges."""
    with np.errstate(all="ignore"):
        distance = np.abs(at_middle - (1.0 - _SHARE) * at_a - _SHARE * at_b) / sizes[:, None]
    return np.asarray(np.nan_to_num(distance, nan=0.0).max(axis=0, initial=0.0))
