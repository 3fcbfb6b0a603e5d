"""What a worker does: sets the model to each of some points and measures it; nothing that fails there stops it."""

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
_MOST = 4  # sweeps whose model a worker of another process keeps


class Incomplete(SimulationError):
    """A measurement that could not be made, and what there is of it all the same."""

    def __init__(self, message: str, found: dict[str, Reading]) -> None:
        super().__init__(message)
        self.found = found


Settings = tuple[float | Expression, ...]


class Measure(Protocol):
    """Measures a model, and says what of the result is kept."""

    def run(self, model: Model, previous: Any) -> Any:
        """The result at a point; ``previous`` is that of the neighbour in a chain, or None."""

    def read(self, result: Any) -> Any:
        """What is kept of it: a number, an array, or a mapping of such and texts."""


@dataclass(frozen=True)
class Job:
    """A sweep as its workers know it.

    Parameters
    ----------
    token : tells sweeps apart.
    model : with all that is the same at every point.
    names : what is set at a point: parameters, and states with their initial values.
    starts : which of these are states.
    measure : what is measured.
    chained : whether a point is given the result of the one before it.
    """

    token: str
    model: Model
    names: tuple[str, ...]
    starts: frozenset[str]
    measure: Measure
    chained: bool

    def at(self, settings: Settings) -> Model:
        """The model at a point."""
        if not self.starts:
            return self.model.with_(**dict(zip(self.names, settings, strict=True)))
        pairs = list(zip(self.names, settings, strict=True))
        model = self.model.with_start(**{n: s for n, s in pairs if n in self.starts})
        return model.with_(**{n: s for n, s in pairs if n not in self.starts})


class Outcome(NamedTuple):
    """A point: "ok", or what went wrong; and the readings, where there are any."""

    status: str
    found: dict[str, Reading] | None


class Batch(NamedTuple):
    """Some points in their order, as far as they were run, and the seconds that they took."""

    outcomes: list[Outcome]
    seconds: float


class Watch(NamedTuple):
    """How a worker that shares memory with the sweep is asked to stop, and tells how many more points are done."""

    goes_on: Callable[[], bool]
    tell: Callable[[int], None]


_NOBODY = Watch(lambda: True, lambda points: None)


def new_token() -> str:
    """What no other sweep has."""
    return uuid.uuid4().hex


_jobs: dict[str, Job] = {}


def run_batch(job: Job, points: Sequence[Settings], watch: Watch | None = None) -> Batch:
    """Measure the model at some points, one after the other."""
    if watch is None:
        job, watch = _kept(job), _NOBODY
    began = time.perf_counter()
    together = None if job.chained else _together(job, points, watch)
    if together is not None:
        return Batch(together, time.perf_counter() - began)
    outcomes = []
    previous: Any = None
    for settings in points:
        if not watch.goes_on():
            break
        outcome, result = _run(job, settings, previous)
        outcomes.append(outcome)
        previous = result if job.chained else None
        watch.tell(1)
    return Batch(outcomes, time.perf_counter() - began)


def _together(job: Job, points: Sequence[Settings], watch: Watch) -> list[Outcome] | None:
    """By a measure that takes many points at once, where it takes these."""
    together = getattr(job.measure, "together", None)
    if together is None:
        return None
    found: list[Outcome] | None = together(job, points, lambda settings: _run(job, settings, None)[0], watch)
    return found


def _run(job: Job, settings: Settings, previous: Any) -> tuple[Outcome, Any]:
    try:
        result = job.measure.run(job.at(settings), previous)
        found = readings(job.measure.read(result))
        blank = getattr(job.measure, "blank", lambda _: ())(result)  # what is none at such a result
    except Incomplete as error:
        return Outcome(error.message, error.found), None
    except Exception as error:  # a measure may be anybody's: whatever it raises costs its own point only
        return Outcome(_said(error), None), None
    missing = [name for name in not_numbers(found) if name not in blank]
    if missing:
        return Outcome(f"not a number: {', '.join(missing)}", found), None
    return Outcome(DONE, found), result


def _said(error: Exception) -> str:
    """An error in one line, its kind before it."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def _kept(job: Job) -> Job:
    """The job as it came the first time: what the engine knows of a model hangs on the object."""
    known = _jobs.get(job.token)
    if known is not None:
        return known
    while len(_jobs) >= _MOST:
        _jobs.pop(next(iter(_jobs)), None)
    _jobs[job.token] = job
    return job
