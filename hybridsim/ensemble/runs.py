"""This module runs a model for many parameters and starts, and returns the last period of each run.

The runs are those of `hybridsim.integrators.closed_form.compiled_loop`; a run with an unusual event is left to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.struct_pack import packed
from hybridsim.engine.run.method_kernels import NOT_LINEAR
from hybridsim.ensemble.group import Ensemble, Group
from hybridsim.ensemble.points import PeriodSummary
from hybridsim.ensemble.run import NEXT, Runs, run_ensemble

_GROUP_SIZE = 128  # runs whose tables are made together, so that they fit in the processor's cache

_run = Precompiled(run_ensemble)


class LastPeriods(NamedTuple):
    """The measures of the last forcing periods of some runs."""

    numbers: np.ndarray  # numbers (m,) of the runs
    periods: np.ndarray  # lengths (m,) of the periods
    summary: PeriodSummary  # the motion over the period, one row of each array per run


def last_periods(
    ensemble: Ensemble, parameters: np.ndarray, starts: np.ndarray, periods: int
) -> Iterator[LastPeriods]:
    """Run all supported points over a number of forcing periods, and yield the last periods as they are computed.

    parameters (N, P), in the order of the model; starts (N, n). The iteration ends early if `may_continue` of the
    ensemble returns False.
    """
    for group in ensemble.groups(parameters, starts, _GROUP_SIZE, periods):
        found = ensemble.summaries(group)
        runs = Runs(
            points=packed(group.points),
            ends=periods * group.points.periods,
            done=np.zeros(len(group.numbers), dtype=np.bool_),
            summaries=packed(found),
            at=np.zeros(4, dtype=np.int64),
        )
        _run_group(ensemble, group, runs)
        yield LastPeriods(
            group.numbers[runs.done],
            group.points.periods[runs.done],
            PeriodSummary(*(part[runs.done] for part in found)),
        )


def _run_group(ensemble: Ensemble, group: Group, runs: Runs) -> None:
    """Run all points of a group, until `may_continue` returns False."""
    under_way = packed(runs)
    with ensemble.scratch(group) as scratch:
        while True:
            _run(scratch.loop, NOT_LINEAR, scratch.fixed, under_way, *scratch.record, scratch.found)
            if runs.at[NEXT] == len(runs.ends) or not ensemble.may_continue():
                break
