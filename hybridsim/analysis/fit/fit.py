"""This module fits unknowns of a model to records by nonlinear least squares."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from hybridsim.analysis.fit.doubts import is_local
from hybridsim.analysis.fit.effort import Effort
from hybridsim.analysis.fit.first_guesses import first_guesses, from_further_guesses
from hybridsim.analysis.fit.record import records_of, refuse_unknowns_of_records
from hybridsim.analysis.fit.residuals import Residuals
from hybridsim.analysis.fit.result import Fit
from hybridsim.analysis.fit.search import Search
from hybridsim.analysis.fit.summary import summed_up
from hybridsim.analysis.fit.unknown import unknowns_of
from hybridsim.analysis.keyword_options import refuse_unknown
from hybridsim.analysis.progress import Progress
from hybridsim.arguments import callback, cannot_be, chosen_model, number, text, whole_number
from hybridsim.calls import refusing
from hybridsim.errors import SimulationError, UsageError, nearest
from hybridsim.model import Model
from hybridsim.simulate import simulate

_LOSSES = ("linear", "soft_l1", "huber", "cauchy")
_PASSES = 4  # of the estimate of the noise of several quantities
_SETTLED = 0.01  # relative change of this estimate


@refusing
def fit(
    model: Model | str,
    records: Any,
    unknowns: Mapping[str, Any],
    *,
    noise: Mapping[str, float] | None = None,
    loss: str = "linear",
    starts: int | None = None,
    max_evaluations: int = 200,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Fit:
    """Fit parameters and start values of a model to measured quantities.

    The sum over all samples of rho(((measured - simulated)/noise)^2) is minimised by the trust-region method of
    `scipy.optimize.least_squares`. Its derivatives are exact, through all events (see `sensitivities`), if the run
    has exact derivatives and they take less time than two runs for each unknown. Otherwise they are central
    differences. `Fit.derivatives` names the kind. If a change of the unknowns changes the sequence of events, the sum
    has a kink there. Then a fit can end in a local minimum: use more `starts`.

    Parameters
    ----------
    model : Model, str or path
        The model. An unknown gain or offset of a sensor is a parameter of an output of the model.
    records : Record, mapping, path, DataFrame, or a sequence of these
        The measurements; see `Record`. One experiment is one record. All records share the unknowns.
    unknowns : mapping of str to (float, float) or Unknown
        Bounds by the name of a parameter, or of a start value: ``x(0)``. `Unknown` sets more than bounds.
    noise : mapping of str to float, optional
        Standard deviation of each quantity. By default each quantity has constant noise, which is estimated from
        the residuals.
    loss : str, optional
        The function rho of SciPy, "linear", "soft_l1", "huber" or "cauchy". The last three bound the effect of samples
        that are far off.
    starts : int, optional
        Number of first guesses: the guess of the unknowns, and points of a Latin hypercube between the bounds. The
        best result counts. The default is one guess. If its result may be a local minimum and all bounds are finite,
        the best 6 of 60 such points follow. They are fewer if they would take more than 20 s and more than twice as
        many runs as the guess. Then the result contains a warning.
    max_evaluations : int, optional
        Largest number of steps from each start.
    progress : bool or callable, optional
        True shows a bar; a function is called as progress(done, total, text) before each step. By default, a fit of
        more than 20 s prints one line on stderr, and False suppresses it.
    **options : Any
        Options of `simulate`, such as ``integrator`` or ``rtol``.

    Returns
    -------
    Fit
        Values, errors, residuals and warnings.

    Raises
    ------
    UsageError
        For a record, an unknown or an option that does not fit the model.
    SimulationError
        If the run of a record stops early from every first guess.

    Examples
    --------
    >>> import numpy as np, hybridsim as hs
    >>> t = np.linspace(0, 0.5, 40)
    >>> x = hs.simulate("free-decay", (0, 0.5), params={"mu": 0.3}).output("x", t)
    >>> found = hs.fit("free-decay", {"t": t, "x": x}, {"mu": (0.05, 0.9)})
    >>> abs(found.values["mu"] - 0.3) < 1e-6
    True
    """
    model = chosen_model(model, None).validate()
    refuse_unknown([simulate], options)
    for name in ("t_eval", "keep", "save", "params", "x0", "progress"):
        if name in options:
            raise UsageError(
                f"fit() sets the option {name!r} itself", remedy="describe each experiment by hs.Record(...)"
            )
    if text(loss, "loss") not in _LOSSES:
        raise UsageError(f"`loss` cannot be {loss!r}", remedy=f"use one of {', '.join(_LOSSES)}")
    count = 1 if starts is None else whole_number(starts, "starts", 1, 10_000)
    most = whole_number(max_evaluations, "max_evaluations", 1, 1_000_000)
    checked = unknowns_of(model, unknowns)
    chosen = records_of(records)
    refuse_unknowns_of_records(chosen, checked)
    effort = Effort(reports=progress is None)
    residuals = Residuals(model, chosen, checked, options, effort)
    if len(residuals.measured) <= len(checked):
        raise UsageError(
            f"there are {len(residuals.measured)} samples for {len(checked)} unknowns",
            remedy="use more samples than unknowns",
        )
    for record in chosen:  # a record of unknown quantities is refused before the first long run
        record.require_quantities(model, _quantities(residuals, record))
    stated = _noise_of(noise, residuals)
    guesses = first_guesses(checked, count)
    spread = {
        name: float(np.std(residuals.measured[residuals.quantity == name])) or 1.0 for name in residuals.names
    }
    search = Search(residuals, loss, most, callback(progress), len(guesses))
    results = [found for guess in guesses if (found := search.best_from(guess, stated or spread)) is not None]
    limited: tuple[str, ...] = ()
    is_bounded = starts is None and all(unknown.is_bounded for unknown in checked.values())
    if is_bounded and (not results or is_local(residuals, residuals.measured - results[0].predicted)):
        more, limited = from_further_guesses(search, effort, stated or spread, is_limited=bool(results))
        results += more
    if not results:
        raise SimulationError(
            f"the runs of the records stop early from every first guess: {residuals.failure}",
            remedy="use other guesses or narrower bounds",
        )
    best = min(results, key=lambda result: float(result.cost))
    sizes = stated or search.noise_of(best)
    for _ in range(_PASSES if not stated and len(spread) > 1 else 0):
        best = search.best_from(best.x, sizes) or best
        before, sizes = sizes, search.noise_of(best)
        if all(abs(sizes[name] - before[name]) <= _SETTLED * before[name] for name in sizes):
            break
    return summed_up(
        model, residuals, checked, best, sizes, is_stated=bool(stated), options=options, further=limited
    )


def _quantities(residuals: Residuals, record: Any) -> tuple[str, ...]:
    """Return the names of all quantities of the model, found by a run of zero length."""
    start = record.t0 if record.t0 is not None else float(record.t[0])
    empty = simulate(residuals.model, (start, start), params=dict(record.params), x0=dict(record.x0))
    return (*empty.names, *empty.quantities)


def _noise_of(noise: Any, residuals: Residuals) -> dict[str, float] | None:
    if noise is None:
        return None
    remedy = "use a dict with the standard deviation of each measured quantity"
    if not isinstance(noise, Mapping):
        raise cannot_be("noise", noise, remedy)
    for name in noise:
        if name not in residuals.names:
            raise UsageError(
                f"`noise` contains {name!r}, but no record contains {name!r}",
                remedy=nearest(str(name), residuals.names, kind="quantities"),
            )
    missing = [name for name in residuals.names if name not in noise]
    if missing:
        raise UsageError(f"`noise` lacks {', '.join(missing)}", remedy=remedy)
    found = {name: number(value, f"noise of {name}") for name, value in noise.items()}
    for name, value in found.items():
        if not (value > 0.0 and math.isfinite(value)):
            raise UsageError(f"the noise of {name} cannot be {value!r}", remedy="use a positive number")
    return found
