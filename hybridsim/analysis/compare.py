"""Which integrator buys accuracy cheapest on a model: error and cost of each at several settings."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any

from hybridsim.analysis.comparison import Comparison
from hybridsim.analysis.provenance import provenance
from hybridsim.analysis.reference import Reference, Run, find_reference
from hybridsim.analysis.rows import Cost, Row
from hybridsim.analysis.series import Series, choose_series
from hybridsim.analysis.timing import timed_in_turns
from hybridsim.analysis.trajectory import trajectory_of
from hybridsim.engine.period import forcing_period
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.model import Model, load

if TYPE_CHECKING:
    from hybridsim.solution import Solution

PERIODS = 20  # long enough for the transient of a damped scene, short enough to repeat dozens of runs
TIME = 10.0  # of a model without a period: a few swings of a mechanism of about 1 Hz

Progress = Callable[[int, int, str], None]


def compare(
    model: Model | str | PathLike[str],
    *,
    t_span: tuple[float, float] | None = None,
    integrators: Sequence[str | tuple[str, Mapping[str, Any]] | Series] | None = None,
    rtols: Sequence[float] | None = None,
    steps: Sequence[int] | None = None,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, Any] | None = None,
    repeat: int = 3,
    reference: Any = None,
    progress: Progress | None = None,
) -> Comparison:
    """Run a model with several integrators at several settings, and measure error and cost of each run.

    Errors are measured over the whole run, over its last period, and in the times of the events; the sequence
    of modes is judged apart. A run that fails becomes a row that says so.

    Parameters
    ----------
    model : a `Model`, the name of a packaged one, or the path of a ``.toml`` file.
    t_span : (t0, t1), t1 > t0; (0, 20 T) if not given, (0, 10) where the model has no forcing period T.
    integrators : names, (name, options) or `Series`; all registered ones if not given.
    rtols : tolerances of the integrators that adapt their step.
    steps : steps a period of those that do not; without a period, a tenth of the run counts as one.
    params, x0 : parameter values and initial values by name, in place of the declared ones.
    repeat : timed repetitions of each run, in turns over all of them, after one that warms up; runs of seconds
        are repeated less often.
    reference : what the errors are relative to: None for a closed form where one is known, else two accurate
        runs of different kind; "closed form" or "runs" to insist; a Solution; or a function t -> states.
    progress : called as progress(done, total, what is next).

    Examples
    --------
    >>> import hybridsim as hs
    >>> comparison = hs.compare("dfcs", integrators=["scipy-dop853", "cvode-bdf"])  # doctest: +SKIP
    >>> print(comparison.table())  # doctest: +SKIP
    """
    if repeat < 1:
        raise UsageError(f"repeat = {repeat}", remedy="give a whole number above zero")
    model = load(model) if not isinstance(model, Model) else model
    model = model.with_(**(params or {})).with_start(**(x0 or {})).validate()
    period = forcing_period(model)
    span = _span(t_span, period)
    series = choose_series(integrators, rtols, steps, None if period else span[1] - span[0])
    run = functools.partial(_simulate, model, span)
    total = 2 + sum(len(line.values) for line in series) * (1 + repeat)
    done = 0

    def step(text: str) -> None:
        nonlocal done
        if progress is not None:
            progress(done, total, text)
        done += 1

    step("reference")
    against = find_reference(model, span, period, run, reference)
    rows = [_first_run(line, value, run, against, step) for line in series for value in line.values]
    timed = [i for i, row in enumerate(rows) if row.cost is not None]
    calls = [functools.partial(run, rows[i].integrator, **rows[i].options) for i in timed]
    for i, times in zip(
        timed, timed_in_turns(calls, repeat, lambda k: step(f"timing {rows[timed[k]].label}"))
    ):
        rows[i] = rows[i].timed(times)
    if progress is not None:
        progress(total, total, "done")
    return Comparison(
        title=f"{model.name}: {model.title}" if model.title else model.name,
        t_span=span,
        period=period,
        reference=against.title,
        uncertainty=against.uncertainty,
        rows=tuple(rows),
        repeat=repeat,
        provenance=provenance(model),
        warnings=against.warnings,
    )


def _span(t_span: tuple[float, float] | None, period: float | None) -> tuple[float, float]:
    if t_span is None:
        return 0.0, PERIODS * period if period else TIME
    t0, t1 = map(float, t_span)
    if not t1 > t0:
        raise UsageError(f"t_span = ({t0:g}, {t1:g})", remedy="comparisons run forward: give t1 > t0")
    return t0, t1


def _simulate(model: Model, span: tuple[float, float], integrator: str, **options: Any) -> Solution:
    from hybridsim.simulate import simulate

    solution = simulate(model, span, integrator=integrator, **options)
    if solution.status == "interrupted":  # Ctrl-C means the whole comparison, not the one run that took it
        raise KeyboardInterrupt
    return solution


def _first_run(
    line: Series, value: float, run: Run, reference: Reference, step: Callable[[str], None]
) -> Row:
    """The run that warms up, and whose errors and counts are those of the row; its time is not."""
    options = line.options_at(value)
    step(f"{line.label}, {line.varied} {value:g}")
    row = Row(line.integrator, line.label, (line.varied, value), options, "failed")
    try:
        solution = run(line.integrator, **options)
        if not solution.success:
            return replace(row, status=solution.status, message=solution.message)
        errors = reference.yardstick.measure(trajectory_of(solution))
    except HybridsimError as error:
        return replace(
            row, status="refused" if isinstance(error, UsageError) else "failed", message=error.message
        )
    except Exception as error:  # an integrator may be anybody's: whatever it raises costs its own row only
        return replace(row, message=f"{type(error).__name__}: {error}")
    stats = solution.stats
    counts = (int(stats[name]) for name in ("rhs_evaluations", "guard_evaluations", "steps"))
    return replace(row, status=solution.status, errors=errors, cost=Cost((), *counts))
