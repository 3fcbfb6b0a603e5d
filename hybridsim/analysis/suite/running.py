"""This module runs the comparison suite within a time budget."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from hybridsim.analysis.compare import comparison_request
from hybridsim.analysis.compare.lines import Series, choose_series
from hybridsim.analysis.compare.prepared_case import PreparedCase
from hybridsim.analysis.compare.reference import (
    CLOSED_FORM,
    MULTIPLE_PRECISION,
    RUNS,
    Reference,
    find_reference,
)
from hybridsim.analysis.compare.timed_runs import Budget, Entry, timed_rows
from hybridsim.analysis.progress import Progress, Steps
from hybridsim.analysis.suite.result import SceneResult, SuiteComparison
from hybridsim.analysis.suite.scenes import SCENES, Scene, scene_names
from hybridsim.analysis.time_budget import OutOfTime, TimeBudget
from hybridsim.arguments import callback, known_name
from hybridsim.calls import refusing
from hybridsim.engine.system.period import forcing_period
from hybridsim.errors import UsageError
from hybridsim.model import load

BUDGET = 600.0
# The share of the budget for the reference of one scene; most of the budget is then left for the runs.
_REFERENCE_SHARE = 1 / 20


_RUNNING = 0.95  # the rest of the budget is for writing and drawing


@refusing
def compare_suite(
    *,
    scenes: Sequence[str] | None = None,
    integrators: Sequence[str | tuple[str, Mapping[str, Any]] | Series] | None = None,
    rtols: Sequence[float] | None = None,
    steps: Sequence[int] | None = None,
    repeat: int = 3,
    budget: float = BUDGET,
    progress: Progress | bool | None = None,
) -> SuiteComparison:
    """Run the test cases of the suite with several integrators at several settings, and compare correctness and cost.

    Every scene has a reference that is independent of the engine, a closed form or a multiple-precision
    motion, and a second one by the most accurate integrator. The result gives the distance between the two.

    Parameters
    ----------
    scenes : sequence of str, optional
        Names of the scenes to run; by default all.
    integrators, rtols, steps, repeat : object, optional
        As in `compare`; repetitions take turns over all scenes.
    budget : float, optional
        Time limit in seconds. If it does not suffice, the repetitions are dropped first, then the settings
        that take longest; `SuiteComparison.notes` lists the omissions.
    progress : bool or callable, optional
        True shows a bar; a function is called as progress(done, total, name of the next item).

    Returns
    -------
    SuiteComparison
        A `Comparison` for each scene, with verdicts and costs over all.

    Examples
    --------
    >>> import hybridsim as hs
    >>> suite = hs.compare_suite(scenes=["P1", "belt"], budget=60)  # doctest: +SKIP
    >>> print(suite.table())  # doctest: +SKIP
    """
    repeat, budget = comparison_request.whole(repeat, "repeat"), comparison_request.positive(budget, "budget")
    rtols, steps = comparison_request.positives(rtols, "rtols"), comparison_request.wholes(steps, "steps")
    spending = Budget(_RUNNING * budget)
    chosen = _chosen(scenes)
    cases = [_prepared_case(scene) for scene in chosen]
    lines = [
        choose_series(integrators, rtols, steps, None if case.period else case.t_span[1] - case.t_span[0])
        for case in cases
    ]
    runs = sum(len(line.values) for series in lines for line in series)
    step = Steps(len(chosen) + (1 + repeat) * runs, callback(progress))
    entries = []
    for scene, case, series in zip(chosen, cases, lines, strict=True):
        step(f"reference of {scene.name}")
        reference = _reference(case, min(budget * _REFERENCE_SHARE, spending.left), step)
        entries.append(Entry(case, reference, series))
    rows = timed_rows(entries, repeat, spending, step)
    step.finish()
    results = [
        SceneResult(scene, entry.case.comparison(entry.reference, found, repeat))
        for scene, entry, found in zip(chosen, entries, rows, strict=True)
    ]
    return SuiteComparison(tuple(results), repeat, budget, spending.spent)


def _chosen(names: Sequence[str] | None) -> tuple[Scene, ...]:
    if names is None:
        return SCENES
    names = comparison_request.checked_names(names, "scenes")
    for name in names:
        known_name(name, scene_names(), "the suite has no scene", "scenes")
    if not names:
        raise UsageError("the list of scenes is empty", remedy=f"use some of {', '.join(scene_names())}")
    return tuple(scene for scene in SCENES if scene.name in names)


def _prepared_case(scene: Scene) -> PreparedCase:
    model = load(scene.model).with_(**scene.params).validate()
    period = forcing_period(model)
    length = scene.t_end if scene.periods is None else scene.periods * (period or math.nan)
    return PreparedCase(model, (0.0, float(length or math.nan)), period)


def _reference(case: PreparedCase, seconds: float, step: Callable[[str], None]) -> Reference:
    """Return an exact reference if it can be computed in time, otherwise a reference from two runs."""
    watch = TimeBudget(seconds)

    def find(kinds: tuple[str, ...]) -> Reference:
        return find_reference(case.model, case.t_span, case.period, case.simulate, kinds, watch)

    try:
        return find((CLOSED_FORM, MULTIPLE_PRECISION, RUNS))
    except OutOfTime:
        warning = (
            f"a reference in multiple precision was not finished after {seconds:.2g} s: the "
            "reference is a run instead"
        )
        found = find((RUNS,))
        return replace(found, warnings=(*found.warnings, warning))
