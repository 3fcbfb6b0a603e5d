"""This module computes bifurcation diagrams by brute force: settled motions while a parameter rises and falls."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from os import PathLike
from typing import Any

import numpy as np

from hybridsim.analysis.compare.comparison_request import positive, whole
from hybridsim.analysis.keyword_options import refuse_unknown
from hybridsim.analysis.progress import Progress
from hybridsim.analysis.sweep.axes import Points, points_of
from hybridsim.analysis.sweep.result import Sweep
from hybridsim.analysis.sweep.section import Section, sampling_period, with_section
from hybridsim.analysis.sweep.work.job import Job, Settings, new_token
from hybridsim.analysis.sweep.work.measure import work
from hybridsim.arguments import callback, chosen_model, text
from hybridsim.calls import refusing
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.model import Model
from hybridsim.model.checks.units import units_of
from hybridsim.simulate import simulate

UP, DOWN = "up", "down"
DIRECTION = "direction"


class _UpAndDown:
    """The values of one parameter in rising order and then in falling order, as one series of runs."""

    def __init__(self, points: Points, count: int) -> None:
        rows = points.settings(range(count))
        order = np.argsort(points.axes[0].values, kind="stable").tolist()
        self._rising = [rows[k] for k in order]
        self.values = points.axes[0].values[order]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of steps in a chain of runs, and number of chains."""
        return 2 * len(self._rising), 1

    def settings(self, numbers: range) -> list[Settings]:
        """Return the settings of points: rising values for the first half of them, falling ones for the second half."""
        return [self._rising[min(k, 2 * len(self._rising) - 1 - k)] for k in numbers]


@refusing
def bifurcation(
    model: Model | str | PathLike[str],
    parameter: str,
    values: Sequence[Any],
    *,
    section: str | None = None,
    settle: int = 200,
    samples: int = 60,
    tol: float = 1e-6,
    params: Mapping[str, Any] | None = None,
    x0: Mapping[str, Any] | Sequence[float] | None = None,
    z0: Mapping[str, str] | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: Progress | bool | None = None,
    **options: Any,
) -> Sweep:
    """Sample the settled motion at a section, while a parameter is raised and lowered in steps.

    Each value starts at the end of its neighbour's run, so that coexisting stable motions can be found from
    below and from above. The falling branch starts at the end of the rising one. Branches that differ show
    hysteresis. Unstable motions are not found.

    Parameters
    ----------
    model : str, path or Model
        As in `simulate`.
    parameter, values : str, sequence of str or float
        The parameter and its values, in any order.
    section : str, optional
        None samples once per period of the forcing. An expression samples at its upward zero crossings. The
        name of a monitor samples at each of its events.
    settle, samples : int, optional
        Number of passages of the section before the first sample, and number of samples.
    tol : float, optional
        Samples are equal within this fraction of the largest size of each state.
    params, x0, z0 : mapping, optional
        As in `simulate`; x0 and z0 start the rising branch.
    executor, workers, progress : object, optional
        As in `sweep`; the runs are one chain, so that one worker is busy at a time.
    **options : Any
        Options of `simulate`.

    Returns
    -------
    Sweep
        Over the direction ("up", "down") and the parameter: the samples of each state in order of time, and
        ``repeats_after``, the n of a motion that repeats after n passages, or 0 if it does not within the
        samples.

    Raises
    ------
    UsageError
        If the model has no forcing of one period at any of the values and no ``section`` is given. If it has one at
        some values only, the error is the status of the others.

    Examples
    --------
    >>> import hybridsim as hs
    >>> found = hs.bifurcation("dfcs", "F0", [22, 30], settle=20, samples=4)
    >>> found["x"].shape, found.dimensions
    ((2, 2, 4), ('direction', 'F0'))
    """
    refuse_unknown([simulate], options)
    for name in ("keep", "save", "t_eval"):
        if name in options:
            raise UsageError(f"bifurcation() sets the option {name!r} itself", remedy=f"remove `{name}`")
    base = chosen_model(model, params).validate()
    points = points_of(base, {text(parameter, "parameter"): values}, "list")
    if points.axes[0].is_start:
        raise UsageError(
            f"{parameter} is a state, but bifurcation() varies a parameter",
            remedy="sweep initial values with hs.sweep",
        )
    with_level, level = with_section(base, section)
    measure = Section(
        level,
        whole(settle, "settle"),
        whole(samples, "samples"),
        positive(tol, "tol"),
        {"x0": x0, "z0": z0},
        options,
    )
    branches = _UpAndDown(points, len(points.axes[0].values))
    job = Job(new_token(), with_level, (parameter,), frozenset(), measure, True)
    if not level:
        _refuse_unforced(job, branches.settings(range(len(branches.values))))
    count = None if workers is None else whole(workers, "workers")
    began = time.perf_counter()
    collected, finished, who = work(job, branches, executor, count, callback(progress))
    names = {f"state {k}": state.name for k, state in enumerate(base.states)}
    found = collected.values(branches.shape)
    units = units_of(base)
    return Sweep(
        base,
        "grid",
        {DIRECTION: np.array([UP, DOWN]), parameter: branches.values},
        {names.get(name, name): _turned(array) for name, array in found.items()},
        _turned(collected.status.reshape(branches.shape)),
        {name: units[name] for name in names.values()} | {parameter: points.axes[0].unit},
        f"section {section}" if section else "once a period",
        not finished,
        time.perf_counter() - began,
        who,
    )


def _refuse_unforced(job: Job, points: Sequence[Settings]) -> None:
    """Raise the error for a missing period if the forcing has no period at any point."""
    fault: UsageError | None = None
    for settings in points:
        try:
            sampling_period(job.at(settings))
        except UsageError as error:
            fault = error
        except HybridsimError:  # it becomes the status of that point
            return
        else:
            return
    if fault is not None:
        raise fault


def _turned(array: np.ndarray) -> np.ndarray:
    """Reorder results from (step, 1, ...) to (branch, value, ...), with rising values in both branches."""
    rising, falling = np.split(array[:, 0], 2)
    return np.stack([rising, falling[::-1]])
