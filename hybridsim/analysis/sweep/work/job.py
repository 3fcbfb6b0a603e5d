"""This module runs the points of a sweep: it sets parameters, measures the model, and catches errors."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from hybridsim.analysis.sweep.readings import Reading, not_numbers, readings
from hybridsim.errors import SimulationError
from hybridsim.expr import Expression
from hybridsim.model import Model

DONE, NOT_RUN = "ok", "not run"
LOST = "the executor lost the batch"  # how the status of a point begins whose worker has ended
_MAX_JOBS = 4  # number of sweeps whose model a worker process keeps


class Incomplete(SimulationError):
    """Raised if a measurement failed; `found` contains the partial results."""

    def __init__(self, message: str, found: dict[str, Reading]) -> None:
        super().__init__(message)
        self.found = found


Settings = tuple[float | Expression, ...]


class Measure(Protocol):
    """The protocol of a measure, which runs a model and selects the values to store."""

    def run(self, model: Model, previous: Any) -> Any:
        """Return the result at a point; ``previous`` is the previous point's result, or None."""

    def read(self, result: Any) -> Any:
        """Return the values to store: a number, an array, or a mapping of numbers, arrays and texts."""


@dataclass(frozen=True)
class Job:
    """The description of a sweep that is sent to its workers.

    Parameters
    ----------
    token : identifies the sweep.
    model : the model with all settings that are the same at every point.
    names : the names set at a point: parameters, and states with their initial values.
    starts : the states among them.
    measure : the measure.
    chained : whether a point receives the result of the previous one.
    """

    token: str
    model: Model
    names: tuple[str, ...]
    starts: frozenset[str]
    measure: Measure
    chained: bool

    def at(self, settings: Settings) -> Model:
        """Return the model with the parameters and initial values of a point."""
        if not self.starts:
            return self.model.with_(**dict(zip(self.names, settings, strict=True)))
        pairs = list(zip(self.names, settings, strict=True))
        model = self.model.with_start(**{n: s for n, s in pairs if n in self.starts})
        return model.with_(**{n: s for n, s in pairs if n not in self.starts})


class Outcome(NamedTuple):
    """The outcome of one point: status "ok" or the error, and the values if there are any."""

    status: str
    found: dict[str, Reading] | None


class Together(NamedTuple):
    """The outcomes of points that were measured together, and the number of points that had to be measured alone."""

    outcomes: list[Outcome]
    alone: int


class Batch(NamedTuple):
    """The outcomes of a batch in order, its time in seconds, and the number of points measured one by one."""

    outcomes: list[Outcome]
    seconds: float
    alone: int


class Watch(NamedTuple):
    """The link from a worker to the sweep, which reports finished points and passes on stop requests."""

    may_continue: Callable[[], bool]
    tell: Callable[[int], None]


_NOBODY = Watch(lambda: True, lambda points: None)


def new_token() -> str:
    """Return a token that identifies one sweep."""
    return uuid.uuid4().hex


_jobs: dict[str, Job] = {}


def run_batch(job: Job, points: Sequence[Settings], watch: Watch | None = None) -> Batch:
    """Measure the model at some points, one after the other."""
    if watch is None:
        job, watch = _first_copy(job), _NOBODY
    began = time.perf_counter()
    together = None if job.chained else _together(job, points, watch)
    if together is not None:
        return Batch(together.outcomes, time.perf_counter() - began, together.alone)
    outcomes = []
    previous: Any = None
    for settings in points:
        if not watch.may_continue():
            break
        outcome, result = _run(job, settings, previous)
        outcomes.append(outcome)
        previous = result if job.chained else None
        watch.tell(1)
    return Batch(outcomes, time.perf_counter() - began, len(outcomes))


def _together(job: Job, points: Sequence[Settings], watch: Watch) -> Together | None:
    """Measure many points at once if the measure supports it, otherwise return None."""
    together = getattr(job.measure, "together", None)
    if together is None:
        return None
    found: Together | None = together(job, points, lambda settings: _run(job, settings, None)[0], watch)
    return found


def _run(job: Job, settings: Settings, previous: Any) -> tuple[Outcome, Any]:
    try:
        result = job.measure.run(job.at(settings), previous)
        found = readings(job.measure.read(result))
        blank = getattr(job.measure, "blank", lambda _: ())(
            result
        )  # readings that do not exist for such a result
    except Incomplete as error:
        return Outcome(error.message, error.found), None
    except Exception as error:  # a user's measure may raise anything; it costs its own point only
        return Outcome(_message(error), None), None
    missing = [name for name in not_numbers(found) if name not in blank]
    if missing:
        return Outcome(f"not a number: {', '.join(missing)}", found), None
    return Outcome(DONE, found), result


def _message(error: Exception) -> str:
    """Return an error as one line that begins with its type."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _first_copy(job: Job) -> Job:
    """Return the first copy of a job that this process received, so that all batches share one compiled model."""
    known = _jobs.get(job.token)
    if known is not None:
        return known
    while len(_jobs) >= _MAX_JOBS:
        _jobs.pop(next(iter(_jobs)), None)
    _jobs[job.token] = job
    return job
