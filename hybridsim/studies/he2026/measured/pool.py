"""This module evaluates a function at many points in parallel threads; the kernels release the GIL."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


class Pool:
    """Threads that process batches of items, and report the progress of the whole study.

    Parameters
    ----------
    shares : the share of each part in the whole, by name.
    progress : called with the finished fraction and the name of the part.
    workers : number of threads; by default the number of processors.
    """

    def __init__(
        self,
        shares: dict[str, float],
        progress: Callable[[float, str], None] | None = None,
        workers: int | None = None,
    ) -> None:
        self.workers = workers or os.cpu_count() or 1
        whole = sum(shares.values())
        self._shares = {name: share / whole for name, share in shares.items()}
        self._progress, self._before, self._part = progress, 0.0, ""

    def part(self, name: str) -> None:
        """Begin the next part of the study."""
        if self._part:
            self._before += self._shares[self._part]
        self._part = name
        self.tell(0.0)

    def tell(self, fraction: float) -> None:
        """Report the progress within the current part."""
        if self._progress is not None and self._part:
            done = self._before + self._shares[self._part] * min(max(fraction, 0.0), 1.0)
            self._progress(done, self._part)

    def map(
        self, function: Callable[[Item], Result], items: Iterable[Item], begin: float = 0.0, end: float = 1.0
    ) -> list[Result]:
        """Return function(item) for every item in order, and report progress from `begin` to `end`.

        An exception stops items that have not begun. Progress is reported from the calling thread, which may interrupt.
        """
        waiting: Sequence[Item] = list(items)
        with ThreadPoolExecutor(self.workers) as threads:
            futures: list[Future[Result]] = [threads.submit(function, item) for item in waiting]
            count = len(futures)
            try:
                # waiting again and again for the next of all open futures would cost the square of their
                # number
                for done, future in enumerate(as_completed(futures), start=1):
                    future.result()
                    self.tell(begin + (end - begin) * done / count)
            except BaseException:  # on Ctrl-C too, no more items are begun and the exception is raised again
                threads.shutdown(wait=True, cancel_futures=True)
                raise
        return [future.result() for future in futures]
