"""This module defines `sweep`, which measures a model at many values of its parameters."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass
from os import PathLike
from typing import Any

from hybridsim import __version__
from hybridsim.analysis.compare.comparison_request import mapping, whole
from hybridsim.analysis.keyword_options import refuse_what_it_does_not_take
from hybridsim.analysis.progress import Progress
from hybridsim.analysis.structures.swept import declared, model_to_sweep
from hybridsim.analysis.sweep.axes import points_of
from hybridsim.analysis.sweep.journal import Journal, fingerprint
from hybridsim.analysis.sweep.last_period import LastPeriod
from hybridsim.analysis.sweep.named_measures import Steady, named_measure, units_of_readings
from hybridsim.analysis.sweep.result import Sweep
from hybridsim.analysis.sweep.run_readings import OfRun
from hybridsim.analysis.sweep.work.job import Job, Measure, new_token
from hybridsim.analysis.sweep.work.measure import work
from hybridsim.arguments import callback, cannot_be, flag, is_row
from hybridsim.calls import name_of, refusing
from hybridsim.errors import UsageError
from hybridsim.mechanics.declaration.system import MechanicalSystem
from hybridsim.model import Model


@dataclass(frozen=True)
class UserFunction:
    """A measure defined by a user's function of the model and, with `warm_start`, of the previous result."""

    function: Callable[..., Any]
    options: Mapping[str, Any]
    chained: bool

    def run(self, model: Model, previous: Any) -> Any:
        """Call the user's function at one point."""
        if self.chained:
            return self.function(model, previous, **self.options)
        return self.function(model, **self.options)

    def read(self, result: Any) -> Any:
        """Return the result unchanged."""
        return result


def measure_of(measure: Any, model: Model, chained: bool, options: Mapping[str, Any]) -> Measure:
    """Return the measure that the argument `measure` of `sweep` describes."""
    if callable(measure):
        refuse_what_it_does_not_take(measure, options)
        return UserFunction(measure, options, chained)
    if isinstance(measure, str):
        return named_measure(measure, model, options)
    names = tuple(measure) if is_row(measure) else ()
    if names and all(isinstance(word, str) for word in names):
        return named_measure(names, model, options)
    raise cannot_be("measure", measure, "use a function of the model, or the name of a built-in measure")


@refusing
def sweep(
    model: Model | MechanicalSystem | str | PathLike[str],
    values: Mapping[str, Sequence[Any]],
    measure: str | Sequence[str] | Callable[..., Any],
    *,
    mode: str = "grid",
    params: Mapping[str, Any] | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    warm_start: bool = False,
    after: int | None = None,
    units: Mapping[str, str] | None = None,
    journal: str | PathLike[str] | None = None,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Sweep:
    """Measure a model at many values of its parameters and initial values.

    A point that fails, or gives NaN, has a status with the reason, and never ends the sweep. The result is
    bit for bit the same for every executor, number of workers and order of completion.

    Parameters
    ----------
    model : str, path, Model or MechanicalSystem
        A `Model`, the name of a packaged one, or the path of a ``.toml`` file. The parameters of a
        `MechanicalSystem` are ``omega``, the lowest frequency of its forces and bases (the others keep their
        ratio to it), and ``CONTACT.normal``, ``CONTACT.base`` and ``CONTACT.mu`` for each contact and parameter
        of its law. Without a contact, ``normal`` sets all contacts if they have the same value.
    values : mapping of str to sequence
        For each parameter, or state (its initial value), a row of numbers or expressions: ``{"F0": [20, 30],
        "omega": ["0.5*sqrt(k/m)", 400]}``.
    measure : str, sequence of str or callable
        A function of the model that returns a number, a one-dimensional array, or a dict of these by name; or
        "steady" for the results of `steady_state`; or "final" for the states at the end of a run over
        ``t_span``; or names of readings of these: ``["amplitude.x", "rms.x", "mode_fraction.f.stick", "kind"]``,
        ``"final.x"``. With ``t_span`` readings such as ``"maximum.x"``, ``"stops.f"`` and
        ``"first_passage.x>0.1"`` are those of the whole run.
    mode : str, optional
        "grid", all combinations; "list", the k-th values of all together.
    params : mapping of str to str or float, optional
        Parameter values that are the same at every point.
    executor : Executor, optional
        Any `concurrent.futures.Executor`; by default threads, which run the compiled engine in parallel. For
        dask, use ``client.get_executor()``.
    workers : int, optional
        Number of points that run at the same time; by default one per processor, or the number of the
        executor's workers.
    warm_start : bool, optional
        Each point along the first axis (for a list: along all of it) receives the result of the previous one.
        A function is called as ``measure(model, previous)``, with None at the first point and after a failed
        one; a built-in measure starts from the neighbour's state. The first axis is then processed in order;
        the others are independent.
    after : int, optional
        A number of forcing periods from the start. Readings of a steady state are then taken from the period
        that ends there, whether or not the motion repeats by then (``residual`` measures how far it is from
        repeating; ``kind`` and related readings are not available). For a model of contacts and linear modes,
        all runs go through compiled code together, which is tens of times as fast as `steady_state`. This
        applies to readings of states and contacts; with outputs or harmonics each point runs separately.
    units : mapping of str to str, optional
        Units of readings, for labels.
    journal : str or path, optional
        A file to which results are written as they arrive. The same sweep with the same file continues from
        it. After a kill only the points in progress are lost (with ``warm_start`` the rows in progress), and
        the result is bit for bit that of an uninterrupted sweep. A function is identified by its code and all
        data that it reads, an object by its class and its state; a value that cannot be identified is
        refused.
    progress : bool or callable, optional
        True shows a bar; a function is called as progress(done, total, name of the next item).
    **options : Any
        Passed on to the measure: to the function, to `steady_state`, or to `simulate`.

    Returns
    -------
    Sweep
        The readings. After Ctrl-C it contains the points that were finished: ``interrupted`` is true, and the
        other points have the status "not run".

    Raises
    ------
    UsageError
        For an invalid parameter or measure, or work that an executor cannot take.
    ModelError
        For a faulty model.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.sweep("dfcs", {"F0": [10, 15, 30]}, lambda m: float(len(hs.simulate(m, (0, 0.05)).events)))
    >>> found["value"].tolist()[:2], bool(found.failed.any())
    ([0.0, 0.0], False)
    """
    swept = model_to_sweep(model, params).validate()
    points = points_of(swept, values, mode)
    tell, warm_start, names_of_units = (
        callback(progress),
        flag(warm_start, "warm_start"),
        mapping(units, "units"),
    )
    if after is not None:
        if warm_start:
            raise UsageError(
                "`warm_start` and `after` cannot be combined, because `after` counts periods from the initial "
                "state of the model",
                remedy="remove `warm_start` or `after`",
            )
        options["after"] = after
    count = None if workers is None else whole(workers, "workers")
    measured = measure_of(measure, swept, warm_start, options)
    job = Job(
        new_token(),
        swept,
        tuple(axis.name for axis in points.axes),
        frozenset(axis.name for axis in points.axes if axis.is_start),
        measured,
        warm_start,
    )
    began = time.perf_counter()
    asked = (
        swept.to_toml() if swept.flow is None else swept,
        points,
        measure,
        warm_start,
        options,
        __version__,
    )
    with Journal(journal, fingerprint(*asked)) if journal is not None else nullcontext() as file:
        collected, finished, who = work(job, points, executor, count, tell, file)
    nothing = measured.nothing() if isinstance(measured, Steady | OfRun | LastPeriod) else None
    found = collected.values(points.shape, nothing)
    known = {axis.name: axis.unit for axis in points.axes if axis.unit}
    if not callable(measure):
        known |= units_of_readings(found, swept)
    return Sweep(
        declared(swept),
        points.mode,
        {axis.name: axis.values for axis in points.axes},
        found,
        collected.status.reshape(points.shape),
        known | dict(names_of_units),
        _named(measure),
        not finished,
        time.perf_counter() - began,
        who,
        collected.one_by_one,
    )


def _named(measure: Any) -> str:
    if callable(measure):
        return name_of(measure)
    return measure if isinstance(measure, str) else ", ".join(measure)
