"""This module compares the errors and costs of integrators on one model, at several settings each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

from hybridsim.analysis.compare import comparison_request
from hybridsim.analysis.compare.comparison import Comparison
from hybridsim.analysis.compare.lines import Series, choose_series
from hybridsim.analysis.compare.prepared_case import PreparedCase
from hybridsim.analysis.compare.reference import find_reference
from hybridsim.analysis.compare.regularised import regularised_series
from hybridsim.analysis.compare.timed_runs import Budget, Entry, timed_rows
from hybridsim.analysis.progress import Progress, Steps
from hybridsim.arguments import callback, chosen_model
from hybridsim.calls import refusing
from hybridsim.engine.system.period import forcing_period
from hybridsim.errors import UsageError
from hybridsim.model import Model

BUDGET = 120.0  # seconds; the default
# The share of the budget that each run of a reference may take; there are at most three such runs.
REFERENCE_SHARE = 1 / 4


@refusing
def compare(
    model: Model | str | PathLike[str],
    t_span: tuple[float, float] | None = None,
    *,
    integrators: Sequence[str | tuple[str, Mapping[str, Any]] | Series] | None = None,
    rtols: Sequence[float] | None = None,
    steps: Sequence[int] | None = None,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, Any] | None = None,
    repeat: int = 3,
    reference: Any = None,
    regularized: str | Sequence[str] | None = None,
    v0: Sequence[float] | None = None,
    budget: float = BUDGET,
    progress: Progress | bool | None = None,
) -> Comparison:
    """Run a model with several integrators at several settings, and measure error and cost of each run.

    Errors are measured over the whole run, over its last period, and in the times of the events. The sequence
    of modes is compared separately. A run that fails becomes a row with the reason.

    Parameters
    ----------
    model : str, path or Model
        A `Model`, the name of a packaged one, or the path of a ``.toml`` file.
    t_span : tuple of float, optional
        (t0, t1), t1 > t0. By default from 0 over the model's own duration, else 20 periods T of the forcing,
        else 10 units of time.
    integrators : sequence of str, tuple or Series, optional
        Names, (name, options) or `Series`; by default all registered ones.
    rtols : sequence of float, optional
        Tolerances of the integrators with adaptive steps.
    steps : sequence of int, optional
        Steps per period of the fixed-step integrators; without a period, a tenth of the run counts as one.
    params, x0 : mapping of str to float, optional
        Parameter values and initial values by name, instead of the declared values.
    repeat : int, optional
        Timed repetitions of each run, in turns over all runs, after one that warms up; runs of seconds are
        repeated less often.
    reference : str, Solution or callable, optional
        What the errors are relative to. None: a closed form if one is known, else two accurate runs of
        different kinds. "closed form", "multiple precision" or "runs" require that kind. A Solution or a
        function t -> states is used as given.
    regularized : str or sequence of str, optional
        Kinds of `Model.regularized`. These forms are run as well as the set-valued law, over several v0 each,
        by default with `cvode-bdf` and `dop853` at rtol 1e-9. Their errors are relative to the set-valued
        reference.
    v0 : sequence of float, optional
        Widths of these forms, in the unit of the relative velocity; by default 1e-1 to 1e-4 of its nominal
        size.
    budget : float, optional
        Time limit in seconds. Work that does not fit is not run, and its row says so: first the repetitions
        are dropped, then the settings that take longest. A run of the reference may take a quarter of it.
    progress : bool or callable, optional
        True shows a bar; a function is called as progress(done, total, name of the next item).

    Returns
    -------
    Comparison
        One row per run, with its errors and costs.

    Examples
    --------
    >>> import hybridsim as hs
    >>> comparison = hs.compare("dfcs", integrators=["scipy-dop853", "cvode-bdf"])  # doctest: +SKIP
    >>> print(comparison.table())  # doctest: +SKIP
    """
    repeat, budget = comparison_request.whole(repeat, "repeat"), comparison_request.positive(budget, "budget")
    rtols, steps = comparison_request.positives(rtols, "rtols"), comparison_request.wholes(steps, "steps")
    v0 = comparison_request.positives(v0, "v0")
    model = chosen_model(model, params).with_start(**comparison_request.mapping(x0, "x0")).validate()
    period = forcing_period(model)
    span = comparison_request.run_span(t_span, model.duration_value(), period)
    if regularized is not None:
        kinds = comparison_request.checked_names(regularized, "regularized")
        names = None if integrators is None else comparison_request.checked_names(integrators, "integrators")
        series = regularised_series(model, kinds, v0, names, rtols)
    elif v0 is not None:
        raise UsageError(
            "`v0` requires `regularized`", remedy="add the names of the laws, such as regularized=['tanh']"
        )
    else:
        series = choose_series(integrators, rtols, steps, None if period else span[1] - span[0])
    case = PreparedCase(model, span, period)
    spending = Budget(budget)
    steps_to_do = Steps(1 + (1 + repeat) * sum(len(line.values) for line in series), callback(progress))
    steps_to_do("reference")
    against = find_reference(model, span, period, case.simulate, reference, seconds=REFERENCE_SHARE * budget)
    (rows,) = timed_rows([Entry(case, against, series)], repeat, spending, steps_to_do)
    steps_to_do.finish()
    return case.comparison(against, rows, repeat)
