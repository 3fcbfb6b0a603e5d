"""This module runs a model for many parameters and starts, and returns the last period of each run.

The runs are those of `hybridsim.integrators.closed_form.compiled_loop`; a run with an unusual event is left to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hybridsim.engine.linear.motion_summary import NODES, WEIGHTS, MotionSummary
from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.run.method_kernels import NOT_LINEAR
from hybridsim.ensemble.group import Ensemble, Group
from hybridsim.ensemble.run import NEXT, Runs, run_ensemble

_GROUP_SIZE = 128  # runs whose tables are made together, so that they fit in the processor's cache

_run = Precompiled(run_ensemble)


class LastPeriods(NamedTuple):
    """The measures of the last forcing periods of some runs."""

    numbers: np.ndarray  # numbers (m,) of the runs
    periods: np.ndarray  # lengths (m,) of the periods
    summary: MotionSummary  # the motion over the period, one row of each array per run


def last_periods(
    ensemble: Ensemble, parameters: np.ndarray, starts: np.ndarray, periods: int
) -> Iterator[LastPeriods]:
    """Run all supported points over a number of forcing periods, and yield the last periods, in any order.

    parameters (N, P), in the order of the model; starts (N, n). The iteration ends early if `may_continue` of the
    ensemble returns False.
    """
    for group in ensemble.groups(parameters, starts, _GROUP_SIZE, periods):
        runs = _runs(ensemble, group, periods)
        _run_group(ensemble, group, runs)
        summary = MotionSummary(runs.extremes, runs.integrals, runs.sides, runs.held, runs.holding)
        yield LastPeriods(
            group.numbers[runs.done],
            runs.periods[runs.done],
            MotionSummary(*(part[runs.done] for part in summary)),
        )


def _runs(ensemble: Ensemble, group: Group, periods: int) -> Runs:
    m, n, count = len(group.numbers), ensemble.system.n, len(ensemble.hold)
    return Runs(
        tables=group.tables.addresses,
        vectors=group.vectors,
        rates=group.rates,
        starts=group.starts,
        ends=periods * group.periods,
        periods=group.periods,
        longest=group.longest,
        done=np.zeros(m, dtype=np.bool_),
        extremes=np.empty((m, 2, n)),
        integrals=np.empty((m, 2, n)),
        sides=np.empty((m, 2, n)),
        held=np.empty((m, 2, count)),
        holding=np.empty((m, 2, count), dtype=np.bool_),
        at=np.zeros(4, dtype=np.int64),
    )


def _run_group(ensemble: Ensemble, group: Group, runs: Runs) -> None:
    """Run all points of a group, until `may_continue` returns False."""
    under_way = packed(runs)
    with ensemble.scratch(group) as scratch:
        while True:
            _run(
                scratch.model, scratch.lin_at, NOT_LINEAR, ensemble.vector_positions, ensemble.surfaces,
                ensemble.hold, (NODES, WEIGHTS), under_way, scratch.slopes, *scratch.packs,
            )  # fmt: skip
            if runs.at[NEXT] == len(runs.ends) or not ensemble.may_continue():
                break
