"""This module integrates functions of time over a run, with an adaptive Gauss rule between its events."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_TOLERANCE = (
    1e-12  # of the integral of |f|: the largest difference between the rule on an interval and on its halves
)
_ROUNDS = 40  # of halving; what is left then is as short as rounding allows
_BLOCK = 400_000  # values of the integrand that are computed at once

Integrand = Callable[[np.ndarray], np.ndarray]


def integral(
    integrand: Integrand, edges: np.ndarray, width: int, least: np.ndarray | float = 0.0
) -> np.ndarray:
    """Return the integrals (width,) of a function of time from edges[0] to edges[-1].

    integrand: a function from times (k,) to values (k, width).

    ::

        integral of f over [a, b] = (b - a)/2 * sum of w_i f((a + b)/2 + (b - a)/2 x_i),   i = 1 ... 8

    The function should be smooth between neighbouring edges. An interval is halved until the rule on it and on its
    halves agree within 1e-12 of the integral of |f|, or within `least`; the value on the halves is taken.
    """
    low, high = edges[:-1], edges[1:]
    whole, sizes = _rule(integrand, low, high, width)
    allowed, total = np.maximum(_TOLERANCE * sizes.sum(axis=0), least), np.zeros(width)
    for _ in range(_ROUNDS):
        middle = 0.5 * (low + high)
        left, right = (_rule(integrand, a, b, width)[0] for a, b in ((low, middle), (middle, high)))
        differs = (np.abs(left + right - whole) > allowed).any(axis=1)
        total += (left + right)[~differs].sum(axis=0)
        low, high = (
            np.concatenate([first[differs], second[differs]])
            for first, second in ((low, middle), (middle, high))
        )
        whole = np.concatenate([left[differs], right[differs]])
        if not len(low):
            break
    found: np.ndarray = total + whole.sum(axis=0)
    return found


def _rule(
    integrand: Integrand, low: np.ndarray, high: np.ndarray, width: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the integrals (k, width) of f and of |f| over k intervals by the Gauss rule."""
    found = np.empty((2, len(low), width))
    count = max(1, _BLOCK // (width * len(_NODES)))
    for first in range(0, len(low), count):
        part = slice(first, first + count)
        half = 0.5 * (high[part] - low[part])[:, None]
        times = 0.5 * (high[part] + low[part])[:, None] + half * _NODES
        values = integrand(times.ravel()).reshape(*times.shape, width)
        found[0, part] = half * np.einsum("i,kiw->kw", _WEIGHTS, values)
        found[1, part] = half * np.einsum("i,kiw->kw", _WEIGHTS, np.abs(values))
    return found[0], found[1]
