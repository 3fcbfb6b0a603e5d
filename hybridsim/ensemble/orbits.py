"""This module finds the steady motions of a model at many values of its parameters, in compiled code."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.run.method_kernels import NOT_LINEAR
from hybridsim.ensemble.group import Ensemble, Group
from hybridsim.ensemble.newton import FOLLOWED, MULTIPLE, NEWTON_STEPS, NEXT, OUTCOME
from hybridsim.ensemble.points import RESTS, UNDECIDED, PeriodSummary
from hybridsim.ensemble.returns import LONGEST_WORD
from hybridsim.ensemble.search import MAX_PERIODS, MOST_FOLLOWED, Searches, search_orbits

_FEWEST = 4  # periods that are needed for a decision
_GROUP_SIZE = 256  # points of one compiled call
# A motion with a larger multiplier is not reached by waiting, as in `hybridsim.analysis.steady.shooting`.
_ATTRACTS = 1.0 - 1e-6

_search = Precompiled(search_orbits)


class Orbits(NamedTuple):
    """The steady motions of some points, one row of each array per point."""

    numbers: np.ndarray  # numbers (m,) of the points
    rests: np.ndarray  # (m,) whether the motion is an equilibrium
    periods: np.ndarray  # periods (m,) of the motions; those of the forcing for an equilibrium
    multiples: np.ndarray  # (m,) the same in periods of the forcing
    residuals: np.ndarray  # (m,) changes over the period relative to the scales of the states
    newton_steps: np.ndarray  # (m,)
    followed: np.ndarray  # (m,) periods of the forcing that were followed
    starts: np.ndarray  # states (m, n) at the start of the period
    modes: np.ndarray  # modes (m, C) there
    summary: PeriodSummary  # the motion over the period


def steady_orbits(
    ensemble: Ensemble,
    parameters: np.ndarray,
    starts: np.ndarray,
    tol: float,
    first_periods: int,
    max_periods: int,
) -> Iterator[Orbits]:
    """Yield groups of steady motions. Motions that need the general method are left out.

    parameters (N, P), in the order of the model; starts (N, n). tol, max_periods: as in `hs.steady_state`.
    first_periods: periods before the first test. The iteration ends early if `may_continue` of the ensemble returns
    False.
    """
    if first_periods > MOST_FOLLOWED:
        return
    settings = tol, max(first_periods, _FEWEST), min(max_periods, MAX_PERIODS)
    for group in ensemble.groups(parameters, starts, _GROUP_SIZE, LONGEST_WORD):
        found = ensemble.summaries(group)
        searches = _searches(group, found)
        under_way = packed(searches)
        with ensemble.scratch(group) as scratch:
            scratch.link_search(under_way)
            while True:
                arguments = NOT_LINEAR, scratch.fixed, under_way, scratch.search, settings
                if _search(scratch.loop, *arguments):
                    scratch.link_newton(under_way)
                elif searches.at[NEXT] == len(group.numbers) or not ensemble.may_continue():
                    break
        yield _decided(group, searches, found)


def _searches(group: Group, found: PeriodSummary) -> Searches:
    m, n = group.points.starts.shape
    return Searches(
        points=packed(group.points),
        counts=np.zeros((m, 4), dtype=np.int64),
        residuals=np.zeros(m),
        matrices=np.zeros((m, n, n)),
        modes=np.zeros((m, found.held.shape[-1]), dtype=np.int64),
        summaries=packed(found),
        at=np.zeros(2, dtype=np.int64),
    )


def _decided(group: Group, searches: Searches, found: PeriodSummary) -> Orbits:
    counts = searches.counts
    attracts = np.ones(len(counts), dtype=np.bool_)
    by_newton = searches.matrices.any(axis=(1, 2))  # the others were reached by waiting
    if by_newton.any():
        multipliers = np.linalg.eigvals(searches.matrices[by_newton])
        attracts[by_newton] = (np.abs(multipliers) <= _ATTRACTS).all(axis=1)
    done = (counts[:, OUTCOME] != UNDECIDED) & attracts
    counts = counts[done]
    return Orbits(
        group.numbers[done],
        counts[:, OUTCOME] == RESTS,
        counts[:, MULTIPLE] * group.points.periods[done],
        counts[:, MULTIPLE],
        searches.residuals[done],
        counts[:, NEWTON_STEPS],
        counts[:, FOLLOWED],
        group.points.starts[done],
        searches.modes[done],
        PeriodSummary(*(part[done] for part in found)),
    )
