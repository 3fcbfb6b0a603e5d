"""Summary of the states over closed-form segments: extremes, integrals and times in holding modes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybridsim.engine.linear.motion import moved
from hybridsim.engine.native.kernels import inlined, kernel

# Gauss quadrature integrates the square of the fastest coordinate to rounding on pieces with this angle. The error of
# n nodes is below (angle/2)**(2n) 2**(2n) (n!)**4/((2n + 1) (2n)!**3), 2e-16 here.
_TURN, _NODES = 8.0, 16
_MAX_PARTS = 4096  # a longer interval is left to sampling
_GROWN = 4.0  # largest growth of the coordinates between nodes, which are less than 0.8 of a rate apart
_UNSEEN = 1e-15  # relative to a state's size: smaller extrema are ignored
_ITERATIONS = 60  # most iterations of a secant method that bisects in the worst case
NODES, WEIGHTS = np.polynomial.legendre.leggauss(_NODES)


@inlined
def _state_and_slope(lin: Any, k: int, i: int, v: Any) -> tuple[float, float]:
    """Return a state and its rate at modal coordinates v, which satisfy v' = B v."""
    value = slope = 0.0
    for j in range(lin.counts[k]):
        b, change = lin.basis[k, i, j], lin.values[k, j] * v[j]
        for m in range(j + 1, lin.ends[k, j]):
            change += lin.upper[k, j, m] * v[m]
        value += b.real * v[j].real - b.imag * v[j].imag
        slope += b.real * change.real - b.imag * change.imag
    return value, slope


@kernel
def _turn(
    lin: Any, k: int, i: int, c: Any, low: float, high: float, at_low: float, at_high: float, v: Any
) -> float:
    """Return the extreme value of a state at the zero of its rate between two times."""
    value, same_end = 0.0, 0
    for _ in range(_ITERATIONS):
        s = low - at_low * (high - low) / (at_high - at_low)
        if not low < s < high:
            s = 0.5 * (low + high)
        moved(lin, k, c, s, v)
        value, slope = _state_and_slope(lin, k, i, v)
        # the error of the value is quadratic in the error of the time, and is far below rounding
        if slope == 0.0 or high - low <= 1e-9 * high or abs(slope) <= 1e-9 * min(abs(at_low), abs(at_high)):
            return value
        if (slope > 0.0) == (at_high > 0.0):
            high, at_high = s, slope
            at_low *= 0.5 if same_end == 1 else 1.0  # the other end is used a second time (Illinois method)
            same_end = 1
        else:
            low, at_low = s, slope
            at_high *= 0.5 if same_end == 2 else 1.0
            same_end = 2
    return value


@inlined
def _bend(lin: Any, k: int, i: int, v: Any, is_shrinking: bool) -> tuple[float, float]:
    """Return bounds of the absolute values of a state and of its third derivative up to the next sample time."""
    size = bend = 0.0
    for j in range(lin.counts[k]):
        b = abs(lin.basis[k, i, j])
        if b == 0.0:
            continue
        rate = largest = 0.0
        for m in range(j, lin.ends[k, j]):
            row = abs(lin.values[k, m])
            for q in range(m + 1, lin.ends[k, j]):
                row += abs(lin.upper[k, m, q])
            rate, largest = max(rate, row), max(largest, abs(v[m]))
        size += b * largest
        bend += b * largest * rate * rate * rate
    return size, bend if is_shrinking else _GROWN * bend


@inlined
def _is_shrinking(lin: Any, k: int) -> bool:
    """Return whether no modal coordinate grows, so that bounds at the start stay valid."""
    for j in range(lin.counts[k]):
        if lin.values[k, j].real > 0.0:
            return False
        for m in range(j + 1, lin.ends[k, j]):
            if lin.upper[k, j, m] != 0.0:
                return False
    return True


@kernel
def _between(
    lin: Any,
    k: int,
    i: int,
    c: Any,
    low: float,
    high: float,
    at_low: float,
    at_high: float,
    v: Any,
    extremes: Any,
) -> None:
    """Extend the extremes of a state by its extremes between two times.

    The rate x' has two zeros in an interval of length h only if |x'| is at most max |x'''| h**2/2 at both of
    its ends. Such an interval is halved until a possible extremum in it is below rounding.
    """
    moved(lin, k, c, low, v)
    size, bend = _bend(lin, k, i, v, _is_shrinking(lin, k))
    a, h = low, high - low
    while a < high:
        b = min(a + h, high)
        moved(lin, k, c, b, v)
        value, slope = _state_and_slope(lin, k, i, v)
        extremes[0, i], extremes[1, i] = min(extremes[0, i], value), max(extremes[1, i], value)
        if b == high:
            slope = at_high
        flat = 0.5 * bend * (b - a) * (b - a)
        if max(abs(at_low), abs(slope)) < flat and flat * (b - a) > _UNSEEN * size and a + 0.5 * h > a:
            h *= 0.5
            continue
        if at_low * slope < 0.0:
            value = _turn(lin, k, i, c, a, b, at_low, slope, v)
            extremes[0, i], extremes[1, i] = min(extremes[0, i], value), max(extremes[1, i], value)
        a, at_low, h = b, slope, 2.0 * h


@kernel
def sum_up(
    lin: Any, hold: Any, record: Any, first: int, last: int, begin: float, nodes: Any, weights: Any, scratch: Any,
    out: Any,
) -> bool:  # fmt: skip
    """Add segments of a record to a summary; of the first one, only the part after local time `begin`.

    record: ends, rows, modes, coordinates, jumps as written by `hybridsim.integrators.closed_form.segments`;
    hold: holding mode of each component. scratch: v (J,); slopes and bounds of third derivatives (3, n). out: as
    `hybridsim.ensemble.points.PeriodSummary`. Return False if a segment oscillates too often.
    """
    ends, rows, modes, coordinates, jumps = record
    v, slopes = scratch
    extremes, integrals = out.extremes, out.integrals
    n, begun = extremes.shape[1], False
    for segment in range(first, last):
        k, s0, s1, c = rows[segment], begin if segment == first else 0.0, ends[segment], coordinates[segment]
        if segment == first and begin > 0.0:
            moved(lin, k, c, begin, v)
            for i in range(n):
                out.ends[0, i] = _state_and_slope(lin, k, i, v)[0]
        elif segment == first:
            for i in range(n):
                out.ends[0, i] = jumps[segment, 0, i]
        for i in range(n):
            out.ends[1, i] = jumps[segment, 1, i]
        if not s1 > s0:
            continue
        for component in range(modes.shape[1]):
            is_held = modes[segment, component] == hold[component]
            if is_held:
                out.held[0, component] += s1 - s0
                out.held[1, component] += 0.0 if begun and out.holding[1, component] else 1.0
            if not begun:
                out.holding[0, component] = is_held
            out.holding[1, component] = is_held
        begun = True
        fastest = 0.0
        for j in range(lin.counts[k]):
            fastest = max(fastest, abs(lin.values[k, j]))
        parts = math.ceil((s1 - s0) * fastest / _TURN) if (s1 - s0) * fastest > _TURN else 1
        if parts > _MAX_PARTS:
            return False
        length = (s1 - s0) / parts
        for i in range(n):
            side = out.ends[0, i] if segment == first else jumps[segment, 0, i]
            extremes[0, i] = min(extremes[0, i], side, jumps[segment, 1, i])
            extremes[1, i] = max(extremes[1, i], side, jumps[segment, 1, i])
        moved(lin, k, c, s0, v)
        is_shrinking = _is_shrinking(lin, k)
        for i in range(n):
            slopes[0, i] = _state_and_slope(lin, k, i, v)[1]
            slopes[2, i] = _bend(lin, k, i, v, is_shrinking)[1]
        before = s0
        for part in range(parts):
            for node in range(nodes.shape[0] + 1):
                is_end = node == nodes.shape[0]
                if is_end and part < parts - 1:
                    continue
                s = s1 if is_end else s0 + length * (part + 0.5 * (1.0 + nodes[node]))
                moved(lin, k, c, s, v)
                for i in range(n):
                    value, slope = _state_and_slope(lin, k, i, v)
                    if not is_end:
                        integrals[0, i] += 0.5 * length * weights[node] * value
                        integrals[1, i] += 0.5 * length * weights[node] * value * value
                        extremes[0, i] = min(extremes[0, i], value)
                        extremes[1, i] = max(extremes[1, i], value)
                    slopes[1, i] = slope
                    if not is_shrinking:
                        slopes[2, i] = _bend(lin, k, i, v, is_shrinking)[1]
                for i in range(n):
                    first_rate = slopes[0, i]
                    last_rate, flat = slopes[1, i], 0.5 * slopes[2, i] * (s - before) ** 2
                    if max(abs(first_rate), abs(last_rate)) < flat:
                        _between(lin, k, i, c, before, s, first_rate, last_rate, v, extremes)
                    elif first_rate * last_rate < 0.0:
                        value = _turn(lin, k, i, c, before, s, first_rate, last_rate, v)
                        extremes[0, i], extremes[1, i] = (
                            min(extremes[0, i], value),
                            max(extremes[1, i], value),
                        )
                    slopes[0, i] = last_rate
                before = s
    return True
