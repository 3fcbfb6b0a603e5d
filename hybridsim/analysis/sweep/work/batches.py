"""This module divides the points of a sweep into batches of suitable size."""

from __future__ import annotations

import math

import numpy as np

# Seconds per batch: a thousand times the cost of sending one, and short enough for ten reports of progress a
# second.
_SECONDS = 0.1
# Seconds of the shortest batches. Points that are measured together have tables in common, which take some
# milliseconds of Python for each batch, and Python runs on one thread at a time.
_SHORTEST = 0.01
_GROWTH = 8  # largest factor from one size to the next, because the first points may not be typical


class Batches:
    """Divides numbered points into batches.

    Parameters
    ----------
    total : number of points.
    chains : number of chains, each of which is one batch; None if no point needs its neighbour. The points of
        chain c are c, c + chains, c + 2 chains, ...: along the first axis of a grid, at fixed places on all others.
    workers : number of workers that share the batches.
    done : mask of the points (total,) that are finished; a chain is restarted unless all of it is finished.
    """

    def __init__(self, total: int, chains: int | None, workers: int, done: np.ndarray | None = None) -> None:
        self._total, self._chains, self._workers = total, chains, workers
        self._next, self._size, self._least = 0, 1, 1
        self._open = np.arange(total + 1) if done is None else np.append(np.flatnonzero(~done), total)

    def next(self) -> range | None:
        """Return the next batch, or None after the last one."""
        start = self._next
        if self._chains is not None:
            while start < self._chains and not (self._open[:-1] % self._chains == start).any():
                start += 1
            self._next = start + 1
            return range(start, self._total, self._chains) if start < self._chains else None
        left = len(self._open) - 1 - start
        if left <= 0:
            return None
        # the last batches are small, so that the workers finish together
        size = min(self._size, max(self._least, math.ceil(left / (2 * self._workers))), left)
        first = int(self._open[start])
        while self._open[start + size - 1] != first + size - 1:  # consecutive points
            size -= 1
        self._next += size
        return range(first, first + size)

    def learn(self, points: int, seconds: float) -> None:
        """Adapt the batch size to the measured time per point."""
        rate = points / seconds if seconds > 0 else math.inf
        largest = _GROWTH * points if points >= self._size else self._size
        self._size = max(1, int(min(_SECONDS * rate, largest)))
        self._least = max(1, int(min(_SHORTEST * rate, self._size)))
