"""This module decides whether a small change of a periodic motion grows from period to period."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybridsim.analysis.extrapolation.period_map import PeriodMap
from hybridsim.analysis.steady.settling import relative

_CHANGE = 1e-6  # of the scale: the change of the states
_ROUND = 4  # repetitions after which the growth is measured
_MOST = 32  # rounds
_CLEAR = 0.1  # distance from one of a growth that needs few digits
_EQUAL = (0.05, 5e-5)  # difference of two growths that have converged, clearly away from one and near one
_IN_A_ROW = 2  # equal growths
_GONE = 1e-3  # smallest change that matters, relative to the first one
_NEUTRAL = 2e-4  # growth per repetition that is allowed, as of a direction in which a contact sticks anywhere


def grows(period_map: PeriodMap, scale: np.ndarray, multiple: int, direction: np.ndarray) -> bool:
    """Return whether a small change of a repeating motion grows; if not, return the map to its state at the call.

    After some repetitions the change is in the direction, or in the plane of a complex pair, that shrinks least or
    grows fastest. Three changes in a row then determine the largest multipliers. The motion is followed with and
    without the change until their size has converged, or the change is gone. A clear decay alone decides nothing: it
    may hide a small part that grows. If the change grows, the map goes on from the changed states.
    """
    start = plain = period_map.snapshot()
    change = _CHANGE * direction / relative(direction, scale)
    period_map.put(period_map.x + change)
    changed = period_map.snapshot()
    used = scale > 0.0
    changes, growth, equal = [change[used] / scale[used]], np.inf, 0
    for k in range(_MOST):
        plain, x = _followed(period_map, plain, _ROUND * multiple)
        changed, y = _followed(period_map, changed, _ROUND * multiple)
        changes.append((y - x)[used] / scale[used])
        if np.linalg.norm(changes[-1]) <= _GONE * _CHANGE:
            growth = 0.0
            break
        if k == 0:
            continue
        earlier, growth = growth, _largest_root(*changes[-3:]) ** (1.0 / _ROUND)
        is_equal = abs(growth - earlier) < _EQUAL[0 if abs(growth - 1.0) > _CLEAR else 1]
        equal = equal + 1 if is_equal else 0
        if equal == _IN_A_ROW and growth >= 1.0 - _CLEAR:
            break
    if growth > 1.0 + _NEUTRAL:
        return True
    period_map.restore(start)
    return False


def _followed(period_map: PeriodMap, start: Any, periods: int) -> tuple[Any, np.ndarray]:
    """Follow the motion over some periods from a snapshot; return a snapshot and the states (n,) at the end."""
    period_map.restore(start)
    for _ in range(periods):
        period_map.advance()
    return period_map.snapshot(), period_map.x


def _largest_root(first: np.ndarray, second: np.ndarray, third: np.ndarray) -> float:
    """Return the largest |z| for which z**2 = a z + b; the fit of third = a second + b first gives a and b."""
    unit = np.linalg.norm(second)
    a, b = np.linalg.lstsq(np.column_stack([second, first]) / unit, third / unit, rcond=None)[0]
    return float(np.abs(np.roots([1.0, -a, -b])).max())
