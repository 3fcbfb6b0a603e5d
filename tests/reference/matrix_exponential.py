"""Motions of linear systems from matrix exponentials in integers: fixed point, scaling and squaring."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reference.integer_series import BITS, ONE

_TERMS = 60  # at a norm of one half: 2**-60/60! is far below 2**-BITS


def exponential(A: np.ndarray) -> np.ndarray:
    """exp(A) of integers (m, m) in units of 2**-BITS, to a few of these units times what squaring makes of them."""
    norm = max(sum(abs(int(a)) for a in row) for row in A)
    halvings = max(0, (norm // ONE).bit_length() + 1)
    step = np.array([[int(a) >> halvings for a in row] for row in A], dtype=object)
    term = total = np.array([[ONE * (i == j) for j in range(len(A))] for i in range(len(A))], dtype=object)
    for k in range(1, _TERMS):
        term = (step @ term >> BITS) // k
        if not term.any():
            break
        total = total + term
    for _ in range(halvings):
        total = total @ total >> BITS
    return total


def motion(A: np.ndarray, y: Sequence[int], h: int, count: int) -> list[np.ndarray]:
    """States of y' = A y at h, 2 h, ..., count h; A, y and h in integers."""
    step = exponential(A * h >> BITS)
    found, state = [], np.array(list(y), dtype=object)
    for _ in range(count):
        state = step @ state >> BITS
        found.append(state)
    return found
