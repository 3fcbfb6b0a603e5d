"""This module makes the first guesses of a fit, and further guesses in case a fit ends at a local minimum."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import OptimizeResult
from scipy.stats import qmc

from hybridsim.analysis.fit.effort import Effort
from hybridsim.analysis.fit.search import Search
from hybridsim.analysis.fit.unknown import Unknown
from hybridsim.errors import UsageError

_SEED = 0  # of the Latin hypercube
_SCANNED, _FOLLOWED = 60, 6  # of its points, if the first guess leads to a local minimum


def first_guesses(unknowns: Mapping[str, Unknown], starts: int) -> list[np.ndarray]:
    """Return first guesses as coordinates: the guess of each unknown, then a Latin hypercube between the bounds."""
    first = np.array([u.coordinate(float(u.guess or 0.0)) for u in unknowns.values()])
    if starts == 1:
        return [first]
    for name, unknown in unknowns.items():
        if not unknown.is_bounded:
            raise UsageError(
                f"{name} has no finite bounds, but more than one start needs finite bounds",
                remedy="give both bounds, or starts=1",
            )
    low, high = np.array([unknown.coordinate_bounds for unknown in unknowns.values()]).T
    points = qmc.LatinHypercube(len(first), seed=_SEED).random(starts - 1)
    return [first, *(low + points * (high - low))]


def from_further_guesses(
    search: Search, effort: Effort, noise: Mapping[str, float], *, is_limited: bool
) -> tuple[list[OptimizeResult], tuple[str, ...]]:
    """Return the results of fits from further guesses, and a warning if the limit on runs excluded some guesses.

    is_limited : whether the number of runs is limited. It is not if the first guess has no result.
    """
    allowed = effort.affordable_runs() if is_limited else None
    scanned = _SCANNED if allowed is None else min(_SCANNED, max(allowed // 2, 1))
    before, results, followed = effort.runs, [], 0
    guesses = search.most_promising(first_guesses(search.residuals.unknowns, 1 + scanned)[1:], noise)[
        :_FOLLOWED
    ]
    for guess in guesses:
        if followed and allowed is not None and effort.runs - before >= allowed:
            break
        followed += 1
        if (found := search.best_from(guess, noise)) is not None:
            results.append(found)
    if scanned == _SCANNED and followed == len(guesses):
        return results, ()
    return results, (
        f"the first guess may lead to a local minimum, and the runs are slow: {scanned} of {_SCANNED} further first "
        f"guesses were simulated and {followed} of {_FOLLOWED} followed (use `starts` for more)",
    )
