"""This module decides in compiled code whether states at consecutive forcing periods repeat.

The rules are those of `hybridsim.analysis.steady.settling.Passings`.
"""

from __future__ import annotations

import math
from typing import Any

from hybridsim.engine.native.kernels import inline_always, inlined

LONGEST_WORD = 12  # largest number of periods after which a motion may repeat
_CLOSER = 1e-2  # multiple of the tolerance: below it, a change that no longer shrinks has converged
_ABOUT = 10.0
_DIGITS = 1e-3  # of its size: the least scale of a state
_NOTHING_LEFT = 1e-13  # of the scale that a state once had


@inline_always
def measure_scale(extremes: Any, seen: Any, scale: Any) -> None:
    """Write the scale of each state from its extremes over a period, and update the largest scales so far."""
    for i in range(scale.shape[0]):
        low, high = extremes[0, i], extremes[1, i]
        scale[i] = max(0.5 * (high - low), _DIGITS * max(abs(low), abs(high)))
        seen[i] = max(seen[i], scale[i])
        scale[i] = max(scale[i], _NOTHING_LEFT * seen[i])


@inlined
def remember_sizes(states: Any, count: int, seen: Any) -> None:
    """Update the largest scales so far by the sizes of the states (count, n) at the starts of periods."""
    for row in range(count):
        for i in range(seen.shape[0]):
            seen[i] = max(seen[i], _DIGITS * abs(states[row, i]))


@inlined
def relative_change(before: Any, after: Any, scale: Any) -> float:
    """Return the largest change of a state relative to its scale; states without a scale are ignored."""
    largest = 0.0
    for i in range(scale.shape[0]):
        if not scale[i] <= 0.0:
            change = abs(after[i] - before[i]) / scale[i]
            if not change < math.inf:  # also if it is not a number
                return math.inf
            largest = max(largest, change)
    return largest


@inline_always
def repeats_after(states: Any, count: int, scale: Any, tol: float) -> int:
    """Return the number of passages after which the last states (count, n) repeat, or 0."""
    last = count - 1
    for m in range(1, min(LONGEST_WORD, last) + 1):
        residual = relative_change(states[last - m], states[last], scale)
        back = last // (2 * m)
        if back == 0:
            continue
        earlier = relative_change(states[last - (back + 1) * m], states[last - back * m], scale)
        error = residual if residual <= _CLOSER * tol else math.inf
        if residual < earlier:
            error = residual / (1.0 - (residual / earlier) ** (1.0 / back))
        if error <= tol:
            return m
    return 0


@inline_always
def nearest_return(states: Any, count: int, scale: Any) -> int:
    """Return the number of passages after which the last states (count, n) come close to repeating."""
    last, least = count - 1, math.inf
    most = max(1, min(LONGEST_WORD, last // 2))
    for m in range(1, most + 1):
        least = min(least, relative_change(states[last - m], states[last], scale))
    for m in range(1, most + 1):
        if relative_change(states[last - m], states[last], scale) <= _ABOUT * least:
            return m
    return 1


@inline_always
def periods_left(states: Any, count: int, m: int, scale: Any, tol: float) -> float:
    """Estimate how many more periods a motion that repeats every m periods needs to settle to the tolerance."""
    last = count - 1
    residual, back = relative_change(states[last - m], states[last], scale), last // (2 * m)
    if back == 0:
        return math.inf
    earlier = relative_change(states[last - (back + 1) * m], states[last - back * m], scale)
    if not 0.0 < residual < earlier:
        return math.inf
    rate = math.log(earlier / residual) / back
    left = math.log(max(residual, tol) / tol) + max(0.0, -math.log(-math.expm1(-rate)))
    return m * left / rate
