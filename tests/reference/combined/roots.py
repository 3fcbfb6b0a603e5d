"""Where a series first becomes negative: dense sampling and bisection, and dips that nearly reach zero."""

from __future__ import annotations

from typing import Any

import numpy as np

SAMPLES = 48
GRAZE = 1e-6  # a dip this near to zero, relative to the size of the function, makes what follows uncertain


def lead(row: list[Any], tol: float) -> int:
    """The sign of the first coefficient that is not zero within ``tol``."""
    for value in row:
        if value > tol:
            return 1
        if value < -tol:
            return -1
    return 0


def horner(row: list[Any], s: Any) -> Any:
    value = row[-1]
    for c in row[-2::-1]:
        value = value * s + c
    return value


def first_negative(row: list[Any], h: Any, tol: float) -> tuple[Any | None, float | None]:
    """The first s in (0, h] at which a function, positive just after 0, becomes negative; the first near touch."""
    m = 0
    while m < len(row) and -tol <= row[m] <= tol:
        m += 1
    if m == len(row):
        return None, None
    q = row[m:]
    if len(q) == 1:
        return None, None
    coefficients = np.array([float(c) for c in q])
    s = np.linspace(0.0, float(h), SAMPLES + 1)
    values = np.polynomial.polynomial.polyval(s, coefficients)
    slopes = np.polynomial.polynomial.polyval(s, coefficients[1:] * np.arange(1, len(coefficients)))
    size = np.abs(values).max() or 1.0
    if values.min() > 0 and not ((slopes[:-1] < 0) & (slopes[1:] >= 0)).any() and values[-1] > GRAZE * size:
        return None, None
    touch = None
    for i in range(SAMPLES):
        if values[i + 1] < 0:
            return bisected(q, s[i], s[i + 1] if i + 1 < SAMPLES else h, 1), touch
        if slopes[i] < 0 <= slopes[i + 1]:
            slope = [k * c for k, c in enumerate(q)][1:]
            dip = bisected(slope, s[i], s[i + 1], -1)
            value = horner(q, dip)
            if value < 0 and abs(value) > 1e-12 * size:
                return bisected(q, s[i], dip, 1), touch
            if abs(value) < GRAZE * size and touch is None:
                touch = float(dip)
    return None, touch


def bisected(q: list[Any], a: Any, b: Any, sign: int) -> Any:
    """The zero between a and b of a function that has the given sign at a."""
    low, high = a, b
    slope = [k * c for k, c in enumerate(q)][1:]
    for _ in range(30):
        middle = (low + high) / 2
        if sign * horner(q, middle) > 0:
            low = middle
        else:
            high = middle
    x = (low + high) / 2
    for _ in range(8):
        d = horner(slope, x)
        if not d:
            break
        new = x - horner(q, x) / d
        if not low - (high - low) <= new <= high + (high - low):
            break
        x = new
    return x
