"""This module computes the largest Lyapunov exponent of a motion with events.

It uses Benettin's method (G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15 (1980) 9,
doi:10.1007/BF02128236), with the saltation matrices of P. C. Mueller, Chaos, Solitons and Fractals 5 (1995)
1671, doi:10.1016/0960-0779(94)00170-U.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hybridsim.analysis.steady.motion import Motion, Point, point_at_end
from hybridsim.analysis.variations.carried import Carrier
from hybridsim.analysis.variations.directions import Directions

_STRETCHES = 60
_PERIODS = 5  # in each
_SMALLEST = 1e-280  # a smaller change has been reduced to nothing by stick


def largest_exponents(motion: Motion, start: Point, period: float) -> tuple[float, float]:
    """Return the mean growth rates of an initial change, over 150 periods and over the next 150 periods.

    Exponential growth has the same rate in both halves, unlike growth by a power of time. The rates are -inf if
    stick reduces the change to zero.
    """
    n, d = len(start.x), len(start.discrete)
    change = np.ones(n + d) / math.sqrt(n + d)
    parameters = np.zeros((len(motion.model.parameters), 1))
    logarithms, point = [], start
    for _ in range(_STRETCHES):
        solution = motion.run(point, _PERIODS * period)
        carried = Carrier(solution).carry(Directions(change[:n, None], change[n:, None], parameters))
        change = np.concatenate([carried.x[:, 0], carried.discrete[:, 0]])
        size = float(np.linalg.norm(change))
        if size < _SMALLEST:
            return -math.inf, -math.inf
        logarithms.append(math.log(size))
        change /= size
        point = replace(point_at_end(solution), at=start.at)
    half = _STRETCHES // 2
    rates = [sum(part) / (half * _PERIODS * period) for part in (logarithms[:half], logarithms[half:])]
    return rates[0], rates[1]
