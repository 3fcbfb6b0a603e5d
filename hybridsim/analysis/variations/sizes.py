"""How large each state becomes along a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hybridsim.solution import Solution

_SHARES = np.array([0.25, 0.5, 0.75])  # of each step, beside its ends


def sizes(solution: Solution) -> np.ndarray:
    """Largest absolute value (n,) of each state, at the ends of all steps and inside them."""
    index, s, x = solution._segments.knots()
    within = (index[1:] == index[:-1]) & (s[1:] != s[:-1])
    first, lengths = s[:-1][within], np.diff(s)[within]
    points = (first[:, None] + lengths[:, None] * _SHARES).ravel()
    inside = solution._segments.states(np.repeat(index[:-1][within], len(_SHARES)), points)
    return np.abs(np.concatenate([x, inside])).max(axis=0)
