"""Work on many points at once: the kernels leave the interpreter's lock, so threads serve."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


class Pool:
    """Threads for whole batches, and how far all of the work has come.

    Parameters
    ----------
    shares : how much of the whole each part takes, by its name.
    progress : called with the finished fraction and the name of the part.
    workers : threads; as many as there are processors unless given.
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
        """Begin a part of the work."""
        if self._part:
            self._before += self._shares[self._part]
        self._part = name
        self.tell(0.0)

    def tell(self, fraction: float) -> None:
        """Say how far the present part has come."""
        if self._progress is not None and self._part:
            done = self._before + self._shares[self._part] * min(max(fraction, 0.0), 1.0)
            self._progress(done, self._part)

    def map(
        self,
        function: Callable[[Item], Result],
        items: Iterable[Item],
        begin: float = 0.0,
        end: float = 1.0,
    ) -> list[Result]:
        """function(item) for every item, in their order; begin and end: which stretch of the part this is.

        An exception stops what has not begun. Progress is told from the calling thread, which may interrupt there.
        """
        waiting: Sequence[Item] = list(items)
        with ThreadPoolExecutor(self.workers) as threads:
            futures: list[Future[Result]] = [threads.submit(function, item) for item in waiting]
            count = len(futures)
            try:
                # to wait for the next of all that are open, again and again, goes as the square of their number
                for done, future in enumerate(as_completed(futures), start=1):
                    future.result()
                    self.tell(begin + (end - begin) * done / count)
            except BaseException:  # Ctrl-C above all: no more is begun, and it is raised again
                threads.shutdown(wait=True, cancel_futures=True)
                raise
        return [future.result() for future in futures]
