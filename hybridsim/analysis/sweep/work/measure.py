"""This module runs the points of a sweep on an executor, by default on threads, and reports progress."""

from __future__ import annotations

import math
import time
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np

from hybridsim.analysis.progress import Progress
from hybridsim.analysis.sweep.collected import Collected
from hybridsim.analysis.sweep.journal import Journal
from hybridsim.analysis.sweep.work.batches import Batches
from hybridsim.analysis.sweep.work.job import Job
from hybridsim.analysis.sweep.work.sending import Points, Sending, require_sendable, worker_count
from hybridsim.arguments import cannot_be
from hybridsim.errors import UsageError


def work(
    job: Job,
    points: Points,
    executor: Any,
    workers: int | None,
    progress: Progress | None,
    journal: Journal | None = None,
) -> tuple[Collected, bool, str]:
    """Run all points; return the results, whether all points were run, and the name of the executor.

    Raises
    ------
    UsageError
        If the executor is invalid, or cannot take the work.
    """
    if executor is not None and not isinstance(executor, Executor):
        raise cannot_be(
            "executor",
            executor,
            "use a concurrent.futures.Executor; a dask client has the method get_executor()",
        )
    if isinstance(executor, ProcessPoolExecutor):
        require_sendable(job)
    count = worker_count(executor, workers)
    total = math.prod(points.shape)
    chains = total // points.shape[0] if job.chained else None
    collected = Collected(total)
    done = _taken_over(journal, collected, chains) if journal is not None else None
    batches = Batches(total, chains, count, done)
    sending = Sending(job, points, batches, collected, _ProgressReport(total, progress), journal)
    if executor is not None:
        return collected, sending.run(executor, count), f"{type(executor).__name__} ({count})"
    with ThreadPoolExecutor(count, thread_name_prefix="sweep") as threads:
        return collected, sending.run(threads, count), f"threads ({count})"


def _taken_over(journal: Journal, collected: Collected, chains: int | None) -> np.ndarray:
    """Return a mask (total,) of points with a result in the journal; a `warm_start` chain must be complete."""
    total = len(collected.status)
    known = np.zeros(total, dtype=np.bool_)
    for line, (numbers, outcomes) in enumerate(journal.known, start=2):
        in_range = all(0 <= k < total for k in numbers)
        if in_range and chains is not None:
            in_range = numbers == list(range(numbers[0], total, chains))[: len(numbers)] if numbers else False
        elif in_range:  # each point has its own result
            in_range = len(set(numbers)) == len(numbers) and not known[numbers].any()
        if not (numbers and in_range and len(numbers) == len(outcomes)):
            raise UsageError(
                f"{journal.path}, line {line}: {numbers!r} are not among the {total} points of this sweep",
                remedy="remove this line from the file, or delete the file",
            )
        known[numbers] = True
        if chains is None or len(outcomes) == len(range(numbers[0], total, chains)):
            collected.put(numbers, outcomes)
    if chains is not None:
        columns = known.reshape(-1, chains)
        columns &= columns.all(axis=0)
    return known


class _ProgressReport:
    """Report the number of finished points and the remaining time."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self._total, self._progress = total, progress
        self._began: float | None = None
        self._first = 0

    def __call__(self, done: int) -> None:
        if self._progress is None:
            return
        now = time.monotonic()
        if (
            done and self._began is None
        ):  # the first point includes compiling, so that its time is not representative
            self._began, self._first = now, done
        text = f"{done} of {self._total} points"
        if self._began is not None and self._first < done < self._total:
            left = (now - self._began) / (done - self._first) * (self._total - done)
            text += f", {_duration(left)} left"
        self._progress(done, self._total, text)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
