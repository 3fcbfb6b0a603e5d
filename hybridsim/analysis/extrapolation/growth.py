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
_GONE = 1e-3  # smallest change that matters, relative to the first one
_NEUTRAL = 2e-4  # growth per repetition that is allowed, as of a direction in which a contact sticks anywhere


def grows(period_map: PeriodMap, scale: np.ndarray, multiple: int, direction: np.ndarray) -> bool:
    """Return whether a disturbance (n,) of a repeating motion grows; if it decays, restore the map.

    After some repetitions the change is in the direction that shrinks least or grows fastest. Its growth over a
    repetition then converges to the size of the largest multiplier. The motion is followed with and without the
    change until the growth has converged, or the change is gone. If the change grows, the map goes on from the
    changed states.
    """
    start = plain = period_map.snapshot()
    period_map.put(period_map.x + _CHANGE * direction / relative(direction, scale))
    changed = period_map.snapshot()
    used = scale > 0.0
    size, growth = _CHANGE, np.inf
    for k in range(_MOST):
        plain, x = _followed(period_map, plain, _ROUND * multiple)
        changed, y = _followed(period_map, changed, _ROUND * multiple)
        former, earlier = size, growth
        size = float(np.linalg.norm((y - x)[used] / scale[used]))
        growth = (size / former) ** (1.0 / _ROUND) if size > 0.0 else 0.0
        is_clear = abs(growth - 1.0) > _CLEAR
        if size <= _GONE * _CHANGE or (k > 0 and abs(growth - earlier) < _EQUAL[0 if is_clear else 1]):
            break
    if growth > 1.0 + _NEUTRAL:
        return True
    period_map.restore(start)
    return False


def _followed(period_map: PeriodMap, start: Any, periods: int) -> tuple[Any, np.ndarray]:
    """Follow the motion over some periods from a stored start; return the new stored state and the states (n,)."""
    period_map.restore(start)
    for _ in range(periods):
        period_map.advance()
    return period_map.snapshot(), period_map.x
