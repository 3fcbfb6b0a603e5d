"""This module defines `advise`, which finds the simplest model and the integrator that answer a question."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from os import PathLike
from typing import Any

from hybridsim import arguments
from hybridsim.analysis.advise.advice import Advice
from hybridsim.analysis.advise.certificates import certificates
from hybridsim.analysis.advise.ladder import FULL, Limits, Step, climb, scene_of
from hybridsim.analysis.advise.question import NoAnswer, Question, question_of, with_contact_outputs
from hybridsim.analysis.advise.region import over_region
from hybridsim.analysis.advise.settings import settings
from hybridsim.analysis.advise.uncertainty import ranges_of, spread
from hybridsim.analysis.compare.comparison_request import checked_names, mapping, positive
from hybridsim.analysis.compare.timed_runs import Budget
from hybridsim.analysis.ladder import LADDER, LadderStep
from hybridsim.analysis.progress import Progress
from hybridsim.analysis.time_budget import OutOfTime
from hybridsim.arguments import cannot_be
from hybridsim.calls import refusing
from hybridsim.errors import SimulationError, UsageError
from hybridsim.model import Model

_BUDGET = 120.0  # seconds; the default budget, as for a comparison
# The least time limit of a rung in seconds: for a single point, and per point of a region.
_LEAST, _LEAST_AT_A_POINT = 5.0, 2.0
_PAUSE = 0.1  # seconds between two progress reports on the same item
_FINER = 1e-6  # of the tolerance; the accuracy of the runs relative to it
_ACCURACY = (1e-10, 1e-6)  # bounds of the requested accuracy of the runs


@refusing
def advise(
    model: Model | str | PathLike[str],
    quantity: str | Callable[[Any], Any],
    tol: float = 0.01,
    *,
    over: Mapping[str, Sequence[Any]] | None = None,
    mode: str = "grid",
    uncertain: Mapping[str, tuple[float, float]] | None = None,
    t_span: tuple[float, float] | None = None,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, float] | None = None,
    rungs: Sequence[str] | None = None,
    v0: float | None = None,
    integrators: bool = True,
    workers: int | None = None,
    budget: float | None = None,
    progress: Progress | bool | None = None,
) -> Advice:
    """Find the simplest model, and the cheapest integrator setting, that give a quantity within a tolerance.

    Every rung of a ladder of simpler models is run and compared with the full model. Statements that theory
    makes without a run come first. Errors and costs are measured, not estimated.

    Parameters
    ----------
    model : str, path or Model
        As in `simulate`.
    quantity : str or callable
        Of the steady motion, or with ``t_span`` of a run: "amplitude.x", "peak.x", "maximum.f", "minimum.f",
        "mean.x", "energy.x" (the integral of x^2), "harmonic.x.3" (its modulus), "dissipated.f" (work per
        period), "stick_fraction.f", "period"; of a run alone: "final.x", "event_time.f.2" (the second event
        of f). Or a function of the `SteadyState` (with ``t_span`` of the `Solution`) that returns a number.
    tol : float, optional
        Largest relative error. If the full model's value is zero, a rung is adequate if its value is zero
        too. A value counts as zero below 1e-6 times the tolerance times the largest value of the same
        quantity.
    over, mode : mapping of str to sequence, str, optional
        Values of parameters as in `sweep`: a map of the simplest adequate rung.
    uncertain : mapping of str to tuple of float, optional
        Ranges of parameters, {"mu": (0.28, 0.32)}. The remarks then say whether these ranges change the
        quantity by more than the tolerance. Only the corners of the box of ranges are tried, so that an
        extreme inside it, as at a resonance, is missed.
    t_span : tuple of float, optional
        The time span of the run in question; without it the question is about the steady motion.
    params, x0 : mapping of str to float, optional
        As in `simulate`.
    rungs : sequence of str, optional
        Names of the rungs to try; by default all: at-rest, no-friction, viscous, no-stop,
        constant-mu-at-rest, constant-mu-mean, mu_s=mu_k, tanh, arctan, karnopp.
    v0 : float, optional
        Width of the regularised forces; by default a hundredth of the largest sliding speed.
    integrators : bool, optional
        Whether to try integrator settings for the full model; they are not tried over a region.
    workers : int, optional
        Number of threads for a region.
    budget : float, optional
        Time limit in seconds: 120 by default, unlimited over a region. Work that does not fit is not run, and
        its row says so. A rung that takes ten times as long as the full model is stopped earlier, but not
        before 5 seconds (over a region, 2 seconds per point).
    progress : bool or callable, optional
        True shows a bar; a function is called as progress(done, total, name of the next item).

    Returns
    -------
    Advice
        The result: ``ladder``, ``simplest``, ``integrator``, ``remarks``, ``table()``, ``plot()``.

    Raises
    ------
    UsageError
        For invalid arguments.
    SimulationError
        If the full model has no answer, or none within the budget.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.advise("dfcs", "amplitude.x", 0.03, params={"F0": 100}, rungs=["no-friction", "viscous"])
    >>> found.simplest.name
    'no-friction'
    """
    began = time.perf_counter()
    model = arguments.chosen_model(model, params)
    if x0 is not None:
        model = model.with_start(**mapping(x0, "x0"))
    model.validate()
    integrators = arguments.flag(integrators, "integrators")
    over = None if over is None else mapping(over, "over")
    tol = positive(tol, "tol")
    if not tol < 1.0:
        raise cannot_be("tol", tol, "use a relative tolerance below 1, such as 0.01")
    accuracy = min(max(_FINER * tol, _ACCURACY[0]), _ACCURACY[1])
    span = None if t_span is None else arguments.time_span(t_span)
    question = question_of(model, quantity, span, accuracy)
    width = None if v0 is None else positive(v0, "v0")
    chosen, ranges = _chosen(rungs), None if uncertain is None else ranges_of(model, uncertain)
    spending = Budget(_spendable(budget, over is not None))
    seen = with_contact_outputs(model)
    if over is not None:
        if ranges is not None:
            raise UsageError(
                "`over` and `uncertain` cannot be combined",
                remedy="remove `over` or `uncertain`; `uncertain` is for a single point",
            )
        options = {"mode": mode, "workers": workers, "progress": progress}
        limits = Limits(spending, _LEAST_AT_A_POINT, repeat=False)
        region, ladder = over_region(seen, over, chosen, question, tol, width, limits, options)
        return Advice(
            model,
            question.text,
            tol,
            float("nan"),
            ladder,
            region=region,
            seconds=time.perf_counter() - began,
        )
    report = _ProgressReport(progress, len(chosen) + 1 + integrators + (ranges is not None))
    limits = Limits(spending, _LEAST, report=report.again)
    report("full model")
    try:
        full = limits.warm(partial(question.ask, seen), limits.time_budget())
    except NoAnswer as reason:
        raise SimulationError(f"the full model has no value of {question.text}: {reason}") from reason
    except OutOfTime as fault:
        raise SimulationError(
            f"the full model gave no {question.text} within the budget: {fault}",
            remedy="pass a larger `budget`",
        ) from fault
    scene = scene_of(seen, full.motion, width)
    steps = []
    for rung, step in zip(chosen, climb(chosen, scene, question, full, tol, limits), strict=True):
        report(rung.name)
        steps.append(step)
    steps.append(
        Step(FULL, FULL, "nothing", full.value, 0.0, full.seconds, FULL, "the reference for the others")
    )
    tried = settings(seen, question, full, tol, limits, report) if integrators else ()
    known, left_out = None, ""
    if ranges is not None:
        report("ranges of parameters")
        try:
            known = _spread(seen, question, full.value, ranges, limits)
        except OutOfTime:
            left_out = f"{limits.spent}, so the effect of the parameter ranges was not computed"
    return Advice(
        model,
        question.text,
        tol,
        full.value,
        tuple(steps),
        tuple(c.text for c in certificates(model)),
        tried,
        known,
        left_out=left_out,
        seconds=time.perf_counter() - began,
    )


def _spendable(budget: float | None, is_region: bool) -> float:
    if budget is not None:
        return positive(budget, "budget")
    return math.inf if is_region else _BUDGET


def _spread(model: Model, question: Question, full: Any, ranges: Any, limits: Limits) -> Any:
    try:
        return spread(model, question, full, ranges, limits.time_budget())
    except NoAnswer as reason:
        raise SimulationError(
            f"{question.text} has no value at one end of the ranges in `uncertain`: {reason}"
        ) from reason


def _chosen(names: Sequence[str] | None) -> tuple[LadderStep, ...]:
    if names is None:
        return LADDER
    known = {rung.name: rung for rung in LADDER}
    asked_for = checked_names(names, "rungs")
    for name in asked_for:
        arguments.known_entry(name, list(known), "rungs", "a simpler model", "rungs")
    return tuple(rung for rung in LADDER if rung.name in asked_for)


class _ProgressReport:
    """Reports to the progress callback which computation begins, and repeats the report during long computations."""

    def __init__(self, progress: Progress | bool | None, total: int) -> None:
        self._progress, self._total, self._done = arguments.callback(progress), total, -1
        self._what, self._next = "", 0.0

    def __call__(self, what: str) -> None:
        self._done, self._what, self._next = min(self._done + 1, self._total - 1), what, 0.0
        self.again()

    def again(self) -> None:
        """Repeat the last progress report, unless it is very recent."""
        if self._progress is not None and time.monotonic() >= self._next:
            self._next = time.monotonic() + _PAUSE
            self._progress(self._done, self._total, self._what)
