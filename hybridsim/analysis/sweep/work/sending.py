"""This module sends a few batches of a sweep at a time to an executor, and stores the results."""

from __future__ import annotations

import os
import pickle
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from typing import Any, Protocol

from hybridsim.analysis.sweep.collected import Collected
from hybridsim.analysis.sweep.journal import Journal
from hybridsim.analysis.sweep.work.batches import Batches
from hybridsim.analysis.sweep.work.job import LOST, Batch, Job, Outcome, Settings, Watch, run_batch
from hybridsim.errors import UsageError

# Batches in progress per worker: one being computed and one waiting. More would only need memory.
_AHEAD = 2
_LOOK = 0.1  # seconds between checks of the threads, for progress and Ctrl-C


class Points(Protocol):
    """The protocol of the points of a sweep, which have numbers in the C order of `shape`."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the arrays of results; with `warm_start`, runs follow each other along the first axis."""

    def settings(self, numbers: range) -> list[Settings]:
        """Return the values of all axes at the points with the given numbers."""


def worker_count(executor: Any, workers: int | None) -> int:
    """Return the number of workers: as requested, otherwise one per worker of the executor or one per processor."""
    if workers is not None:
        return workers
    # The pools of the standard library have no public attribute for it; others count as one worker per
    # processor.
    known = getattr(executor, "_max_workers", None)
    return known if isinstance(known, int) and known > 0 else os.cpu_count() or 1


class Sending:
    """One sweep in progress.

    Parameters
    ----------
    job : the work at a point.
    points, batches : the points, and their division into batches.
    collected : stores the results.
    tell : called with the number of finished points; may raise KeyboardInterrupt.
    journal : receives the results as they arrive.
    """

    def __init__(
        self,
        job: Job,
        points: Points,
        batches: Batches,
        collected: Collected,
        tell: Callable[[int], None],
        journal: Journal | None = None,
    ) -> None:
        self._job, self._points, self._batches, self._collected = job, points, batches, collected
        self._tell, self._journal = tell, journal
        self._stop = threading.Event()
        self._shared_done = collected.done
        self._lock = threading.Lock()
        self._under_way: dict[Future[Batch], range] = {}

    def run(self, executor: Executor, workers: int) -> bool:
        """Run all batches; return False if interrupted. `collected` holds the results so far.

        Raises
        ------
        UsageError
            If the executor cannot take the work.
        """
        shares = isinstance(executor, ThreadPoolExecutor)
        watch = Watch(lambda: not self._stop.is_set(), self._count) if shares else None
        waiting = self._batches.next()
        try:
            while waiting is not None or self._under_way:
                # threads share the code that the first point compiles, so it runs alone
                width = 1 if shares and self._done == 0 else _AHEAD * workers
                while waiting is not None and len(self._under_way) < width:
                    settings = self._points.settings(waiting)
                    try:
                        future = executor.submit(run_batch, self._job, settings, watch)
                    except (pickle.PicklingError, TypeError, AttributeError, RuntimeError) as error:
                        self._refused(waiting, error)
                    else:
                        self._under_way[future] = waiting
                    waiting = self._batches.next()
                done, _ = wait(self._under_way, timeout=_LOOK, return_when=FIRST_COMPLETED)
                self._take(done)
                self._tell(self._done)
        except KeyboardInterrupt:
            self._stop.set()
            for future in self._under_way:
                future.cancel()
            # a thread stops after its point; batches begun in other processes are lost
            if shares:
                wait(self._under_way)
            self._take({f for f in self._under_way if f.done() and not f.cancelled() and not f.exception()})
            return False
        finally:
            self._stop.set()
        return True

    @property
    def _done(self) -> int:
        return max(self._collected.done, self._shared_done)

    def _count(self, points: int) -> None:
        with self._lock:
            self._shared_done += points

    def _take(self, done: set[Future[Batch]]) -> None:
        for future in done:
            numbers = self._under_way.pop(future)
            if future.cancelled():
                continue
            error = future.exception()
            if error is None:
                batch = future.result()
                self._collected.put(numbers, batch.outcomes)
                self._collected.one_by_one += batch.alone
                if self._journal is not None:
                    self._journal.note(numbers, batch.outcomes)
                self._batches.learn(len(batch.outcomes), batch.seconds)
            elif isinstance(error, KeyboardInterrupt):  # Ctrl-C reaches all processes of a terminal
                raise error
            else:
                self._refused(numbers, error)

    def _refused(self, numbers: range, error: BaseException) -> None:
        """Record a batch that could not be run; errors of single points are handled by the workers."""
        require_sendable(self._job, error)
        lost = Outcome(f"{LOST}: {type(error).__name__}: {error}", None)
        self._collected.put(numbers, [lost] * len(numbers))


def require_sendable(job: Job, cause: BaseException | None = None) -> None:
    """Raise an error if a sweep cannot be sent to another process; the error names the cause."""
    for part, thing in (("measure", job.measure), ("model", job.model)):
        try:
            pickle.dumps(thing)
        except Exception as error:  # pickle raises any error of the object's own methods
            raise UsageError(
                f"the {part} of the sweep cannot be sent to another process ({error})",
                remedy="define functions with def at the top level of a module, or remove `executor`",
            ) from (cause or error)
